// @ts-check
// The board of Parent & Lost Child: 490 drawing units square, whatever its size on screen. Pure.

import { h, round } from "./drawing.js";
import { figure } from "./symbols.js";
import { token } from "./tokens.js";

/** @import { Cell, ParentView, ChildView, Drawing } from "../lib/types.js" */

const SIDE = 490;
const MARGIN = 2; // room for the frame: 486 units make the cells

/**
 * What the parent sees: fog, the square around them, where they walked; the child only if the view has it.
 * @param {ParentView} view
 */
export function parentBoard(view) {
  const child = view.over?.child ?? view.child;
  const found = view.over?.outcome === "found";
  return board(view.size, parentLabel(view), [
    field("fog", view.size),
    patch("seen", view.size, view.cell, view.vision),
    frame(),
    trail(view.size, view.trail),
    square(view.size, view.cell, view.vision),
    view.over && child && !found && missed(view.size, child),
    ...people(view.size, view.cell, child, found),
  ]);
}

/**
 * What the child sees before it chooses: the whole board, itself, and the parent if the study shows it.
 * @param {ChildView} view
 */
export function choiceBoard(view) {
  const label = `Board, ${view.size} by ${view.size}. You are at ${at(view.cell)}.`;
  return board(view.size, view.parent ? `${label} The parent is at ${at(view.parent)}.` : label, [
    field("seen", view.size),
    frame(),
    view.parent &&
      h("g", { class: "faint" }, square(view.size, view.parent, view.vision), person(view.size, "parent", view.parent)),
    person(view.size, "child", view.cell),
  ]);
}

/**
 * The parent's walk after `steps` of it.
 * @param {ChildView} view
 * @param {number} steps
 */
export function replayBoard(view, steps) {
  const walk = (view.walk ?? []).slice(0, steps + 1);
  const parent = walk.at(-1) ?? view.cell;
  const found = same(parent, view.cell);
  const label = found ? `The parent found you at ${at(view.cell)}.` : `Replay: the parent after ${steps} steps.`;
  return board(view.size, label, [
    field("seen", view.size),
    frame(),
    trail(view.size, walk),
    square(view.size, parent, view.vision),
    ...people(view.size, parent, view.cell, found),
  ]);
}

/**
 * The empty board with marks of signs on it (the probe of the signs), and a cursor while one is being placed.
 * @param {{ size: number, marks: { number: number, cell: Cell }[], picked: number | null, cursor: Cell | null }} probe
 */
export function markBoard({ size, marks, picked, cursor }) {
  const told = marks.map(({ number, cell }) => `Sign ${number} at ${at(cell)}.`).join(" ");
  return board(size, `Board, ${size} by ${size}. ${told || "No marks yet."}`, [
    field("seen", size),
    frame(),
    ...marks.map((mark) => markOf(size, mark, marks, picked)),
    cursor && cursorOf(size, cursor),
  ]);
}

/**
 * @param {number} size
 * @param {{ number: number, cell: Cell }} mark
 * @param {{ number: number, cell: Cell }[]} marks
 * @param {number | null} picked
 * Marks in the same cell share it, side by side.
 */
function markOf(size, { number, cell }, marks, picked) {
  const here = marks.filter((other) => same(other.cell, cell));
  const rank = here.findIndex((other) => other.number === number);
  const across = Math.ceil(Math.sqrt(here.length));
  const u = unit(size) / across;
  const { x, y } = centre(size, cell);
  const dx = ((rank % across) - (across - 1) / 2) * u;
  const dy = (Math.floor(rank / across) - (Math.ceil(here.length / across) - 1) / 2) * u;
  const scale = Math.round((u / 54) * (here.length === 1 ? 0.9 : 1) * 100) / 100;
  return h(
    "g",
    { transform: `translate(${round(x + dx)} ${round(y + dy)}) scale(${scale})` },
    token(number, { state: number === picked ? "said" : "" }),
  );
}

/**
 * @param {number} size
 * @param {Cell} cell
 */
function cursorOf(size, cell) {
  const { x, y } = centre(size, cell);
  const side = unit(size) - 2;
  return h("rect", { class: "cursor", x: x - side / 2, y: y - side / 2, width: side, height: side, rx: 3 });
}

/**
 * The cell under a point of the board.
 * @param {number} size
 * @param {{ x: number, y: number }} point as shares of the board's side, 0 to 1
 * @returns {Cell}
 */
export function cellAt(size, { x, y }) {
  const index = (/** @type {number} */ share) =>
    Math.min(size - 1, Math.max(0, Math.floor((share * SIDE - MARGIN) / unit(size))));
  return [index(y), index(x)];
}

/** @param {ParentView} view */
function parentLabel(view) {
  const child = view.over?.child ?? view.child;
  if (view.over?.outcome === "found") return `You found the child at ${at(view.cell)}.`;
  const here = `Board, ${view.size} by ${view.size}. You are at ${at(view.cell)}.`;
  return child ? `${here} The child is at ${at(child)}.` : here;
}

/**
 * @param {number} size
 * @param {string} label
 * @param {(Drawing | Drawing[] | null | false)[]} parts
 */
function board(size, label, parts) {
  return h(
    "svg",
    { viewBox: `0 0 ${SIDE} ${SIDE}`, role: "img", "aria-label": label, "data-size": size },
    parts.flat(),
  );
}

/** @param {Cell} cell Cells are counted from 1 for people. */
function at([row, column]) {
  return `row ${row + 1}, column ${column + 1}`;
}

