// @ts-check
// The animated example beside the instructions: fixed views of made-up rounds, drawn by the boards of the game. Signs
// are blank, and the one that is said stands in the middle, so that no meaning is given away. Pure.

import { h, round } from "./drawing.js";
import { centre, choiceBoard, parentBoard, replayBoard } from "./grid.js";
import { junctionBoard } from "./junction.js";
import { CAUTION, icon } from "./symbols.js";
import { badge, plane } from "./tokens.js";

/** @import { Cell, ChildView, Drawing, DriverView, ParentView, Sign } from "../lib/types.js" */

/** @typedef {{ role: "parent" | "child" | "driver", limit: number, child_sees_parent: boolean }} Example */
/** @typedef {{ picture: Drawing, ms: number }} Frame */
/** @typedef {{ x: number, y: number }} Point */

const PLACE = { x: 26, y: 30, side: 270 };
const CARD = { x: 330, width: 206 };
const SAID = 7;
const FIRST_MS = 1800;
const KEY_MS = 420;
const WALK_MS = 420;
const LAST_MS = 2800;

/** @type {Sign[]} */
const SIGNS = [
  [0.17, 0.3],
  [0.38, 0.17],
  [0.66, 0.22],
  [0.86, 0.48],
  [0.25, 0.56],
  [0.13, 0.82],
  [0.52, 0.52],
  [0.42, 0.84],
  [0.72, 0.78],
].map(([x = 0, y = 0], index) => ({ number: index + 1, x, y }));

const SHARED = { round: 1, seq: 0, phase: /** @type {const} */ ("practice"), number: 1, of: 1, block: 1, actions: [] };
const GRID = { ...SHARED, task: /** @type {const} */ ("parent_child"), size: 9, vision: 1, signs: SIGNS, blank: true };

/**
 * What is shown one after the other, again and again; the first frame is the still picture.
 * @param {Example} example
 * @returns {Frame[]}
 */
export function exampleFrames(example) {
  const frames = { parent: parentFrames, child: childFrames, driver: driverFrames }[example.role](example);
  const [first, ...more] = frames;
  const last = more.pop();
  return [first && { ...first, ms: FIRST_MS }, ...more, last && { ...last, ms: LAST_MS }].filter((each) => !!each);
}

/** @typedef {"up" | "right" | "down" | "left"} Way */

const CHILD = /** @type {Cell} */ ([3, 4]);
/** @type {[way: Way, cell: Cell][]} */
const WALK = [
  ["up", [6, 7]],
  ["up", [5, 7]],
  ["left", [5, 6]],
  ["left", [5, 5]],
  ["up", [4, 5]],
  ["left", [4, 4]],
  ["up", [3, 4]],
];

/** @param {Example} example */
function parentFrames({ limit }) {
  /** @type {Cell[]} */ const cells = [[7, 7], ...WALK.map(([, cell]) => cell)];
  return cells.flatMap((cell, step) => {
    const near = Math.max(Math.abs(cell[0] - CHILD[0]), Math.abs(cell[1] - CHILD[1])) <= GRID.vision;
    const found = cell[0] === CHILD[0] && cell[1] === CHILD[1];
    /** @type {ParentView} */
    const view = {
      ...GRID,
      role: "parent",
      limit,
      step,
      cell,
      trail: cells.slice(0, step + 1),
      child: near ? CHILD : null,
      sign: SAID,
      over: found ? { outcome: "found", last: false, child: CHILD } : null,
    };
    return pressed(WALK[step - 1]?.[0], (down) => parentScene(view, down));
  });
}

/**
 * A step: the key is down, then up again. Without a key: one frame.
 * @template {string} Key
 * @param {Key | undefined} key
 * @param {(down: Key | null) => Drawing} draw
 * @returns {Frame[]}
 */
function pressed(key, draw) {
  const rest = { picture: draw(null), ms: KEY_MS };
  return key === undefined ? [rest] : [{ picture: draw(key), ms: KEY_MS }, rest];
}

/**
 * @param {ParentView} view
 * @param {Way | null} down
 */
function parentScene(view, down) {
  const here = onBoard(centre(view.size, view.cell));
  const reach = 1.5 * 30;
  return scene("An example of the screen, with four places marked A to D", [
    nested(parentBoard(view), PLACE),
    talk("The child says", SAID),
    ...arrowKeys(down),
    leader("A", { x: here.x - 10, y: here.y + 8 }, { x: here.x - 74, y: here.y + 44 }),
    leader("B", { x: here.x + reach, y: here.y - reach }, { x: here.x + reach + 26, y: here.y - reach - 26 }),
    leader("C", { x: CARD.x + 119, y: 136 }, { x: CARD.x + 178, y: 92 }),
    leader("D", { x: 364, y: 283 }, { x: 338, y: 283 }),
  ]);
}

const STAYS = /** @type {Cell} */ ([2, 6]);
/** @type {Cell[]} */
const SEARCH = [[6, 2], [5, 2], [5, 3], [4, 3], [4, 4], [4, 5], [3, 5], [2, 5], STAYS];

