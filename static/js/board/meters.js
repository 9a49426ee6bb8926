// @ts-check
// Rows of ticks: steps used, route driven, rounds played. One tick a unit, so that the limit can be seen. Pure.

import { h, round } from "./drawing.js";

const WIDTH = 440;
const GAP = 3;

/**
 * @param {number} done
 * @param {number} limit
 */
export function meter(done, limit) {
  const width = (WIDTH - GAP * (limit - 1)) / limit;
  return h(
    "svg",
    { viewBox: `0 0 ${WIDTH} 10`, preserveAspectRatio: "none", "aria-hidden": "true" },
    Array.from({ length: limit }, (_, i) =>
      h("rect", { class: i < done ? "past" : undefined, x: i * (width + GAP), y: 1, width, height: 8, rx: 1.5 }),
    ),
  );
}

/**
 * Rounds: those behind, the one being played (taller), those ahead.
 * @param {number} number from 1
 * @param {number} of
 */
export function pips(number, of) {
  const step = Math.min(8, 158 / of);
  const width = step * (of - 0.375);
  return h(
    "svg",
    { class: "pips", viewBox: `0 0 ${round(width)} 10`, width, "aria-hidden": "true" },
    Array.from({ length: of }, (_, i) => {
      const now = i + 1 === number;
      return h("rect", {
        class: now ? "now" : i + 1 < number ? "past" : undefined,
        x: i * step,
        y: now ? 0 : 2,
        width: step * 0.625,
        height: now ? 10 : 6,
        rx: 1,
      });
    }),
  );
}
