// @ts-check
// Two toy worlds that answer like hatlab's server, for the example page and for tests: views in, views out.

/** @import { Cell, ChildView, DriverView, ParentView, Sign } from "../../../static/js/lib/types.js" */

/** @type {Sign[]} */
export const SIGNS = [
  [0.79, 0.37],
  [0.36, 0.17],
  [0.67, 0.67],
  [0.2, 0.56],
  [0.89, 0.64],
  [0.14, 0.33],
  [0.54, 0.49],
  [0.37, 0.83],
  [0.69, 0.16],
].map(([x = 0, y = 0], i) => ({ number: i + 1, x, y }));

const SHARED = { seq: 0, phase: /** @type {const} */ ("main"), of: 20, block: 1, step: 0, over: null };

/**
 * @param {Partial<ParentView>} [change]
 * @returns {ParentView}
 */
export function parentView(change = {}) {
  return {
    ...SHARED,
    task: "parent_child",
    role: "parent",
    round: 7,
    number: 7,
    limit: 20,
    actions: [0, 1, 2, 3],
    size: 9,
    vision: 1,
    cell: [7, 7],
    trail: [[7, 7]],
    child: null,
    sign: 4,
    signs: SIGNS,
    blank: false,
    ...change,
  };
}

/**
 * @param {Partial<ChildView>} [change]
 * @returns {ChildView}
 */
export function childView(change = {}) {
  return {
    ...SHARED,
    task: "parent_child",
    role: "child",
    round: 12,
    number: 12,
    limit: 20,
    actions: SIGNS.map(({ number }) => number),
    size: 9,
    vision: 1,
    cell: [1, 7],
    parent: [6, 2],
    sign: null,
    signs: SIGNS,
    blank: false,
    ...change,
  };
}

/** @type {Cell[]} */
export const LEFT_TURN = [
  [13, 7],
  [12, 7],
  [11, 7],
  [10, 7],
  [9, 7],
  [8, 7],
  [7, 7],
  [6, 7],
  [6, 6],
  [6, 5],
  [6, 4],
  [6, 3],
  [6, 2],
  [6, 1],
  [6, 0],
];

/**
 * @param {Partial<DriverView>} [change]
 * @returns {DriverView}
 */
export function driverView(change = {}) {
  return {
    ...SHARED,
    task: "traffic_junction",
    role: "driver",
    round: 4,
    number: 4,
    limit: 40,
    actions: [0, 1],
    size: 14,
    cell: [13, 7],
    heading: "up",
    route: LEFT_TURN,
    position: 0,
    triangles: [
      [7, 2, 0.16],
      [7, 3, 0.42],
      [7, 4, 0.83],
      [7, 5, 0.36],
      [2, 6, 0.22],
      [3, 6, 0.58],
    ],
    roads: { rows: [6, 7], columns: [6, 7] },
    ...change,
  };
}

const MOVES = [
  [-1, 0],
  [0, 1],
  [1, 0],
  [0, -1],
];

/**
 * @param {ParentView} view
 * @param {number} action
 * @param {Cell} child
 * @returns {ParentView}
 */
export function walk(view, action, child) {
  const [down = 0, right = 0] = MOVES[action] ?? [];
  const clip = (/** @type {number} */ at) => Math.min(view.size - 1, Math.max(0, at));
  /** @type {Cell} */ const cell = [clip(view.cell[0] + down), clip(view.cell[1] + right)];
  const step = view.step + 1;
  const found = cell[0] === child[0] && cell[1] === child[1];
  const near = Math.max(Math.abs(cell[0] - child[0]), Math.abs(cell[1] - child[1])) <= view.vision;
  const over =
    found || step === view.limit
      ? { outcome: /** @type {"found" | "not_found"} */ (found ? "found" : "not_found"), last: false, child }
      : null;
  return { ...view, seq: view.seq + 1, step, cell, trail: [...view.trail, cell], child: near ? child : null, over };
}

/**
 * The parent walks straight to the child, rows first.
 * @param {ChildView} view
 * @param {number} number
 * @returns {ChildView}
 */
export function say(view, number) {
  let [row, column] = view.parent ?? [6, 2];
  /** @type {Cell[]} */ const path = [[row, column]];
  while (row !== view.cell[0] || column !== view.cell[1]) {
    if (row !== view.cell[0]) row += Math.sign(view.cell[0] - row);
    else column += Math.sign(view.cell[1] - column);
    path.push([row, column]);
  }
  return { ...view, seq: 1, sign: number, walk: path, step: path.length - 1, over: { outcome: "found", last: false } };
}

/**
 * @param {DriverView} view
 * @param {number} action
 * @returns {DriverView}
 */
export function drive(view, action) {
  const step = view.step + 1;
  const gone = view.position + (action === 0 ? 1 : 0);
  const arrived = gone === view.route.length;
  const cell = view.route[Math.min(gone, view.route.length - 1)] ?? view.cell;
  const outcome = arrived ? "arrived" : step === view.limit ? "limit" : null;
  const heading = gone >= 8 ? "left" : "up";
  return {
    ...view,
    seq: view.seq + 1,
    step,
    position: gone,
    cell,
    heading,
    triangles: [[6, Math.max(0, 9 - step), 0.6]],
    over: outcome ? { outcome, last: false } : null,
  };
}
