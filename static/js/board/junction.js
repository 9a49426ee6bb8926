// @ts-check
// The board of Traffic Junction: 490 drawing units square. Pure.

import { h, round } from "./drawing.js";
import { CAUTION, figure } from "./symbols.js";

/** @import { Cell, DriverView, Drawing, Roads } from "../lib/types.js" */

const SIDE = 490;
const TURN = { up: 0, right: 90, down: 180, left: -90 };

/**
 * @param {DriverView} view
 * @param {Roads} roads
 */
export function junctionBoard(view, roads) {
  const u = SIDE / view.size;
  const finished = view.over !== null;
  const arrived = view.over?.outcome === "arrived";
  const driven = view.route.slice(0, view.position + 1);
  const ahead = arrived ? [] : view.route.slice(view.position);
  return h("svg", { viewBox: `0 0 ${SIDE} ${SIDE}`, role: "img", "aria-label": label(view) }, [
    ...ground(view.size, roads),
    driven.length > 1 && h("path", { class: "path-done", d: line(u, driven) }),
    ahead.length > 1 && h("path", { class: "path", d: line(u, ahead) }),
    !arrived && arrowHead(u, view.route),
    ...view.triangles.map((triangle) => caution(u, triangle)),
    figure("car", { ...centre(u, view.cell), size: u - 1, turn: TURN[view.heading] }),
    ...(finished ? ending(u, view) : []),
    h("rect", { class: "frame", x: 1, y: 1, width: SIDE - 2, height: SIDE - 2, rx: 2 }),
  ]);
}

/** How wide and how dark a triangle is: side = cell × (.40 + .56·√p), opacity = .22 + .78·p (NOTES of the mockups).
 * @param {number} likelihood
 */
export function weight(likelihood) {
  return { side: 0.4 + 0.56 * Math.sqrt(likelihood), opacity: 0.22 + 0.78 * likelihood };
}

/** @param {DriverView} view */
function label(view) {
  const { size, position, route, over } = view;
  if (over?.outcome === "collision") return "Collision in the junction.";
  if (over?.outcome === "arrived") return "Your car has arrived.";
  const warnings = view.triangles.length === 1 ? "One triangle" : `${view.triangles.length} triangles`;
  return `Junction, ${size} by ${size}. Your car has driven ${position} of ${route.length} cells. ${warnings}.`;
}

/**
 * @param {number} u side of a cell
 * @param {Cell} cell
 */
function centre(u, [row, column]) {
  return { x: round((column + 0.5) * u), y: round((row + 0.5) * u) };
}

/**
 * @param {number} u
 * @param {Cell[]} cells
 */
function line(u, cells) {
  return `M${cells.map((cell) => Object.values(centre(u, cell)).join(" ")).join("L")}`;
}

/**
 * The point of the route's end, turned as the car will leave.
 * @param {number} u
 * @param {Cell[]} route
 */
function arrowHead(u, route) {
  const [before, last] = route.slice(-2);
  if (!before || !last) return null;
  const { x, y } = centre(u, last);
  return h("path", {
    class: "path-end",
    d: "M0-13 11 5H-11Z",
    transform: `translate(${x} ${y}) rotate(${bearing(before, last)})`,
  });
}

/**
 * Degrees from up, of a move from one cell to its neighbour.
 * @param {Cell} from
 * @param {Cell} to
 */
function bearing(from, to) {
  if (to[0] < from[0]) return TURN.up;
  if (to[0] > from[0]) return TURN.down;
  return to[1] > from[1] ? TURN.right : TURN.left;
}

/**
 * @param {number} u
 * @param {[row: number, column: number, likelihood: number]} triangle
 */
function caution(u, [row, column, likelihood]) {
  const { x, y } = centre(u, [row, column]);
  const { side, opacity } = weight(likelihood);
  const scale = Math.round((u * side * 10000) / 24) / 10000;
  return h("path", {
    class: "caution",
    fill: "currentColor",
    "fill-rule": "evenodd",
    d: CAUTION,
    opacity,
    transform: `translate(${x} ${y}) scale(${scale}) translate(-12 -12)`,
  });
}

/**
 * How it ended, at the car: a ring in its cell and a badge at the ring's corner.
 * @param {number} u
 * @param {DriverView} view
 */
function ending(u, view) {
  const kind = { collision: "hit", arrived: "arrive" }[String(view.over?.outcome)];
  if (!kind) return [];
  const { x, y } = centre(u, view.cell);
  const side = u - 1;
  const badge = { x: Math.min(x + u / 2 + 1.5, SIDE - 16), y: Math.max(y - u / 2 - 3.5, 16) };
  const mark = kind === "hit" ? "m-4-4 8 8m0-8-8 8" : "m-5 0 3.5 3.5L5-3.500";
  const left = Math.min(Math.max(x - side / 2, 2), SIDE - side - 2);
  const top = Math.min(Math.max(y - side / 2, 2), SIDE - side - 2);
  return [
    h("rect", { class: `${kind}-ring`, x: left, y: top, width: side, height: side, rx: 4 }),
    h(
      "g",
      { class: `${kind}-badge`, transform: `translate(${round(badge.x)} ${round(badge.y)})` },
      h("circle", { r: 12 }),
      h("path", { d: mark, class: "badge-mark" }),
    ),
  ];
}