/** @param {number} size */
function unit(size) {
  return (SIDE - 2 * MARGIN) / size;
}

/**
 * The centre of a cell.
 * @param {number} size
 * @param {Cell} cell
 */
export function centre(size, [row, column]) {
  return { x: MARGIN + (column + 0.5) * unit(size), y: MARGIN + (row + 0.5) * unit(size) };
}

/**
 * @param {"fog" | "seen"} kind
 * @param {number} size
 */
function field(kind, size) {
  return area(kind, size, 0, size, 0, size);
}

/**
 * The part of the board within `reach` of a cell.
 * @param {"seen"} kind
 * @param {number} size
 * @param {Cell} cell
 * @param {number} reach
 */
function patch(kind, size, cell, reach) {
  const [top, bottom, left, right] = window(size, cell, reach);
  return area(kind, size, top, bottom, left, right);
}

/**
 * @param {number} size
 * @param {Cell} cell
 * @param {number} reach
 * @returns {[top: number, bottom: number, left: number, right: number]} half-open, clipped at the border
 */
function window(size, [row, column], reach) {
  return [
    Math.max(0, row - reach),
    Math.min(size, row + reach + 1),
    Math.max(0, column - reach),
    Math.min(size, column + reach + 1),
  ];
}

/**
 * @param {"fog" | "seen"} kind
 * @param {number} size
 * @param {number} top
 * @param {number} bottom
 * @param {number} left
 * @param {number} right
 */
function area(kind, size, top, bottom, left, right) {
  const u = unit(size);
  const [x0, x1] = [MARGIN + left * u, MARGIN + right * u];
  const [y0, y1] = [MARGIN + top * u, MARGIN + bottom * u];
  const across = Array.from(
    { length: right - left - 1 },
    (_, i) => `M${round(MARGIN + (left + i + 1) * u)} ${round(y0)}V${round(y1)}`,
  );
  const down = Array.from(
    { length: bottom - top - 1 },
    (_, i) => `M${round(x0)} ${round(MARGIN + (top + i + 1) * u)}H${round(x1)}`,
  );
  return [
    h("rect", { class: kind, x: x0, y: y0, width: (right - left) * u, height: (bottom - top) * u }),
    h("path", { class: `${kind}-line`, d: [...across, ...down].join("") }),
  ];
}

function frame() {
  return h("rect", { class: "frame", x: 1, y: 1, width: SIDE - 2, height: SIDE - 2, rx: 2 });
}

/**
 * The line where someone walked: a ring at the start, a dot at each cell between (neither behind the walker).
 * @param {number} size
 * @param {Cell[]} cells
 */
function trail(size, cells) {
  if (cells.length === 0) return [];
  const points = cells.map((cell) => centre(size, cell));
  const line = points.map(({ x, y }) => `${round(x)} ${round(y)}`).join("L");
  const start = /** @type {{x: number, y: number}} */ (points[0]);
  const end = /** @type {{x: number, y: number}} */ (points.at(-1));
  return [
    points.length > 1 && h("path", { class: "trail", d: `M${line}` }),
    ...points
      .slice(1, -1)
      .filter((point) => !isAt(point, end))
      .map(({ x, y }) => h("circle", { class: "trail-dot", cx: x, cy: y, r: 6 })),
    !isAt(start, end) && h("circle", { class: "trail-start", cx: start.x, cy: start.y, r: 9 }),
  ].filter((node) => node !== false);
}

/**
 * @param {{x: number, y: number}} a
 * @param {{x: number, y: number}} b
 */
function isAt(a, b) {
  return a.x === b.x && a.y === b.y;
}

/**
 * The frame around what a parent at `cell` sees.
 * @param {number} size
 * @param {Cell} cell
 * @param {number} reach
 */
function square(size, cell, reach) {
  const [top, bottom, left, right] = window(size, cell, reach);
  const u = unit(size);
  return h("rect", {
    class: "vision",
    x: MARGIN + left * u,
    y: MARGIN + top * u,
    width: (right - left) * u,
    height: (bottom - top) * u,
    rx: 3,
  });
}

/**
 * @param {number} size
 * @param {"parent" | "child"} name
 * @param {Cell} cell
 */
function person(size, name, cell) {
  const { x, y } = centre(size, cell);
  return figure(name, { x, y, size: name === "parent" ? 46 : 50, class: `${name} halo` });
}

/**
 * Parent and child; together in a ring once they have met.
 * @param {number} size
 * @param {Cell} parent
 * @param {Cell | null} child
 * @param {boolean} met
 */
function people(size, parent, child, met) {
  if (!met)
    return [child && person(size, "child", child), person(size, "parent", parent)].filter((one) => one !== null);
  const { x, y } = centre(size, parent);
  return [
    h("circle", { class: "arrive-ring on-seen", cx: x, cy: y, r: 34 }),
    figure("parent", { x: x - 11, y, size: 46, class: "parent halo" }),
    figure("child", { x: x + 14, y, size: 46, class: "child halo" }),
  ];
}

/**
 * Where the child was, once it can no longer be found.
 * @param {number} size
 * @param {Cell} cell
 */
function missed(size, cell) {
  const { x, y } = centre(size, cell);
  return h("circle", { class: "miss-ring on-seen", cx: x, cy: y, r: 30 });
}

/**
 * @param {Cell} a
 * @param {Cell} b
 */
function same(a, b) {
  return a[0] === b[0] && a[1] === b[1];
}
