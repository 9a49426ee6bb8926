// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { FrameMeter, Stopwatch } from "../../static/js/lib/clock.js";

test("reaction time is the event's stamp minus the onset, whatever the handler's delay", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.onset(1000.25);
  const timing = watch.respond(1350.75, 1420);
  assert.equal(timing?.rt_ms, 350.5);
  assert.equal(timing?.handler_lag_ms, 69.25);
  assert.deepEqual([timing?.onset_ms, timing?.response_ms], [1000.25, 1350.75]);
});

test("a key that went down before the onset is dropped and counted, even if it is handled after", () => {
  const watch = new Stopwatch();
  watch.begin();
  assert.equal(watch.respond(900, 900), null, "no picture yet");
  watch.onset(1000);
  assert.equal(watch.respond(999.9, 1010), null, "queued behind the frame");
  assert.equal(watch.respond(1200, 1201)?.early_keys, 2);
});

test("early keys are counted for one decision only", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.early();
  watch.onset(0);
  assert.equal(watch.respond(100, 100)?.early_keys, 1);
  watch.begin();
  watch.onset(200);
  assert.equal(watch.respond(300, 300)?.early_keys, 0);
});

test("the wait is from the previous response to this onset, and null at the first decision", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.onset(0);
  assert.equal(watch.respond(400, 400)?.wait_ms, null);
  watch.begin();
  watch.onset(475.5);
  assert.equal(watch.respond(800, 800)?.wait_ms, 75.5);
});

test("after a reload or a lost connection the decision is flagged and has no wait", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.onset(0);
  watch.respond(400, 400);
  watch.begin({ resumed: true });
  watch.onset(9000);
  const timing = watch.respond(9300, 9300);
  assert.equal(timing?.resumed, true);
  assert.equal(timing?.wait_ms, null);
});

test("an interruption throws the onset away, and the next one counts", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.onset(0);
  watch.interrupt({ hidden: true });
  assert.equal(watch.running, false);
  assert.equal(watch.respond(500, 500), null);
  watch.onset(5000);
  const timing = watch.respond(5200, 5200);
  assert.equal(timing?.rt_ms, 200);
  assert.equal(timing?.hidden, true);
});

test("the flag of an interruption ends with its decision", () => {
  const watch = new Stopwatch();
  watch.begin();
  watch.interrupt({ hidden: true, resumed: true });
  watch.onset(0);
  watch.respond(1, 1);
  watch.begin();
  watch.onset(10);
  const timing = watch.respond(20, 20);
  assert.deepEqual([timing?.hidden, timing?.resumed], [false, false]);
});

/** @param {FrameMeter} meter @param {number} interval @param {number} count @param {number} from */
function run(meter, interval, count, from = 0) {
  let time = from;
  for (let i = 0; i <= count; i += 1, time += interval) meter.frame(time);
  return time - interval;
}

test("the refresh rate is unknown before ten intervals, then the median's", () => {
  const meter = new FrameMeter();
  const end = run(meter, 1000 / 60, 9);
  assert.equal(meter.refresh_hz, null);
  meter.frame(end + 1000 / 60);
  assert.equal(meter.refresh_hz, 60);
});

test("one long frame does not change the refresh rate, and counts as the frames that it cost", () => {
  const meter = new FrameMeter();
  const end = run(meter, 10, 50);
  meter.mark();
  meter.frame(end + 40);
  assert.equal(meter.refresh_hz, 100);
  assert.equal(meter.dropped, 3);
  meter.mark();
  assert.equal(meter.dropped, 0);
});

test("a jitter below half a frame is no dropped frame", () => {
  const meter = new FrameMeter();
  const end = run(meter, 16, 50);
  meter.frame(end + 22);
  assert.equal(meter.dropped, 0);
});

test("the time while the page was hidden is not counted", () => {
  const meter = new FrameMeter();
  const end = run(meter, 16, 50);
  meter.pause();
  meter.frame(end + 60_000);
  meter.frame(end + 60_016);
  assert.equal(meter.dropped, 0);
});
