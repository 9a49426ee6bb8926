// @ts-check
// Drawings are plain values until the moment they are shown: `h` makes a node, `build` turns it into SVG elements.
// So that renderers are pure (and tested without a browser) and a strict content policy holds (no markup strings).

/** @import { Drawing } from "../lib/types.js" */

const SVG = "http://www.w3.org/2000/svg";

/**
 * A node; attributes that are undefined, null or false are left out, numbers are rounded to 1/100.
 * @param {string} tag
 * @param {Record<string, string | number | boolean | null | undefined>} [attributes]
 * @param {...(Drawing | string | null | false | (Drawing | null | false)[])} children
 * @returns {Drawing}
 */
export function h(tag, attributes = {}, ...children) {
  /** @type {Record<string, string | number>} */
  const kept = {};
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || typeof value === "boolean") continue;
    kept[name] = typeof value === "number" ? round(value) : value;
  }
  const nodes = children.flat().filter((child) => child !== null && child !== false);
  return { tag, attributes: kept, children: /** @type {(Drawing | string)[]} */ (nodes) };
}

/** @param {number} value */
export function round(value) {
  return Math.round(value * 100) / 100;
}

/**
 * The SVG element of a drawing.
 * @param {Drawing} drawing
 * @param {Document} page
 * @returns {SVGElement}
 */
export function build(drawing, page = document) {
  const element = page.createElementNS(SVG, drawing.tag);
  for (const [name, value] of Object.entries(drawing.attributes)) element.setAttribute(name, String(value));
  element.append(...drawing.children.map((child) => (typeof child === "string" ? child : build(child, page))));
  return /** @type {SVGElement} */ (element);
}

/**
 * Every node of a drawing, outermost first.
 * @param {Drawing} drawing
 * @returns {Generator<Drawing>}
 */
export function* nodes(drawing) {
  yield drawing;
  for (const child of drawing.children) if (typeof child !== "string") yield* nodes(child);
}
