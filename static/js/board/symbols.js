// @ts-check
// Figures and icons as drawings. The same shapes stand in templates/partials/sprite.html for pages without scripts;
// tests/static/symbols.test.mjs compares the two.

import { h } from "./drawing.js";

/** @import { Drawing } from "../lib/types.js" */

/** @type {Record<string, Drawing[]>} Figures on a 48 × 48 square. */
export const FIGURES = {
  parent: [
    h(
      "g",
      { fill: "currentColor" },
      h("circle", { cx: 24, cy: 10.5, r: 7 }),
      h("path", {
        d: "M24 19.5c-7.6 0-11.6 3.9-12.2 10.2l-.9 9.1c-.1 1 .7 1.9 1.7 1.9h3.1l.6 4.3c.1.7.8 1.3 1.5 1.3h12.4c.8 0 1.4-.6 1.5-1.3l.6-4.3h3.1c1 0 1.8-.9 1.7-1.9l-.9-9.1c-.6-6.3-4.6-10.2-12.2-10.2z",
      }),
    ),
  ],
  child: [
    h(
      "g",
      { fill: "currentColor" },
      h("circle", { cx: 23, cy: 18.5, r: 6.5 }),
      h("path", {
        d: "M23 26.5c-5.1 0-7.9 2.6-8.3 7l-.5 5.2c-.1.8.5 1.4 1.3 1.4h1.9l.5 4.9c.1.7.6 1.2 1.3 1.2h7.6c.7 0 1.2-.5 1.3-1.2l.5-4.9h1.9c.8 0 1.4-.6 1.3-1.4l-.5-5.2c-.4-4.4-3.2-7-8.3-7z",
      }),
    ),
    h("path", { d: "m29.5 31.5 7.5-13", stroke: "currentColor", "stroke-width": 4.6, "stroke-linecap": "round" }),
  ],
  car: [
    h("rect", { class: "car-body", x: 10, y: 3, width: 28, height: 42, rx: 9 }),
    h("path", {
      class: "car-glass",
      d: "M14 18.5c.4-2.6 4-4.7 10-4.7s9.6 2.1 10 4.7l-2.1 4.7c-4.6-1.4-11.2-1.4-15.8 0zM16 36c4.800 1.100 11.200 1.100 16 0l1.700 2.900c-2.300 1.700-5.400 2.300-9.700 2.300s-7.400-.6-9.700-2.300z",
    }),
    h("path", {
      class: "car-line",
      d: "M13.300 8.600c.8-1.500 2.400-2.500 4.400-2.900v3zM34.700 8.600c-.8-1.500-2.400-2.500-4.400-2.900v3z",
    }),
  ],
};

/** The triangle on a 24 × 24 square. */
export const CAUTION =
  "M12 1.6c.8 0 1.5.4 1.9 1.1l9.2 16.1c.9 1.5-.2 3.4-1.9 3.4H2.8c-1.7 0-2.8-1.9-1.9-3.4l9.2-16.1c.4-.7 1.1-1.1 1.9-1.1zm-1.5 6.3.45 7.3h2.1l.45-7.3zm1.5 8.7a1.6 1.6 0 1 0 0 3.2 1.6 1.6 0 0 0 0-3.2z";

const LINE = { fill: "none", stroke: "currentColor", "stroke-linecap": "round", "stroke-linejoin": "round" };
const THIN = { ...LINE, "stroke-width": 2.2 };
const ARROW = { ...LINE, "stroke-width": 2.6 };
const CIRCLE = h("circle", { cx: 12, cy: 12, r: 10, fill: "none", stroke: "currentColor", "stroke-width": 2 });

/** @type {Record<string, Drawing[]>} Icons on a 24 × 24 square. */
export const ICONS = {
  good: [CIRCLE, h("path", { d: "m7.5 12.5 3 3 6-6.5", ...THIN })],
  bad: [CIRCLE, h("path", { d: "m8.5 8.5 7 7m0-7-7 7", ...THIN })],
  info: [CIRCLE, h("path", { d: "M12 11v6", ...THIN }), h("circle", { cx: 12, cy: 7.5, r: 1.3, fill: "currentColor" })],
  wait: [CIRCLE, h("path", { d: "M12 6.5V12l3.5 2.5", ...THIN })],
  replay: [h("path", { d: "M4.5 12a7.5 7.5 0 1 0 2.4-5.5M4.5 3.5v4h4", ...THIN })],
  practice: [h("path", { d: "M3 9.5 12 5l9 4.500-9 4.500zM6.500 11.500v4.500c3 2.700 8 2.700 11 0v-4.500", ...THIN })],
  offline: [
    h("path", {
      d: "M2 8.8a15 15 0 0 1 20 0M5.5 12.6a10 10 0 0 1 13 0M9 16.3a5 5 0 0 1 6 0",
      ...LINE,
      "stroke-width": 2,
    }),
    h("circle", { cx: 12, cy: 19.6, r: 1.4, fill: "currentColor" }),
    h("path", { d: "M4 3.5 20 21", ...THIN }),
  ],
  tabs: [h("path", { d: "M8 8V4.500h12.500V16H17M3.500 8H17v11.500H3.500z", ...THIN })],
  up: [h("path", { d: "M12 20V5m-6.5 6L12 4.5 18.5 11", ...ARROW })],
  right: [h("path", { d: "M4 12h15m-6-6.5 6.5 6.5-6.5 6.5", ...ARROW })],
  down: [h("path", { d: "M12 4v15m-6.5-6L12 19.5 18.5 13", ...ARROW })],
  left: [h("path", { d: "M20 12H5m6-6.5L4.5 12 11 18.5", ...ARROW })],
  brake: [h("rect", { x: 4, y: 4, width: 16, height: 16, rx: 2.5, fill: "currentColor" })],
  go: [
    h("path", {
      d: "M6 4.6c0-1.2 1.3-1.9 2.3-1.3l11.4 7.4c.9.6.9 2 0 2.6L8.3 20.7C7.3 21.3 6 20.6 6 19.4z",
      fill: "currentColor",
    }),
  ],
};

/**
 * A figure as part of a larger drawing: centred at (x, y), `size` wide, turned by `turn` degrees.
 * @param {"parent" | "child" | "car"} name
 * @param {{ x: number, y: number, size: number, turn?: number, class?: string }} place
 */
export function figure(name, { x, y, size, turn = 0, class: classes }) {
  const scale = round4(size / 48);
  const turned = turn ? ` rotate(${turn})` : "";
  const transform = `translate(${x} ${y})${turned} scale(${scale}) translate(-24 -24)`;
  return h("g", { class: classes, transform }, FIGURES[name] ?? []);
}

/**
 * An icon as a drawing of its own.
 * @param {string} name
 * @param {string} [classes]
 */
export function icon(name, classes) {
  return h("svg", { class: classes, viewBox: "0 0 24 24", "aria-hidden": "true" }, ICONS[name] ?? []);
}

/**
 * A figure as a drawing of its own (legends, headings).
 * @param {"parent" | "child" | "car"} name
 * @param {string} [classes]
 */
export function portrait(name, classes) {
  return h("svg", { class: classes, viewBox: "0 0 48 48", "aria-hidden": "true" }, FIGURES[name] ?? []);
}

/** @param {number} value */
function round4(value) {
  return Math.round(value * 10000) / 10000;
}
