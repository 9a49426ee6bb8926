// @ts-check
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { nodes } from "../../static/js/board/drawing.js";
import { choiceBoard, parentBoard, replayBoard } from "../../static/js/board/grid.js";
import { bands, junctionBoard, weight } from "../../static/js/board/junction.js";
import { meter, pips } from "../../static/js/board/meters.js";
import { CAUTION, FIGURES } from "../../static/js/board/symbols.js";
import { plane } from "../../static/js/board/tokens.js";
import { childView, driverView, LEFT_TURN, parentView, SIGNS } from "./example/worlds.js";

/** @import { Drawing, Roads } from "../../static/js/lib/types.js" */

/** @param {Drawing} drawing @param {string} name */
const withClass = (drawing, name) =>
  [...nodes(drawing)].filter((node) =>
    String(node.attributes.class ?? "")
      .split(" ")
      .includes(name),
  );

/** @param {Drawing} drawing @param {string} name @returns {Drawing} */
function only(drawing, name) {
  const [found, ...more] = withClass(drawing, name);
  assert.ok(found && more.length === 0, `exactly one .${name}`);
  return found;
}

/** @type {Roads} */ const ROADS = { rows: [6, 7], columns: [6, 7] };

test("the parent sees fog but for the square around them, clipped at the border", () => {
  const corner = parentBoard(parentView({ cell: [0, 8], trail: [[0, 8]] }));
  const seen = only(corner, "seen").attributes;
  assert.deepEqual([seen.x, seen.y, seen.width, seen.height], [380, 2, 108, 108]);
  const inside = only(parentBoard(parentView({ cell: [5, 4] })), "vision").attributes;
  assert.deepEqual([inside.x, inside.y, inside.width, inside.height], [164, 218, 162, 162]);
});

test("the child is drawn only if the view has it", () => {
  assert.equal(withClass(parentBoard(parentView()), "child").length, 0);
  assert.equal(withClass(parentBoard(parentView({ child: [6, 6] })), "child").length, 1);
});

test("a round that was not found ends by showing where the child was", () => {
  const over = {
    outcome: /** @type {const} */ ("not_found"),
    last: false,
    child: /** @type {[number, number]} */ ([0, 0]),
  };
  const drawing = parentBoard(parentView({ over }));
  const ring = only(drawing, "miss-ring").attributes;
  assert.deepEqual([ring.cx, ring.cy], [29, 29]);
  assert.equal(withClass(drawing, "child").length, 1);
});

test("a trail has a ring at its start and a dot at each cell between", () => {
  const drawing = parentBoard(
    parentView({
      cell: [5, 4],
      trail: [
        [7, 7],
        [7, 6],
        [7, 5],
        [6, 5],
      ],
    }),
  );
  assert.equal(only(drawing, "trail").attributes.d, "M407 407L353 407L299 407L299 353");
  assert.equal(withClass(drawing, "trail-dot").length, 2);
  assert.equal(only(drawing, "trail-start").attributes.cx, 407);
});

test("the label says no more than the picture", () => {
  assert.equal(
    parentBoard(parentView({ cell: [5, 4] })).attributes["aria-label"],
    "Board, 9 by 9. You are at row 6, column 5.",
  );
  assert.doesNotMatch(String(choiceBoard(childView({ parent: null })).attributes["aria-label"]), /parent/);
  assert.match(
    String(junctionBoard(driverView(), ROADS).attributes["aria-label"]),
    /driven 0 of 15 cells. 6 triangles/,
  );
});

test("the human child sees the parent faintly, and not at all when the study hides it", () => {
  assert.equal(withClass(choiceBoard(childView()), "faint").length, 1);
  assert.equal(withClass(choiceBoard(childView({ parent: null })), "parent").length, 0);
});

test("the replay shows the walk up to its step, and a ring when they meet", () => {
  const view = childView({
    cell: [1, 7],
    walk: [
      [1, 4],
      [1, 5],
      [1, 6],
      [1, 7],
    ],
  });
  assert.equal(only(replayBoard(view, 2), "trail").attributes.d, "M245 83L299 83L353 83");
  assert.equal(withClass(replayBoard(view, 2), "arrive-ring").length, 0);
  assert.equal(withClass(replayBoard(view, 3), "arrive-ring").length, 1);
});

test("the path ahead is dashed and red, the driven part faint", () => {
  const drawing = junctionBoard(driverView({ position: 4, cell: [9, 7] }), ROADS);
  assert.equal(only(drawing, "path-done").attributes.d, "M262.5 472.5L262.5 437.5L262.5 402.5L262.5 367.5L262.5 332.5");
  assert.match(String(only(drawing, "path").attributes.d), /^M262.5 332.5L262.5 297.5.*L17.5 227.5$/);
  assert.match(String(only(drawing, "path-end").attributes.transform), /rotate\(-90\)/);
});

test("the car is turned to its heading", () => {
  const car = (/** @type {"up" | "left"} */ heading) => {
    const drawing = junctionBoard(driverView({ heading, cell: [6, 3] }), ROADS);
    return [...nodes(drawing)].find((node) =>
      node.children.some((child) => typeof child !== "string" && child.attributes.class === "car-body"),
    );
  };
  assert.doesNotMatch(String(car("up")?.attributes.transform), /rotate/);
  assert.match(String(car("left")?.attributes.transform), /translate\(122.5 227.5\) rotate\(-90\)/);
});

