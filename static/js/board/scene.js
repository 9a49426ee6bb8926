// @ts-check
// The screen of a round as one small picture, for the instructions: a board of the game on the left, signs or legend and
// keys on the right, and letters that tie the picture to the list beside it. 560 × 330 drawing units. Pure.

import { h, round } from "./drawing.js";
import { CAUTION, icon } from "./symbols.js";
import { badge, plane } from "./tokens.js";

/** @import { Drawing, Sign } from "../lib/types.js" */

/** @typedef {{ x: number, y: number }} Point */
/** @typedef {"up" | "right" | "down" | "left"} Way */

const SIZE = { width: 560, height: 330 };
const BOARD = { x: 26, y: 30, side: 270, units: 490 };
const CARD = { x: 330, y: 30, width: 206 };
/** Of signs: below the heading of the card. */
const AREA = { x: CARD.x + 4, y: 70, width: CARD.width - 8, height: 144 };
const MARK = 13;

/**
 * @param {string} label
 * @param {Drawing} board
 * @param {(Drawing | null | false)[]} beside
 */
export function scene(label, board, beside) {
  const { x, y, side } = BOARD;
  return h("svg", { viewBox: `0 0 ${SIZE.width} ${SIZE.height}`, role: "img", "aria-label": label }, [
    inset(board, { x, y, width: side, height: side }),
    ...beside,
  ]);
}

/**
 * A drawing as part of another; what it says to a screen reader is left to the whole.
 * @param {Drawing} drawing
 * @param {{ x: number, y: number, width: number, height: number }} place
 */
function inset(drawing, place) {
  return h("svg", { ...place, viewBox: String(drawing.attributes.viewBox) }, ...drawing.children);
}

/**
 * From the board's own units to the scene's.
 * @param {Point} point
 */
export function onBoard({ x, y }) {
  const scale = BOARD.side / BOARD.units;
  return { x: BOARD.x + x * scale, y: BOARD.y + y * scale };
}

/**
 * Where a sign of the card stands in the scene.
 * @param {Sign} sign
 */
export function onCard({ x, y }) {
  const drawn = plane({ signs: [], said: null, blank: true, label: "" });
  const [, top = 0, width = 1, height = 1] = String(drawn.attributes.viewBox).split(" ").map(Number);
  const scale = Math.min(AREA.width / width, AREA.height / height);
  const [left, above] = [(AREA.width - width * scale) / 2, (AREA.height - height * scale) / 2];
  return {
    x: AREA.x + left + x * width * scale,
    y: AREA.y + above + (y * (height + 2 * top) - top) * scale,
  };
}

/**
 * A letter in a black disc at `from`, moved inside the picture if need be, and a line to what it names.
 * @param {string} letter
 * @param {Point} to
 * @param {Point} from
 */
export function callout(letter, to, from) {
  const x = clamp(from.x, MARK, SIZE.width - MARK);
  const y = clamp(from.y, MARK, SIZE.height - MARK);
  return h(
    "g",
    { "data-letter": letter },
    h("path", { class: "leader", d: `M${round(x)} ${round(y)}L${round(to.x)} ${round(to.y)}` }),
    h("circle", { class: "leader-mark", cx: x, cy: y, r: MARK }),
    h("text", { class: "leader-text", x, y: y + 1 }, letter),
  );
}

/**
 * @param {number} value
 * @param {number} least
 * @param {number} most
 */
function clamp(value, least, most) {
  return Math.min(most, Math.max(least, value));
}

/**
 * The card of signs, all blank.
 * @param {string} heading
 * @param {Sign[]} signs
 * @param {number | null} said
 */
export function signCard(heading, signs, said) {
  const { x, y, width } = CARD;
  const drawn = plane({ signs, said, blank: true, label: "" });
  return h(
    "g",
    {},
    h("rect", { class: "mini-card", x, y, width, height: 186, rx: 6 }),
    h("path", { class: "fog-line", d: `M${x} 68H${x + width}` }),
    h("text", { class: "mini-text", x: x + 14, y: 54 }, heading),
    said !== null && inset(badge(said, true), { x: x + width - 36, y: 36, width: 26, height: 26 }),
    inset(drawn, AREA),
  );
}

/** What the triangles' sizes say. */
export function triangleCard() {
  const { x, y, width } = CARD;
  const samples = [
    { at: 36, side: 16, opacity: 0.35 },
    { at: 74, side: 24, opacity: 0.6 },
    { at: 118, side: 32, opacity: 0.85 },
    { at: 168, side: 40, opacity: 1 },
  ];
  return h(
    "g",
    {},
    h("rect", { class: "mini-card", x, y, width, height: 116, rx: 6 }),
    ...samples.map(({ at, side, opacity }) => triangle(x + at, 82, side, opacity)),
    h("text", { class: "mini-quiet", x: x + 16, y: 130 }, "less likely"),
    h("text", { class: "mini-quiet", x: x + width - 16, y: 130, "text-anchor": "end" }, "more likely"),
  );
}

/**
 * @param {number} x
 * @param {number} y
 * @param {number} side
 * @param {number} opacity
 */
function triangle(x, y, side, opacity) {
  const transform = `translate(${x} ${y}) scale(${round(side / 24)}) translate(-12 -12)`;
  return h("path", { class: "caution", fill: "currentColor", "fill-rule": "evenodd", d: CAUTION, opacity, transform });
}

/**
 * A key; the one that is down is dark, as in the game.
 * @param {{ x: number, y: number, width: number, height: number, down: boolean }} place
 * @param {...Drawing} face
 */
function key({ down, ...place }, ...face) {
  return h("g", { class: down ? "mini is-down" : "mini" }, h("rect", { class: "mini-key", ...place, rx: 5 }), ...face);
}

/**
 * @param {number} x its middle
 * @param {number} y
 * @param {string} text
 * @param {string} [classes]
 */
function word(x, y, text, classes = "mini-text") {
  return h("text", { class: classes, "text-anchor": "middle", x, y }, text);
}

/** @type {Record<Way, Point>} */
const ARROWS = {
  up: { x: 412, y: 228 },
  left: { x: 364, y: 267 },
  down: { x: 412, y: 267 },
  right: { x: 460, y: 267 },
};

/** @param {Way | null} down */
export function arrowKeys(down) {
  const face = { width: 20, height: 20 };
  const keys = Object.entries(ARROWS).map(([name, { x, y }]) =>
    key({ x, y, width: 42, height: 32, down: name === down }, inset(icon(name), { x: x + 11, y: y + 6, ...face })),
  );
  return h("g", {}, keys);
}

/**
 * @param {number} count
 * @param {number | null} down
 */
export function digitKeys(count, down) {
  const keys = Array.from({ length: count }, (_, i) => {
    const x = CARD.x + 23 * i;
    const digit = word(x + 10, 262, String(i + 1));
    return key({ x, y: 240, width: 20, height: 34, down: i + 1 === down }, digit);
  });
  return h("g", {}, keys);
}

/** @param {"go" | "brake" | null} down */
export function pedals(down) {
  const faces = /** @type {const} */ ([
    ["brake", "BRAKE", "F", 330],
    ["go", "GO", "J", 440],
  ]);
  const keys = faces.map(([name, text, letter, x]) =>
    key(
      { x, y: 166, width: 96, height: 134, down: name === down },
      inset(icon(name), { x: x + 36, y: 184, width: 24, height: 24 }),
      word(x + 48, 236, text),
      h("rect", { class: "mini-cap", x: x + 35, y: 252, width: 26, height: 26, rx: 4 }),
      word(x + 48, 270, letter, "mini-letter"),
    ),
  );
  return h("g", {}, keys);
}