/** @param {Example} example */
function childFrames({ limit, child_sees_parent }) {
  const parent = child_sees_parent ? /** @type {Cell} */ ([6, 2]) : null;
  /** @type {ChildView} */
  const view = { ...GRID, role: "child", limit, step: 0, cell: STAYS, parent, sign: null, over: null };
  const walked = { ...view, sign: SAID, walk: SEARCH };
  const replay = SEARCH.map((_, step) => ({
    picture: childScene(walked, replayBoard(walked, step), false, false),
    ms: WALK_MS,
  }));
  return [
    { picture: childScene(view, choiceBoard(view), false, true), ms: FIRST_MS },
    { picture: childScene(walked, choiceBoard(view), true, true), ms: 2 * KEY_MS },
    ...replay,
  ];
}

/**
 * @param {ChildView} view
 * @param {Drawing} board
 * @param {boolean} down the key of the sign is being pressed
 * @param {boolean} choosing
 */
function childScene(view, board, down, choosing) {
  const here = onBoard(centre(view.size, view.cell));
  const parent = view.parent && onBoard(centre(view.size, view.parent));
  return scene("An example of the screen, with places marked by letters", [
    nested(board, PLACE),
    talk(view.sign === null ? "Choose what to say" : "You said", view.sign),
    ...digitKeys(down ? SAID : null),
    leader("A", { x: here.x + 12, y: here.y - 8 }, { x: here.x + 52, y: here.y - 32 }),
    choosing && parent && leader("B", { x: parent.x + 45, y: parent.y - 45 }, { x: parent.x + 72, y: parent.y - 68 }),
    leader("C", { x: CARD.x + 103, y: 274 }, { x: CARD.x + 103, y: 302 }),
  ]);
}

/** @type {Cell[]} */
const ROUTE = [
  ...Array.from({ length: 8 }, (_, i) => /** @type {Cell} */ ([13 - i, 7])),
  ...Array.from({ length: 7 }, (_, i) => /** @type {Cell} */ ([6, 6 - i])),
];
const ROADS = { rows: [6, 7], columns: [6, 7] };
const FROM = 2;
/** @type {("go" | "brake")[]} */
const PEDALS = ["go", "go", "go", "brake", "brake", ...Array(10).fill("go")];

/** @param {Example} example */
function driverFrames({ limit }) {
  let position = FROM;
  return [undefined, ...PEDALS].flatMap((pedal, step) => {
    if (pedal === "go") position += 1;
    const arrived = position === ROUTE.length;
    const cell = ROUTE[Math.min(position, ROUTE.length - 1)] ?? [0, 0];
    /** @type {DriverView} */
    const view = {
      ...SHARED,
      task: "traffic_junction",
      role: "driver",
      limit,
      step,
      size: 14,
      cell,
      heading: position < 8 ? "up" : "left",
      route: ROUTE,
      position,
      triangles: arrived ? [] : warnings(step, cell),
      over: arrived ? { outcome: "arrived", last: false } : null,
    };
    return pressed(pedal, (down) => driverScene(view, down));
  });
}

/**
 * Two made-up cars that cross: one comes from the left, one from above. None stands where the car is.
 * @param {number} step
 * @param {Cell} own
 * @returns {[row: number, column: number, likelihood: number][]}
 */
function warnings(step, own) {
  /** @type {[number, number, number][]} */
  const all = [
    [7, step + 2, 0.8],
    [7, step + 1, 0.3],
    [step, 6, 0.45],
  ];
  return all.filter(([row, column]) => row < 14 && column < 14 && !(row === own[0] && column === own[1]));
}

/**
 * @param {DriverView} view
 * @param {"go" | "brake" | null} down
 */
function driverScene(view, down) {
  const u = PLACE.side / view.size;
  const at = (/** @type {Cell} */ [row, column]) => ({ x: PLACE.x + (column + 0.5) * u, y: PLACE.y + (row + 0.5) * u });
  const [here, end] = [at(view.cell), at([6, 2])];
  const [row = 0, column = 0] = view.triangles[0] ?? [];
  const warned = at([row, column]);
  return scene("An example of the screen, with four places marked A to D", [
    nested(junctionBoard(view, ROADS), PLACE),
    ...triangleLegend(),
    ...pedals(down),
    leader("A", { x: here.x + 9, y: here.y + 4 }, { x: here.x + 46, y: here.y + 30 }),
    leader("B", { x: end.x, y: end.y - 4 }, { x: end.x - 12, y: end.y - 40 }),
    view.triangles.length > 0 &&
      leader("C", { x: warned.x - 4, y: warned.y + 10 }, { x: warned.x - 22, y: warned.y + 50 }),
    leader("D", { x: 330, y: 233 }, { x: 313, y: 233 }),
  ]);
}

/**
 * @param {string} label
 * @param {(Drawing | null | false)[]} parts
 */