test("triangles follow the formula of the notes", () => {
  assert.deepEqual([weight(1).side.toFixed(3), weight(1).opacity], ["0.960", 1]);
  assert.equal(weight(0.25).side.toFixed(3), "0.680");
  assert.equal(weight(0.05).opacity.toFixed(3), "0.259");
  const drawing = junctionBoard(driverView({ triangles: [[7, 4, 0.25]] }), ROADS);
  const triangle = only(drawing, "caution").attributes;
  assert.equal(triangle.opacity, 0.42); // .22 + .78 × .25 = .415, to 1/100
  assert.equal(triangle.transform, "translate(157.5 262.5) scale(0.9917) translate(-12 -12)"); // 35 × .68 / 24
});

test("a collision marks the car's cell and draws no other car", () => {
  const over = { outcome: /** @type {const} */ ("collision"), last: false };
  const drawing = junctionBoard(driverView({ position: 7, cell: [6, 7], over }), ROADS);
  const ring = only(drawing, "hit-ring").attributes;
  assert.deepEqual([ring.x, ring.y, ring.width], [245.5, 210.5, 34]);
  assert.equal([...nodes(drawing)].filter((node) => node.attributes.class === "car-body").length, 1);
});

test("an arrival has no path ahead any more, and its marks stay on the board", () => {
  const over = { outcome: /** @type {const} */ ("arrived"), last: false };
  const drawing = junctionBoard(driverView({ position: 15, cell: [6, 0], heading: "left", over }), ROADS);
  assert.equal(withClass(drawing, "path").length + withClass(drawing, "path-end").length, 0);
  assert.ok(Number(only(drawing, "arrive-ring").attributes.x) >= 2);
  assert.equal(String(only(drawing, "path-done").attributes.d).split("L").length, LEFT_TURN.length);
});

test("neighbouring lanes make one road", () => {
  assert.deepEqual(bands([6, 7]), [[6, 8]]);
  assert.deepEqual(bands([12, 2, 3, 11]), [
    [2, 4],
    [11, 13],
  ]);
  assert.deepEqual(bands([3]), [[3, 4]]);
});

test("a one-way road has no lane marks and no arrows", () => {
  const drawing = junctionBoard(
    driverView({
      size: 7,
      route: [
        [0, 3],
        [1, 3],
      ],
      cell: [0, 3],
      triangles: [],
    }),
    { rows: [3], columns: [3] },
  );
  assert.equal(only(drawing, "lane").attributes.d, "");
  assert.equal(withClass(drawing, "arrow-paint").length, 0);
});

test("the said sign is filled, ringed and drawn last; the others are hollow", () => {
  const drawing = plane({ signs: SIGNS, said: 4, blank: false, label: "" });
  const said = only(drawing, "said");
  assert.equal(drawing.children.at(-1), said);
  assert.equal(withClass(drawing, "ring").length, 1);
  assert.equal(withClass(drawing, "token").length, 9);
});

test("a sign stands where the lexicon drew it", () => {
  const [token] = withClass(
    plane({ signs: [{ number: 2, x: 0.5, y: 0.25 }], said: null, blank: false, label: "" }),
    "token",
  );
  assert.equal(token?.attributes.transform, "translate(215 82.5)");
});

test("blank signs show no number, no shape and no colour", () => {
  const drawing = plane({ signs: SIGNS, said: 4, blank: true, label: "" });
  assert.equal([...nodes(drawing)].filter((node) => node.tag === "text").length, 0);
  assert.equal(withClass(drawing, "token-4").length, 0);
  const looks = new Set(withClass(drawing, "shape").map((node) => JSON.stringify(node)));
  assert.equal(looks.size, 1, "all alike");
});

test("every token is its own mirror image in both axes: no shape points anywhere", () => {
  for (const sign of SIGNS) {
    const [shape] = withClass(plane({ signs: [sign], said: null, blank: false, label: "" }), "shape");
    if (shape?.tag !== "path" || sign.number === 6) continue; // 6 is made of four arcs
    const points = [...String(shape.attributes.d).matchAll(/(-?[\d.]+) (-?[\d.]+)/g)].map(([, x, y]) => [
      Number(x),
      Number(y),
    ]);
    const has = (/** @type {number} */ x, /** @type {number} */ y) =>
      points.some(([a = 0, b = 0]) => Math.hypot(a - x, b - y) < 0.15);
    for (const [x = 0, y = 0] of points) assert.ok(has(-x, y) && has(x, -y), `token ${sign.number} at ${x}, ${y}`);
  }
});

test("a meter has one tick a step, pips one a round", () => {
  assert.equal(withClass(meter(5, 20), "past").length, 5);
  assert.equal(meter(5, 20).children.length, 20);
  const rounds = pips(7, 20);
  assert.equal(withClass(rounds, "past").length, 6);
  assert.equal(only(rounds, "now").attributes.height, 10);
});

test("pages without scripts show the same figures", () => {
  const sprite = readFileSync(new URL("../../templates/partials/sprite.html", import.meta.url), "utf8");
  const paths = [...Object.values(FIGURES).flat()]
    .flatMap((drawing) => [...nodes(drawing)])
    .map((node) => node.attributes.d)
    .filter(Boolean);
  assert.equal(paths.length, 5);
  for (const d of [...paths, CAUTION]) assert.ok(sprite.includes(String(d)), `sprite.html lacks ${d}`);
});
