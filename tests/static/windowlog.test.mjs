// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { BATCH, MOST, TRIES, visitName, WindowLog } from "../../static/js/lib/windowlog.js";

/** @import { Batch } from "../../static/js/lib/windowlog.js" */

/** A log whose batches are kept here; `answers` say which of them arrive (true when there is none left). */
function log(/** @type {(boolean | Error)[]} */ ...answers) {
  /** @type {(Batch & { keepalive: boolean })[]} */ const sent = [];
  let time = 0;
  const made = new WindowLog({
    page: "play:1",
    visit: "abcdefgh",
    now: () => {
      time += 10;
      return time;
    },
    send: async (batch, keepalive) => {
      sent.push({ ...batch, keepalive });
      const answer = answers.shift() ?? true;
      if (answer instanceof Error) throw answer;
      return answer;
    },
  });
  return { made, sent };
}

const seqs = (/** @type {Batch | undefined} */ batch) => batch?.events.map(({ seq }) => seq);

test("events are numbered in order and go in one batch, once", async () => {
  const { made, sent } = log();
  made.note("loaded", "1280x720");
  made.note("blur");
  await made.flush();
  await made.flush();
  assert.equal(sent.length, 1);
  assert.deepEqual(sent[0]?.events, [
    { seq: 0, kind: "loaded", value: "1280x720", at_ms: 10 },
    { seq: 1, kind: "blur", value: "", at_ms: 20 },
  ]);
});

test("what did not arrive is sent again with what came since, and let go after a few tries", async () => {
  const { made, sent } = log(false, new Error("offline"), false);
  made.note("blur");
  await made.flush();
  made.note("focus");
  for (let i = 1; i < TRIES; i += 1) await made.flush();
  assert.deepEqual(sent.map(seqs), [[0], [0, 1], [0, 1]]);
  assert.equal(made.waiting, 0);
  made.note("blur");
  await made.flush();
  assert.deepEqual(seqs(sent.at(-1)), [2], "later events have their own tries");
});

test("one batch is on its way at a time, and never a longer one than the server takes", async () => {
  const { made, sent } = log();
  for (let i = 0; i < BATCH + 5; i += 1) made.note("blur");
  await Promise.all([made.flush(), made.flush()]);
  assert.deepEqual([sent.length, sent[0]?.events.length], [1, BATCH]);
  await made.flush();
  assert.equal(sent[1]?.events.length, 5);
});

test("leaving the page sends at once what is waiting, also what is on its way", async () => {
  const { made, sent } = log();
  made.note("blur");
  const flushing = made.flush();
  made.note("hidden");
  made.leave();
  await flushing;
  assert.deepEqual(sent.map(seqs), [[0], [0, 1]]);
  assert.deepEqual(
    sent.map(({ keepalive }) => keepalive),
    [false, true],
  );
});

test("a window that never stops is not listened to for ever", () => {
  const { made } = log();
  for (let i = 0; i < MOST + 50; i += 1) made.note("resize", "1x1");
  assert.equal(made.waiting, MOST);
});

test("a visit's name fits what the server takes, and no two are the same", () => {
  assert.match(visitName(), /^[0-9A-Za-z-]{8,40}$/);
  assert.notEqual(visitName(), visitName());
});
