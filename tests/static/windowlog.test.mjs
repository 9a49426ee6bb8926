// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { BATCH, EVERY_MS, MOST, TRIES, visitName, WindowLog } from "../../static/js/lib/windowlog.js";

/** @import { Batch } from "../../static/js/lib/windowlog.js" */

/** A log whose batches are kept here; `answers` say which of them arrive (true when there is none left). */
function log(/** @type {(boolean | Error | Promise<boolean>)[]} */ ...answers) {
  /** @type {(Batch & { leaving: boolean })[]} */ const sent = [];
  /** @type {{ callback: () => void, ms: number }[]} */ const timers = [];
  let time = 0;
  const made = new WindowLog({
    page: "play:1",
    visit: "abcdefgh",
    now: () => {
      time += 10;
      return time;
    },
    later: (callback, ms) => timers.push({ callback, ms }),
    send: async (batch, leaving) => {
      sent.push({ ...batch, leaving });
      const answer = answers.shift() ?? true;
      if (answer instanceof Error) throw answer;
      return answer;
    },
  });
  /** The timer that is set runs out. */
  const due = async () => {
    timers.shift()?.callback();
    await new Promise((resolve) => setImmediate(resolve));
  };
  return { made, sent, timers, due };
}

const seqs = (/** @type {Batch | undefined} */ batch) => batch?.events.map(({ seq }) => seq);

test("events are numbered in order and go in one batch, once", async () => {
  const { made, sent, timers, due } = log();
  made.note("loaded", "1280x720");
  made.note("blur");
  assert.deepEqual(
    timers.map(({ ms }) => ms),
    [EVERY_MS],
  );
  await due();
  assert.equal(sent.length, 1);
  assert.deepEqual(sent[0]?.events, [
    { seq: 0, kind: "loaded", value: "1280x720", at_ms: 10 },
    { seq: 1, kind: "blur", value: "", at_ms: 20 },
  ]);
});

test("a window to which nothing happens sets no timer and sends nothing", async () => {
  const { made, sent, timers, due } = log();
  assert.equal(timers.length, 0);
  made.note("loaded");
  await due();
  await made.leave();
  assert.deepEqual([sent.length, timers.length], [1, 0]);
});

test("what did not arrive is sent again with what came since, and let go after a few tries", async () => {
  const { made, sent, timers, due } = log(false, new Error("offline"), false);
  made.note("blur");
  await due();
  made.note("focus");
  for (let i = 1; i < TRIES; i += 1) await due();
  assert.deepEqual(sent.map(seqs), [[0], [0, 1], [0, 1]]);
  assert.equal(timers.length, 0, "nothing is waiting any more");
  made.note("blur");
  await due();
  assert.deepEqual(seqs(sent.at(-1)), [2], "later events have their own tries");
});

test("one batch is on its way at a time, and never a longer one than the server takes", async () => {
  const { made, sent, timers, due } = log();
  for (let i = 0; i < BATCH + 5; i += 1) made.note("blur");
  assert.equal(timers.length, 1);
  await due();
  await due();
  assert.deepEqual(
    sent.map(({ events }) => events.length),
    [BATCH, 5],
  );
});

test("leaving the page sends at once all that is waiting, also what is on its way", async () => {
  /** @type {(arrived: boolean) => void} */ let answer = () => {};
  const slow = new Promise((/** @type {(arrived: boolean) => void} */ resolve) => {
    answer = resolve;
  });
  const { made, sent, due } = log(slow);
  made.note("blur");
  await due();
  for (let i = 0; i < BATCH; i += 1) made.note("resize", "1x1");
  const left = made.leave();
  assert.deepEqual(
    sent.map(({ events, leaving }) => [events.length, leaving]),
    [
      [1, false],
      [BATCH, true],
      [1, true],
    ],
  );
  assert.equal(sent[1]?.events[0]?.seq, 0, "the one on its way may not arrive");
  answer(true);
  await left;
});

test("a page that was hidden and comes back sends again only what did not arrive", async () => {
  const { made, sent, due } = log(true);
  made.note("hidden");
  await made.leave();
  made.note("visible");
  await due();
  assert.deepEqual(sent.map(seqs), [[0], [1]]);
  const refused = log(false);
  refused.made.note("hidden");
  await refused.made.leave();
  refused.made.note("visible");
  await refused.due();
  assert.deepEqual(refused.sent.map(seqs), [[0], [0, 1]]);
});

test("a window that never stops is not listened to for ever", async () => {
  const { made, sent } = log();
  for (let i = 0; i < MOST + 50; i += 1) made.note("resize", "1x1");
  await made.leave();
  assert.equal(sent.flatMap(({ events }) => events).length, MOST);
});

test("a visit's name fits what the server takes, and no two are the same", () => {
  assert.match(visitName(), /^[0-9A-Za-z-]{8,40}$/);
  assert.notEqual(visitName(), visitName());
});
