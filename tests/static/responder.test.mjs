// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Responder } from "../../static/js/lib/responder.js";
import { FakeClock, FakePage } from "./fakes.mjs";

const PEDALS = { go: 0, brake: 1 };

function setting() {
  const clock = new FakeClock();
  const page = new FakePage();
  const responder = new Responder({ clock, page, attention: page.attention, boardPx: () => 560 });
  /** @type {number[]} */ const writes = [];
  const ask = (resumed = false) => responder.ask({ write: () => writes.push(clock.now()), keys: PEDALS, resumed });
  return { clock, page, responder, writes, ask };
}

test("the picture is written inside a frame, and that is the onset", async () => {
  const { clock, page, writes, ask } = setting();
  const decision = ask();
  assert.deepEqual(writes, [], "not before the frame");
  clock.tick(16);
  assert.deepEqual(writes, [16]);
  clock.pass(300);
  page.key("j", 310);
  const { action, timing } = await decision;
  assert.equal(action, 0);
  assert.deepEqual([timing.onset_ms, timing.response_ms, timing.rt_ms, timing.handler_lag_ms], [16, 310, 294, 6]);
  assert.equal(timing.input, "key");
  assert.equal(timing.board_px, 560);
});

test("keys that mean nothing here change nothing and keep their default", async () => {
  const { clock, page, ask } = setting();
  const decision = ask();
  clock.tick();
  page.key("x", 20);
  page.key("ArrowUp", 20);
  page.key("j", 20, { ctrlKey: true });
  page.key("f", 30);
  assert.equal((await decision).action, 1);
  assert.deepEqual(page.prevented, ["f"]);
  assert.equal((await decision).timing.early_keys, 0);
});

test("a held key answers once: repeats are ignored and not counted", async () => {
  const { clock, page, ask } = setting();
  const first = ask();
  clock.tick();
  page.key("j", 20);
  await first;
  const second = ask();
  page.key("j", 21, { repeat: true });
  clock.tick();
  page.key("j", 40, { repeat: true });
  page.key("f", 60);
  const { action, timing } = await second;
  assert.equal(action, 1);
  assert.equal(timing.early_keys, 0);
});

test("keys while the server is asked are early keys of the next decision", async () => {
  const { clock, page, ask } = setting();
  const first = ask();
  clock.tick();
  page.key("j", 20);
  await first;
  page.key("j", 25);
  page.key("f", 26);
  const second = ask();
  page.key("j", 27);
  clock.tick();
  page.key("j", 90);
  assert.equal((await second).timing.early_keys, 3);
});

test("a hidden page starts a new onset when it comes back, and the decision is flagged", async () => {
  const { clock, page, writes, ask } = setting();
  const decision = ask();
  clock.tick(16);
  page.attention.hold("hidden");
  page.key("j", 20);
  clock.pass(10_000);
  page.attention.release("hidden");
  clock.tick(16);
  assert.equal(writes.length, 2);
  page.key("j", 10_232);
  const { timing } = await decision;
  assert.equal(timing.hidden, true);
  assert.equal(timing.rt_ms, 200);
});

test("a page that is hidden before the frame writes nothing until it is seen", async () => {
  const { clock, page, writes, ask } = setting();
  const decision = ask();
  page.attention.hold("hidden");
  clock.tick();
  assert.deepEqual(writes, []);
  page.attention.release("hidden");
  clock.tick();
  assert.equal(writes.length, 1);
  page.key("j", clock.now() + 5);
  assert.equal((await decision).timing.hidden, true);
});

test("two reasons to hold end with the last one", () => {
  const { clock, page, writes, ask } = setting();
  ask();
  page.attention.hold("hidden");
  page.attention.hold("covered");
  page.attention.release("hidden");
  clock.tick();
  assert.equal(writes.length, 0);
  page.attention.release("covered");
  clock.tick();
  assert.equal(writes.length, 1);
});

test("a key on screen does what the key does, and says that it was a click", async () => {
  const { clock, responder, ask } = setting();
  const clicked = ask();
  clock.tick();
  responder.press(1, { timeStamp: 100, isTrusted: true, detail: 1 });
  const { action, timing } = await clicked;
  assert.deepEqual([action, timing.input, timing.is_trusted], [1, "click", true]);
  const byEnter = ask();
  clock.tick();
  responder.press(1, { timeStamp: 200, isTrusted: true, detail: 0 });
  assert.equal((await byEnter).timing.input, "key");
});

test("frames dropped since the onset are in the timing, with the refresh rate", async () => {
  const { clock, page, ask } = setting();
  for (let i = 0; i < 30; i += 1) clock.tick(10);
  const decision = ask();
  clock.tick(10);
  clock.tick(30);
  page.key("j", clock.now());
  const { timing } = await decision;
  assert.equal(timing.refresh_hz, 100);
  assert.equal(timing.dropped_frames, 2);
});

test("a closed responder hears nothing", () => {
  const { clock, page, responder, writes, ask } = setting();
  ask();
  responder.close();
  clock.tick();
  page.key("j", 20);
  assert.deepEqual(writes, []);
  assert.deepEqual(page.prevented, []);
});
