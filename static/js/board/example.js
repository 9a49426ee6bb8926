// @ts-check
// The example beside the instructions: made-up rounds, drawn step by step by the boards of the game. Signs are blank.
// Each round says another sign, and none stands towards the place where the child is or away from it (they are at right
// angles, seen from the middle), so that no meaning is given away. Pure.

import { centre, choiceBoard, parentBoard, replayBoard } from "./grid.js";
import { junctionBoard } from "./junction.js";
import { arrowKeys, callout, digitKeys, onBoard, onCard, pedals, scene, signCard, triangleCard } from "./scene.js";

/** @import { Cell, ChildView, Drawing, DriverView, ParentView, Sign } from "../lib/types.js" */
/** @import { Frame } from "../lib/loop.js" */
/** @import { Way } from "./scene.js" */

/** @typedef {{ role: "parent" | "child" | "driver", limit: number, child_sees_parent: boolean }} Example */

const FIRST_MS = 2000;
const DOWN_MS = 240;
const REST_MS = 480;
const WALK_MS = 420;
const LAST_MS = 2400;
const LABEL = "An example of the screen, with places marked by letters";

/** @type {Sign[]} */
export const SIGNS = [
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
/** Half a window that the parent sees, in units of its board. */
const REACH = 1.5 * 54;

/**
 * What is shown one after the other, again and again; the first frame is the still picture.
 * @param {Example} example
 * @returns {Frame<Drawing>[]}
 */
export function exampleFrames(example) {
  if (example.role === "driver") return driverFrames(example);
  const frames = example.role === "parent" ? parentFrames : childFrames;
  return SEARCHES[example.role].flatMap((search) => frames(search, example));
}

/** Where the child is, what it says, and how the parent walks. @typedef {{ said: number, walk: Cell[] }} Search */

/** @type {Record<"parent" | "child", Search[]>} */
export const SEARCHES = {
  parent: [
    { said: 4, walk: walk([6, 2], "right", "up", "up", "right", "up", "up", "up") },
    { said: 6, walk: walk([4, 5], "left", "up", "left", "up", "left", "up", "left") },
  ],
  child: [
    { said: 9, walk: walk([5, 2], "right", "up", "right", "right", "up", "right", "up", "right") },
    { said: 5, walk: walk([6, 6], "up", "left", "up", "up", "left", "up", "left", "up") },
  ],
};

/**
 * The cells of a walk, its start included.
 * @param {Cell} start
 * @param {...Way} ways
 */
function walk(start, ...ways) {
  /** @type {Record<Way, Cell>} */
  const moves = { up: [-1, 0], right: [0, 1], down: [1, 0], left: [0, -1] };
  const cells = [start];
  for (const way of ways) {
    const [row, column] = /** @type {Cell} */ (cells.at(-1));
    cells.push([row + moves[way][0], column + moves[way][1]]);
  }
  return cells;
}

/**
 * The way from a cell to its neighbour.
 * @param {Cell} from
 * @param {Cell} to
 * @returns {Way}
 */
function wayTo([row, column], [row_to, column_to]) {
  if (row !== row_to) return row_to < row ? "up" : "down";
  return column_to < column ? "left" : "right";
}

/**
 * @param {Search} search
 * @param {Example} example
 * @returns {Frame<Drawing>[]}
 */
function parentFrames({ said, walk: cells }, { limit }) {
  const end = /** @type {Cell} */ (cells.at(-1));
  return cells.flatMap((cell, step) => {
    const near = Math.max(Math.abs(cell[0] - end[0]), Math.abs(cell[1] - end[1])) <= GRID.vision;
    const over = step === cells.length - 1;
    /** @type {ParentView} */
    const view = {
      ...GRID,
      role: "parent",
      limit,
      step,
      cell,
      trail: cells.slice(0, step + 1),
      child: near ? end : null,
      sign: said,
      over: over ? { outcome: "found", last: false, child: end } : null,
    };
    const next = cells[step + 1];
    return turn(step, next ? wayTo(cell, next) : null, (down) => parentScene(view, said, down));
  });
}

/**
 * A view as long as it stays, and then, if it is followed by a step, with the key down that makes it.
 * @template {string} Key
 * @param {number} step
 * @param {Key | null} key
 * @param {(down: Key | null) => Drawing} draw
 * @returns {Frame<Drawing>[]}
 */
function turn(step, key, draw) {
  const rest = { picture: draw(null), ms: key === null ? LAST_MS : step === 0 ? FIRST_MS : REST_MS };
  return key === null ? [rest] : [rest, { picture: draw(key), ms: DOWN_MS }];
}

/**
 * @param {ParentView} view
 * @param {number} said
 * @param {Way | null} down
 */
function parentScene(view, said, down) {
  const here = centre(view.size, view.cell);
  const at = onBoard(here);
  const corner = onBoard({ x: here.x + REACH, y: here.y - REACH });
  return scene(LABEL, parentBoard(view), [
    signCard("The child says", SIGNS, said),
    arrowKeys(down),
    callout("A", { x: at.x - 10, y: at.y + 8 }, { x: at.x - 74, y: at.y + 44 }),
    callout("B", corner, { x: corner.x + 26, y: corner.y - 26 }),
    saidBy("C", said),
    callout("D", { x: 364, y: 283 }, { x: 338, y: 283 }),
  ]);
}

/**
 * A letter beside the sign that is said, on the side where it is farthest from the other signs.
 * @param {string} letter
 * @param {number} number
 */
function saidBy(letter, number) {
  const { x, y } = onCard(/** @type {Sign} */ (SIGNS[number - 1]));
  const others = SIGNS.filter((sign) => sign.number !== number).map(onCard);
  const sides = [1, -1].flatMap((right) =>
    [-1, 1].map((down) => ({ right, down, x: x + 32 * right, y: y + 34 * down })),
  );
  const free = sides.map((side) => Math.min(...others.map((other) => Math.hypot(other.x - side.x, other.y - side.y))));
  const side = /** @type {typeof sides[number]} */ (sides[free.indexOf(Math.max(...free))]);
  return callout(letter, { x: x + 11 * side.right, y: y + 11 * side.down }, side);
}

/**
 * @param {Search} search
 * @param {Example} example
 * @returns {Frame<Drawing>[]}
 */
function childFrames({ said, walk: cells }, { limit, child_sees_parent }) {
  const [start, cell] = /** @type {[Cell, Cell]} */ ([cells[0], cells.at(-1)]);
  /** @type {ChildView} */
  const choosing = {
    ...GRID,
    role: "child",
    limit,
    step: 0,
    cell,
    parent: child_sees_parent ? start : null,
    sign: null,
    over: null,
  };
  const chosen = { ...choosing, sign: said, walk: cells };
  return [
    { picture: childScene(choosing, choiceBoard(choosing), null), ms: FIRST_MS },
    { picture: childScene(choosing, choiceBoard(choosing), said), ms: DOWN_MS },
    { picture: childScene({ ...choosing, sign: said }, choiceBoard(choosing), null), ms: 2 * REST_MS },
    ...cells.map((_, step) => ({
      picture: childScene(chosen, replayBoard(chosen, step), null),
      ms: step === cells.length - 1 ? LAST_MS : WALK_MS,
    })),
  ];
}

/**
 * @param {ChildView} view
 * @param {Drawing} board
 * @param {number | null} down the key that is down
 */
function childScene(view, board, down) {
  const here = onBoard(centre(view.size, view.cell));
  const parent = view.parent && !view.walk && centre(view.size, view.parent);
  const corner = parent && onBoard({ x: parent.x + REACH, y: parent.y - REACH });
  return scene(LABEL, board, [
    signCard(view.sign === null ? "Choose what to say" : "You said", SIGNS, view.sign),
    digitKeys(SIGNS.length, down),
    callout("A", { x: here.x + 11, y: here.y - 10 }, { x: here.x + 40, y: here.y - 38 }),
    corner && callout("B", corner, { x: corner.x + 26, y: corner.y - 26 }),
    callout("C", { x: 433, y: 274 }, { x: 433, y: 302 }),
  ]);
}

/** Up from the south, then left: cell by cell. */
export const ROUTE = [...walk([13, 7], ...Array(7).fill("up"), ...Array(7).fill("left"))];
const ROADS = { rows: [6, 7], columns: [6, 7] };
/** The example begins when the car is on its way. */
const FROM = 2;
/** It lets a car pass that comes from the left. @type {("go" | "brake")[]} */
export const PEDALS = [...Array(3).fill("go"), ...Array(2).fill("brake"), ...Array(10).fill("go")];

/**
 * @param {Example} example
 * @returns {Frame<Drawing>[]}
 */
function driverFrames({ limit }) {
  let position = FROM;
  return [...PEDALS, null].flatMap((pedal, step) => {
    const drawn = turn(step, pedal, (down) => driverScene(driverView(step, position, limit), down));
    if (pedal === "go") position += 1;
    return drawn;
  });
}

/**
 * @param {number} step
 * @param {number} position
 * @param {number} limit
 * @returns {DriverView}
 */
function driverView(step, position, limit) {
  const arrived = position === ROUTE.length;
  const cell = /** @type {Cell} */ (ROUTE[Math.min(position, ROUTE.length - 1)]);
  return {
    ...SHARED,
    task: "traffic_junction",
    role: "driver",
    limit,
    step,
    size: 14,
    cell,
    heading: position < 7 ? "up" : "left",
    route: ROUTE,
    position,
    triangles: warnings(step).filter(([row, column]) => row !== cell[0] || column !== cell[1]),
    over: arrived ? { outcome: "arrived", last: false } : null,
  };
}

/**
 * Two made-up cars that cross, a cell a step: one from the left, where the warning is not sure of its cell, one from above.
 * @param {number} step
 * @returns {[row: number, column: number, likelihood: number][]}
 */
export function warnings(step) {
  /** @type {[number, number, number][]} */
  const all = [
    [7, step + 2, 0.8],
    [7, step + 1, 0.3],
    [step, 6, 0.45],
  ];
  return all.filter(([row, column]) => row < 14 && column < 14);
}

/**
 * @param {DriverView} view
 * @param {"go" | "brake" | null} down
 */
function driverScene(view, down) {
  const u = 490 / view.size;
  const at = (/** @type {number} */ row, /** @type {number} */ column) =>
    onBoard({ x: (column + 0.5) * u, y: (row + 0.5) * u });
  const here = at(...view.cell);
  const end = at(6, 2);
  const sure = view.triangles.find(([, , likelihood]) => likelihood > 0.5);
  const warned = sure && at(sure[0], sure[1]);
  return scene(LABEL, junctionBoard(view, ROADS), [
    triangleCard(),
    pedals(down),
    callout("A", { x: here.x + 9, y: here.y + 4 }, { x: here.x + 48, y: here.y + 34 }),
    callout("B", { x: end.x, y: end.y - 4 }, { x: end.x - 12, y: end.y - 40 }),
    warned ? callout("C", { x: warned.x - 3, y: warned.y + 10 }, { x: warned.x - 24, y: warned.y + 52 }) : null,
    callout("D", { x: 330, y: 233 }, { x: 313, y: 233 }),
  ]);
}
