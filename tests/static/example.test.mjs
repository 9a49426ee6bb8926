// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { nodes } from "../../static/js/board/drawing.js";
import { exampleFrames } from "../../static/js/board/example.js";
import { Loop } from "../../static/js/lib/loop.js";

/** @import { Drawing } from "../../static/js/lib/types.js" */

const ROLES = /** @type {const} */ (["parent", "child", "driver"]);
const frames = (/** @type {"parent" | "child" | "driver"} */ role, child_sees_parent = true) =>
  exampleFrames({ role, limit: 20, child_sees_parent });

/** @param {Drawing} drawing */
const texts = (drawing) => [...nodes(drawing)].flatMap(({ children }) => children.filter((c) => typeof c === "string"));
/** @param {Drawing} drawing @param {string} name */
const classed = (drawing, name) =>
  [...nodes(drawing)].filter(({ attributes }) =>
    String(attributes.class ?? "")
      .split(" ")
      .includes(name),
  );

test("every letter of the list beside it stands on the first picture, which is the still one", () => {
  for (const role of ROLES) {
    const letters = texts(/** @type {any} */ (frames(role)[0]).picture).filter((text) => /^[A-D]$/.test(text));
    assert.deepEqual(letters, role === "child" ? ["A", "B", "C"] : ["A", "B", "C", "D"]);
  }
  const alone = texts(/** @type {any} */ (frames("child", false)[0]).picture);
  assert.ok(!alone.includes("B"), "a parent that is not shown is not explained");
});

test("signs are blank in every picture, so that no meaning is given away", () => {
  for (const role of /** @type {const} */ (["parent", "child"])) {
    for (const { picture } of frames(role)) {
      const signs = classed(picture, "token");
      assert.ok(signs.length >= 9 && signs.length === classed(picture, "blank").length);
    }
  }
});

test("each example ends well, and every way through it is played with the keys of the role", () => {
  for (const role of ROLES) {
    const all = frames(role);
    const last = /** @type {Drawing} */ (all.at(-1)?.picture);
    assert.ok(classed(last, "arrive-ring").length === 1, role);
    assert.ok(all.some(({ picture }) => classed(picture, "is-down").length === 1));
    assert.ok(all.every(({ ms }) => ms >= 400 && ms < 3000));
  }
});

test("the driver waits while a dark triangle is on the square ahead", () => {
  const braking = frames("driver").filter(({ picture }) => {
    const [down] = classed(picture, "is-down");
    return down && texts(down).includes("BRAKE");
  });
  assert.equal(braking.length, 2);
});

test("the loop goes round, stops at the picture that is there, and goes on from it", () => {
  /** @type {(() => void)[]} */ const timers = [];
  /** @type {string[]} */ const drawn = [];
  const set = (/** @type {() => void} */ callback) => timers.push(callback);
  const list = ["a", "b"].map((picture) => ({ picture, ms: 1 }));
  const loop = new Loop(list, (picture) => drawn.push(picture), { set, clear: () => timers.pop() });
  assert.deepEqual([drawn, loop.playing], [["a"], false]);
  loop.play();
  loop.play();
  assert.equal(timers.length, 1);
  for (let i = 0; i < 2; i += 1) timers.shift()?.();
  assert.deepEqual(drawn, ["a", "b", "a"]);
  loop.pause();
  assert.deepEqual([timers.length, loop.playing], [0, false]);
  loop.play();
  timers.shift()?.();
  assert.deepEqual(drawn, ["a", "b", "a", "b"]);
});
