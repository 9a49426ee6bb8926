// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { nodes } from "../../static/js/board/drawing.js";
import { exampleFrames, PEDALS, ROUTE, SEARCHES, SIGNS, warnings } from "../../static/js/board/example.js";
import { onCard, signCard } from "../../static/js/board/scene.js";
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

test("no sign stands towards the child or away from it, and no sign is said twice", () => {
  const searches = [...SEARCHES.parent, ...SEARCHES.child];
  for (const { said, walk } of searches) {
    const sign = /** @type {import("../../static/js/lib/types.js").Sign} */ (SIGNS[said - 1]);
    const [row, column] = /** @type {[number, number]} */ (walk.at(-1));
    const [sx, sy, cx, cy] = [sign.x - 0.5, sign.y - 0.5, column - 4, row - 4];
    const cosine = (sx * cx + sy * cy) / (Math.hypot(sx, sy) * Math.hypot(cx, cy));
    assert.ok(Math.abs(cosine) < 0.1, `sign ${said} and ${row},${column}: ${cosine.toFixed(2)}`);
  }
  assert.equal(new Set(searches.map(({ said }) => said)).size, searches.length);
});

test("nobody in an example leaves the board, jumps, or walks for longer than eight steps", () => {
  for (const { walk } of [...SEARCHES.parent, ...SEARCHES.child]) {
    assert.ok(walk.flat().every((value) => value >= 0 && value < 9));
    assert.ok(walk.length - 1 <= 8);
    for (const [i, [row, column]] of walk.slice(1).entries()) {
      const [before_row = 0, before_column = 0] = walk[i] ?? [];
      assert.equal(Math.abs(row - before_row) + Math.abs(column - before_column), 1);
    }
  }
});

test("each example ends well, and every way through it is played with the keys of the role", () => {
  const ends = { parent: 2, child: 2, driver: 1 };
  for (const role of ROLES) {
    const all = frames(role);
    assert.equal(all.filter(({ picture }) => classed(picture, "arrive-ring").length === 1).length, ends[role]);
    assert.equal(classed(/** @type {Drawing} */ (all.at(-1)?.picture), "arrive-ring").length, 1, role);
    assert.ok(all.some(({ picture }) => classed(picture, "is-down").length === 1));
    assert.ok(all.every(({ ms }) => ms >= 200 && ms < 3000));
  }
});

test("the parent's key that is down is the one that makes the next step", () => {
  const [, down, after] = frames("parent");
  const [key] = classed(/** @type {Drawing} */ (down?.picture), "is-down");
  const [cap] = classed(/** @type {Drawing} */ (key), "mini-key");
  assert.equal(cap?.attributes.x, 460, "the right arrow");
  const xOf = (/** @type {Drawing | undefined} */ picture) =>
    Number(classed(/** @type {Drawing} */ (picture), "vision")[0]?.attributes.x);
  assert.equal(xOf(after?.picture) - xOf(down?.picture), 54, "one square to the right");
});

test("letters stand inside the picture, and the one of the message beside the sign that is said", () => {
  for (const role of ROLES) {
    for (const { picture } of frames(role)) {
      for (const { attributes } of classed(picture, "leader-mark")) {
        const [x, y] = [Number(attributes.cx), Number(attributes.cy)];
        assert.ok(x >= 13 && x <= 547 && y >= 13 && y <= 317, `${role}: ${x}, ${y}`);
      }
    }
  }
  for (const { picture } of frames("parent")) {
    const c = [...nodes(picture)].find(({ attributes }) => attributes["data-letter"] === "C");
    const [mark] = classed(/** @type {Drawing} */ (c), "leader-mark");
    for (const sign of SIGNS.map(onCard)) {
      const apart = Math.hypot(sign.x - Number(mark?.attributes.cx), sign.y - Number(mark?.attributes.cy));
      assert.ok(apart > 13 + 10, `the letter hides no sign: ${apart}`);
    }
  }
  for (const { picture } of frames("parent")) {
    const marks = classed(picture, "leader-mark").map(({ attributes }) => [
      Number(attributes.cx),
      Number(attributes.cy),
    ]);
    for (const { attributes: key } of classed(picture, "mini-key")) {
      const [left, top] = [Number(key.x), Number(key.y)];
      const away = (/** @type {number[]} */ [x = 0, y = 0]) =>
        Math.hypot(
          Math.max(left - x, 0, x - left - Number(key.width)),
          Math.max(top - y, 0, y - top - Number(key.height)),
        );
      assert.ok(
        marks.every((mark) => away(mark) > 13),
        "no letter hides a key",
      );
    }
  }
  const card = signCard("", SIGNS, 4);
  const said = classed(card, "said").at(-1);
  const [, x = 0, y = 0] =
    String(said?.attributes.transform)
      .match(/\((\S+) (\S+)\)/)
      ?.map(Number) ?? [];
  const at = onCard(/** @type {any} */ (SIGNS[3]));
  // The plane fills its place in width: 430 units on 198; 320 of its 330 units are shown, from the fifth on.
  const scale = Math.min(198 / 430, 144 / 320);
  assert.ok(Math.abs(at.x - (334 + (198 - 430 * scale) / 2 + x * scale)) < 0.1);
  assert.ok(Math.abs(at.y - (70 + (144 - 320 * scale) / 2 + (y - 5) * scale)) < 0.1);
});

test("the driver's car is never on the square of a made-up car", () => {
  let position = 2;
  for (const [i, pedal] of PEDALS.entries()) {
    if (pedal === "go") position += 1;
    const own = String(ROUTE[Math.min(position, ROUTE.length - 1)]);
    const cars = warnings(i + 1).filter(([, , likelihood]) => likelihood > 0.4);
    assert.ok(!cars.some(([row, column]) => String([row, column]) === own), `after ${i + 1} steps at ${own}`);
  }
  assert.equal(position, ROUTE.length);
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