function scene(label, parts) {
  return h("svg", { viewBox: "0 0 560 330", role: "img", "aria-label": label }, parts);
}

/**
 * A drawing as part of the scene.
 * @param {Drawing} drawing
 * @param {{ x: number, y: number, side?: number, width?: number, height?: number }} place
 */
function nested(drawing, { x, y, side = 0, width = side, height = side }) {
  return h("svg", { x, y, width, height, viewBox: String(drawing.attributes.viewBox) }, ...drawing.children);
}

/** From the board's own units to the scene's. @param {Point} point */
function onBoard({ x, y }) {
  const scale = PLACE.side / 490;
  return { x: PLACE.x + x * scale, y: PLACE.y + y * scale };
}

/**
 * A letter, tied to what the list beside the picture says about it; always inside the picture.
 * @param {string} letter
 * @param {Point} to
 * @param {Point} from
 */
function leader(letter, to, from) {
  const x = Math.min(546, Math.max(14, from.x));
  const y = Math.min(316, Math.max(14, from.y));
  return h(
    "g",
    {},
    h("path", { class: "leader", d: `M${round(x)} ${round(y)}L${round(to.x)} ${round(to.y)}` }),
    h("circle", { class: "leader-mark", cx: x, cy: y, r: 13 }),
    h("text", { class: "leader-text", x, y: y + 1 }, letter),
  );
}

/**
 * The panel of signs, all blank.
 * @param {string} title
 * @param {number | null} said
 */
function talk(title, said) {
  const { x, width } = CARD;
  const drawn = plane({ signs: SIGNS, said, blank: true, label: "" });
  return h(
    "g",
    {},
    h("rect", { class: "mini-card", x, y: 30, width, height: 186, rx: 6 }),
    h("path", { class: "fog-line", d: `M${x} 68H${x + width}` }),
    h("text", { class: "mini-text", x: x + 14, y: 54 }, title),
    said !== null && nested(badge(said, true), { x: x + width - 36, y: 36, side: 26 }),
    nested(drawn, { x: x + 4, y: 70, width: width - 8, height: 144 }),
  );
}

/**
 * @param {{ x: number, y: number, width: number, height: number, down: boolean }} key
 * @param {...Drawing} face
 */
function miniKey({ x, y, width, height, down }, ...face) {
  const cap = h("rect", { class: "mini-key", x, y, width, height, rx: 5 });
  return h("g", { class: down ? "mini is-down" : "mini" }, cap, ...face);
}

/** @param {Way | null} down */
function arrowKeys(down) {
  const places = { up: [412, 228], left: [364, 267], down: [412, 267], right: [460, 267] };
  return Object.entries(places).map(([name, [x = 0, y = 0]]) =>
    miniKey(
      { x, y, width: 42, height: 32, down: name === down },
      nested(icon(name), { x: x + 11, y: y + 6, side: 20 }),
    ),
  );
}

/** @param {number | null} down */
function digitKeys(down) {
  return SIGNS.map(({ number }) => {
    const x = CARD.x + 23 * (number - 1);
    const digit = h("text", { class: "mini-text", "text-anchor": "middle", x: x + 10, y: 262 }, String(number));
    return miniKey({ x, y: 240, width: 20, height: 34, down: number === down }, digit);
  });
}

/** @param {"go" | "brake" | null} down */
function pedals(down) {
  const faces = /** @type {const} */ ([
    ["brake", "BRAKE", "F", 330],
    ["go", "GO", "J", 440],
  ]);
  return faces.map(([name, word, letter, x]) =>
    miniKey(
      { x, y: 166, width: 96, height: 134, down: name === down },
      nested(icon(name), { x: x + 36, y: 182, side: 24 }),
      h("text", { class: "mini-text", "text-anchor": "middle", x: x + 48, y: 236 }, word),
      h("rect", { class: "mini-cap", x: x + 35, y: 252, width: 26, height: 26, rx: 4 }),
      h("text", { class: "mini-letter", "text-anchor": "middle", x: x + 48, y: 270 }, letter),
    ),
  );
}

function triangleLegend() {
  const { x, width } = CARD;
  const samples = [
    { at: 36, side: 16, opacity: 0.35 },
    { at: 74, side: 24, opacity: 0.6 },
    { at: 118, side: 32, opacity: 0.85 },
    { at: 168, side: 40, opacity: 1 },
  ];
  return [
    h("rect", { class: "mini-card", x, y: 30, width, height: 116, rx: 6 }),
    ...samples.map(({ at, side, opacity }) =>
      h("path", {
        class: "caution",
        fill: "currentColor",
        "fill-rule": "evenodd",
        d: CAUTION,
        opacity,
        transform: `translate(${x + at} 82) scale(${round(side / 24)}) translate(-12 -12)`,
      }),
    ),
    h("text", { class: "mini-quiet", x: x + 16, y: 130 }, "less likely"),
    h("text", { class: "mini-quiet", x: x + width - 16, y: 130, "text-anchor": "end" }, "more likely"),
  ];
}