/**
 * Verge, roads, hairlines, kerbs, lanes and the arrows on the asphalt, from the rows and columns that are road.
 * @param {number} size
 * @param {Roads} roads
 * @returns {Drawing[]}
 */
function ground(size, roads) {
  const u = SIDE / size;
  const rows = bands(roads.rows);
  const columns = bands(roads.columns);
  return [
    h("rect", { class: "verge", width: SIDE, height: SIDE }),
    h("path", {
      class: "road",
      d: [
        ...rows.map(([a, b]) => `M0 ${round(a * u)}H${SIDE}V${round(b * u)}H0Z`),
        ...columns.map(([a, b]) => `M${round(a * u)} 0H${round(b * u)}V${SIDE}H${round(a * u)}Z`),
      ].join(""),
    }),
    h("path", { class: "cellmark", d: cellmarks(size, rows, columns) }),
    h("path", { class: "kerb", d: kerbs(size, rows, columns) }),
    h("path", { class: "lane", d: lanes(size, rows, columns) }),
    ...arrows(size, rows, columns),
  ];
}

/**
 * Neighbouring lanes make one road: [6, 7] is one band from 6 to 8.
 * @param {number[]} lines
 * @returns {[from: number, to: number][]}
 */
export function bands(lines) {
  /** @type {[number, number][]} */
  const found = [];
  for (const each of [...lines].sort((a, b) => a - b)) {
    const last = found.at(-1);
    if (last && last[1] === each) last[1] = each + 1;
    else found.push([each, each + 1]);
  }
  return found;
}

/**
 * Hairlines between the cells of a road, none inside a crossing.
 * @param {number} size
 * @param {[number, number][]} rows
 * @param {[number, number][]} columns
 */
function cellmarks(size, rows, columns) {
  const u = SIDE / size;
  const edges = Array.from({ length: size - 1 }, (_, i) => i + 1);
  const outside = (/** @type {[number, number][]} */ crossing) => (/** @type {number} */ edge) =>
    crossing.every(([a, b]) => edge <= a || edge >= b);
  const across = rows.flatMap(([a, b]) =>
    edges.filter(outside(columns)).map((x) => `M${round(x * u)} ${round(a * u)}V${round(b * u)}`),
  );
  const down = columns.flatMap(([a, b]) =>
    edges.filter(outside(rows)).map((y) => `M${round(a * u)} ${round(y * u)}H${round(b * u)}`),
  );
  return [...across, ...down].join("");
}

/**
 * The edges of the roads, open where another road joins.
 * @param {number} size
 * @param {[number, number][]} rows
 * @param {[number, number][]} columns
 */
function kerbs(size, rows, columns) {
  const u = SIDE / size;
  const across = rows.flatMap((band) =>
    band.flatMap((y) => gaps(size, columns).map(([a, b]) => `M${round(a * u)} ${round(y * u)}H${round(b * u)}`)),
  );
  const down = columns.flatMap((band) =>
    band.flatMap((x) => gaps(size, rows).map(([a, b]) => `M${round(x * u)} ${round(a * u)}V${round(b * u)}`)),
  );
  return [...across, ...down].join("");
}

/**
 * The dashes between two lanes, interrupted at crossings.
 * @param {number} size
 * @param {[number, number][]} rows
 * @param {[number, number][]} columns
 */
function lanes(size, rows, columns) {
  const u = SIDE / size;
  const middle = (/** @type {[number, number]} */ [a, b]) => (b - a === 2 ? [round((a + 1) * u)] : []);
  const across = rows.flatMap((band) =>
    middle(band).flatMap((y) => gaps(size, columns).map(([a, b]) => `M${round(a * u)} ${y}H${round(b * u)}`)),
  );
  const down = columns.flatMap((band) =>
    middle(band).flatMap((x) => gaps(size, rows).map(([a, b]) => `M${x} ${round(a * u)}V${round(b * u)}`)),
  );
  return [...across, ...down].join("");
}

/**
 * What lies between the bands, border to border.
 * @param {number} size
 * @param {[number, number][]} taken
 * @returns {[number, number][]}
 */
function gaps(size, taken) {
  const edges = [0, ...taken.flat(), size];
  /** @type {[number, number][]} */
  const free = [];
  for (let i = 0; i < edges.length; i += 2) free.push([edges[i] ?? 0, edges[i + 1] ?? size]);
  return free.filter(([a, b]) => b > a);
}

/**
 * Painted arrows in the first and last cell of each lane of a two-lane road: right-hand traffic.
 * @param {number} size
 * @param {[number, number][]} rows
 * @param {[number, number][]} columns
 */
function arrows(size, rows, columns) {
  const u = SIDE / size;
  const two = (/** @type {[number, number][]} */ lines) => lines.filter(([a, b]) => b - a === 2).map(([a]) => a);
  const ends = [0, size - 1];
  const paint = (/** @type {Cell} */ cell, /** @type {number} */ turn) => {
    const { x, y } = centre(u, cell);
    return h("path", { class: "arrow-paint", d: "M-6 4 0-3 6 4", transform: `translate(${x} ${y}) rotate(${turn})` });
  };
  const down = two(columns).flatMap((a) =>
    ends.flatMap((row) => [paint([row, a], TURN.down), paint([row, a + 1], TURN.up)]),
  );
  const across = two(rows).flatMap((a) =>
    ends.flatMap((column) => [paint([a, column], TURN.left), paint([a + 1, column], TURN.right)]),
  );
  return [...down, ...across];
}
