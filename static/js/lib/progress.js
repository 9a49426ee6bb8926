// @ts-check
// How far somebody is, while they play: what the bar says. Pure.

/** @import { RoundView } from "./types.js" */

/** Outcomes that are a success; the server's rule for the bonus (services/pages.py) names the same. */
const WON = new Set(["found", "arrived"]);

/**
 * Main rounds of the whole session that have ended, as far as a view tells.
 * @param {Pick<RoundView, "block" | "phase" | "number" | "over">} view
 * @param {number} a_block main rounds of one block
 */
export function roundsOver({ block, phase, number, over }, a_block) {
  const before = (block - 1) * a_block;
  return phase === "practice" ? before : before + number - (over ? 0 : 1);
}

/**
 * Counts rounds won on this page, each once, on top of those won before it was loaded.
 */
export class Winnings {
  /** @type {Set<number>} */ #rounds = new Set();

  /** @param {number} before */
  constructor(before) {
    this.before = before;
  }

  /**
   * A view that a decision has led to.
   * @param {Pick<RoundView, "round" | "phase" | "over">} view
   */
  count({ round, phase, over }) {
    if (phase === "main" && over && WON.has(over.outcome)) this.#rounds.add(round);
    return this.before + this.#rounds.size;
  }
}

/** @param {number} count */
export function roundsLeft(count) {
  return count === 1 ? "1 round left" : `${count} rounds left`;
}

/**
 * @param {number} at_load minutes when the page was made
 * @param {number} since_ms milliseconds since then
 */
export function minutesSoFar(at_load, since_ms) {
  return `${at_load + Math.floor(since_ms / 60_000)} min so far`;
}
