// @ts-check
// Message tokens: a number, a shape and a colour, and the plane on which they stand. Pure.
// No shape points anywhere: all nine are symmetric in both axes and of about equal area.

import { h } from "./drawing.js";

/** @import { Sign, Drawing } from "../lib/types.js" */

/** The plane on which the lexicon placed the tokens (models/interpret/plane.py): the unit square, y down. */
export const PLANE = { width: 430, height: 330 };

/** Cut off above and below: positions keep 40 units from the edge, the ring needs 35. */
const SPARE = 5;

/** @type {Record<number, Drawing>} */
const SHAPES = {
  1: h("circle", { class: "shape", r: 19.5 }),
  2: h("rect", { class: "shape", x: -17.5, y: -17.5, width: 35, height: 35, rx: 3 }),
  3: path("M24.5 0L0 24.5L-24.5 0L0 -24.5Z"),
  4: path(
    "M10.8 -20.5L10.8 -10.8L20.5 -10.8L20.5 10.8L10.8 10.8L10.8 20.5L-10.8 20.5L-10.8 10.8L-20.5 10.8L-20.5 -10.8L-10.8 -10.8L-10.8 -20.5Z",
  ),
  5: path("M21.5 0L10.8 18.6L-10.7 18.6L-21.5 0L-10.8 -18.6L10.8 -18.6Z"),
  6: path(
    "M-10.8-10.8A10.8 10.8 0 0 1 10.8-10.8A10.8 10.8 0 0 1 10.8 10.8A10.8 10.8 0 0 1-10.8 10.8A10.8 10.8 0 0 1-10.8-10.8Z",
  ),
  7: path("M26 0L11.7 11.7L0 26L-11.7 11.7L-26 0L-11.7 -11.7L0 -26L11.7 -11.7Z"),
  8: path(
    "M21.2 8.8L12.4 12.4L8.8 21.2L0 17.6L-8.8 21.2L-12.4 12.4L-21.2 8.8L-17.6 0L-21.2 -8.8L-12.4 -12.4L-8.8 -21.2L0 -17.6L8.8 -21.2L12.4 -12.4L21.2 -8.8L17.6 0Z",
  ),
  9: path(
    "M22.1 -6.9L15.3 0L22.1 6.9L6.9 22.1L0 15.3L-6.9 22.1L-22.1 6.9L-15.3 0L-22.1 -6.9L-6.9 -22.1L0 -15.3L6.9 -22.1Z",
  ),
};

/** @param {string} d */
function path(d) {
  return h("path", { class: "shape", d });
}

/**
 * One sign. Hollow: can be said. Thick, dashed ring: pointed at. Filled, solid ring: has been said.
 * @param {number} number
 * @param {{ state?: "aim" | "said" | "", ring?: boolean, blank?: boolean, x?: number, y?: number, pick?: boolean }} look
 */
export function token(number, { state = "", ring = false, blank = false, x = 0, y = 0, pick = false } = {}) {
  const shape = blank ? h("circle", { class: "shape", r: 19.5 }) : SHAPES[number];
  return h(
    "g",
    {
      class: ["token", blank ? "blank" : `token-${number}`, state, pick && "pick"].filter(Boolean).join(" "),
      transform: `translate(${round(x)} ${round(y)})`,
      "data-number": pick ? number : undefined,
    },
    (ring || pick) && h("circle", { class: "ring", r: 33 }),
    shape ?? h("circle", { class: "shape", r: 19.5 }),
    !blank && h("text", { y: 1 }, String(number)),
    pick && h("circle", { class: "target", r: 24 }),
  );
}

/**
 * One sign as a drawing of its own, for the panel's heading.
 * @param {number} number
 * @param {boolean} blank
 */
export function badge(number, blank) {
  const label = blank ? "a blank sign" : `message ${number}`;
  return h(
    "svg",
    { viewBox: "-26 -26 52 52", role: "img", "aria-label": label },
    token(number, { state: "said", blank }),
  );
}

/**
 * All signs in their places; the one that was said is drawn last, so that nothing covers its ring.
 * @param {{ signs: Sign[], said: number | null, aim?: number | null, blank: boolean, pick?: boolean, label: string }} panel
 */
export function plane({ signs, said, aim = null, blank, pick = false, label }) {
  const marked = said ?? aim;
  const ordered = [...signs].sort((a, b) => Number(a.number === marked) - Number(b.number === marked));
  return h(
    "svg",
    {
      class: "plane",
      viewBox: `0 ${SPARE} ${PLANE.width} ${PLANE.height - 2 * SPARE}`,
      role: "img",
      "aria-label": label,
    },
    ordered.map((sign) => {
      const state = sign.number === said ? "said" : sign.number === aim ? "aim" : "";
      return token(sign.number, { state, ring: state !== "", blank, pick, ...place(sign) });
    }),
  );
}

/**
 * From the unit square to the plane.
 * @param {{ x: number, y: number }} sign
 */
export function place({ x, y }) {
  return { x: x * PLANE.width, y: y * PLANE.height };
}

/** @param {number} value */
function round(value) {
  return Math.round(value * 10) / 10;
}
