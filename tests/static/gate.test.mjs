// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Gate, lacking, PATIENCE_MS, told, WATCH_MS } from "../../static/js/lib/gate.js";

const NEEDS = { width_min: 1024, height_min: 640, refresh_min_hz: 20, keyboard: true, keys: [["brake"], ["go"]] };
const DESKTOP = { device: /** @type {const} */ ("desktop"), lacking: [] };

/** Frames at a steady rate. @param {Gate} gate @param {number} hz @param {number} ms @param {number} [from] */
function watch(gate, hz, ms, from = 0) {
  for (let time = from; time <= ms; time += 1000 / hz) gate.frame(time);
}

/** @param {Partial<typeof NEEDS>} [needs] */
function fitting(needs = {}) {
  const gate = new Gate({ ...NEEDS, ...needs }, DESKTOP);
  gate.resize({ width: 1280, height: 720 });
  watch(gate, 60, WATCH_MS + 50);
  gate.key("brake");
  gate.key("go");
  return gate;
}

test("a device that shows everything passes", () => {
  assert.equal(fitting().passed, true);
});

test("each group of keys must be pressed once, in any order, and other keys are not taken", () => {
  const gate = new Gate(NEEDS, DESKTOP);
  assert.equal(gate.key("up"), false);
  assert.equal(gate.key(null), false);
  assert.equal(gate.key("go"), true);
  assert.equal(gate.key("go"), false);
  assert.equal(told(gate, "keyboard"), "press F");
  assert.equal(gate.checks.keyboard, "open");
  assert.equal(gate.key("brake"), true);
  assert.equal(gate.checks.keyboard, "good");
});

test("one of the arrow keys is enough where any of them is asked for", () => {
  const gate = new Gate({ ...NEEDS, keys: [["up", "right", "down", "left"]] }, DESKTOP);
  assert.equal(told(gate, "keyboard"), "press any arrow key");
  gate.key("left");
  assert.equal(gate.checks.keyboard, "good");
});

test("a window that is too small can be made larger", () => {
  const gate = fitting();
  gate.resize({ width: 1023, height: 700 });
  assert.deepEqual([gate.passed, gate.reason], [false, "viewport"]);
  assert.match(told(gate, "viewport"), /1023 by 700.*1024 by 640/);
  gate.resize({ width: 1024, height: 640 });
  assert.equal(gate.passed, true);
});

test("a page that has just loaded may draw slowly for a while; a slow device does so for longer", () => {
  const gate = fitting();
  const slow = new Gate(NEEDS, DESKTOP);
  watch(slow, 12, WATCH_MS + 100);
  assert.equal(slow.checks.frames, "open");
  watch(slow, 12, PATIENCE_MS + 200, WATCH_MS + 150);
  assert.equal(slow.checks.frames, "bad");
  assert.equal(gate.checks.frames, "good");
});

test("frames are not judged before they were watched for a second, and not while the page is hidden", () => {
  const gate = new Gate(NEEDS, DESKTOP);
  watch(gate, 60, WATCH_MS / 2);
  assert.equal(gate.checks.frames, "open");
  gate.pause();
  gate.frame(60_000);
  assert.equal(gate.checks.frames, "open", "the gap is no time of watching");
});

test("a study that asks for no frame rate and no keyboard does not wait for them", () => {
  const gate = new Gate({ ...NEEDS, refresh_min_hz: 0, keyboard: false }, { device: "tablet", lacking: [] });
  gate.resize({ width: 1100, height: 800 });
  assert.equal(gate.passed, true);
});

test("a phone or a tablet does not fit a game that is played with a keyboard, whatever else it can do", () => {
  for (const device of /** @type {const} */ (["phone", "tablet"])) {
    const gate = new Gate(NEEDS, { device, lacking: [] });
    gate.resize({ width: 2000, height: 2000 });
    assert.deepEqual([gate.passed, gate.reason], [false, "phone"]);
  }
});

test("the reason is what hinders most; a key that was not pressed is the last one", () => {
  const gate = new Gate(NEEDS, { device: "desktop", lacking: ["import maps"] });
  assert.equal(gate.reason, "browser");
  const waiting = fitting();
  assert.equal(waiting.reason, "keyboard", "asked for although all is well: something that cannot be measured");
  const open = new Gate(NEEDS, DESKTOP);
  open.resize({ width: 1280, height: 720 });
  watch(open, 60, WATCH_MS + 50);
  assert.equal(open.reason, "keyboard");
});

test("what a browser lacks is named", () => {
  const supports = () => true;
  const whole = {
    HTMLScriptElement: { supports },
    requestAnimationFrame: () => 0,
    performance: { now: () => 0 },
    fetch: () => 0,
    AbortSignal: { timeout: () => 0 },
    crypto: { getRandomValues: () => 0 },
  };
  assert.deepEqual(lacking(whole), []);
  assert.deepEqual(lacking({ ...whole, AbortSignal: {} }), ["requests"]);
  assert.equal(lacking({}).length, 5);
});
