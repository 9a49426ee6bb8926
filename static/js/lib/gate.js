// @ts-check
// Whether a device can show the game, found out before consent. Nothing here leaves the browser. Pure.

import { FrameMeter } from "./clock.js";

/** @typedef {{ width_min: number, height_min: number, refresh_min_hz: number, keyboard: boolean, keys: string[][] }} Needs */
/** @typedef {"good" | "open" | "bad"} Verdict open: still to be done, or still being measured */
/** @typedef {"phone" | "keyboard" | "viewport" | "frames" | "browser"} Check */

/** Frames are watched for a second; a page that is just loading draws slowly, so a slow one gets three more. */
export const WATCH_MS = 1000;
export const PATIENCE_MS = 4000;

/** What hinders most comes first: this is the reason that the site is told. @type {Check[]} */
const ORDER = ["phone", "browser", "viewport", "frames", "keyboard"];

export class Gate {
  /** @type {Set<string[]>} */ #missing;
  #size = { width: 0, height: 0 };
  #meter = new FrameMeter();
  /** @type {number | null} */ #last = null;
  #watched_ms = 0;

  /**
   * @param {Needs} needs
   * @param {{ device: "desktop" | "tablet" | "phone", lacking: string[] }} found lacking: features that the browser has not
   */
  constructor(needs, { device, lacking }) {
    this.needs = needs;
    this.device = device;
    this.lacking = lacking;
    this.#missing = new Set(needs.keyboard ? needs.keys : []);
  }

  /**
   * A key went down.
   * @param {string | null} name
   * @returns {boolean} whether it was asked for
   */
  key(name) {
    const group = [...this.#missing].find((keys) => name !== null && keys.includes(name));
    return group !== undefined && this.#missing.delete(group);
  }

  /** The groups of keys of which none was pressed yet. */
  get keysLeft() {
    return [...this.#missing];
  }

  /** @param {{ width: number, height: number }} size of the window's inside */
  resize(size) {
    this.#size = size;
  }

  get size() {
    return this.#size;
  }

  /** @param {number} time of an animation frame */
  frame(time) {
    this.#meter.frame(time);
    if (this.#last !== null) this.#watched_ms += time - this.#last;
    this.#last = time;
  }

  /** The page was hidden: no frames are drawn then. */
  pause() {
    this.#meter.pause();
    this.#last = null;
  }

  get refresh_hz() {
    return this.#meter.refresh_hz;
  }

  /** @returns {Record<Check, Verdict>} */
  get checks() {
    const { width_min, height_min, keyboard } = this.needs;
    return {
      phone: keyboard && this.device !== "desktop" ? "bad" : "good",
      browser: this.lacking.length > 0 ? "bad" : "good",
      viewport: this.#size.width >= width_min && this.#size.height >= height_min ? "good" : "bad",
      frames: this.#frames(),
      keyboard: this.#missing.size > 0 ? "open" : "good",
    };
  }

  /** @returns {Verdict} */
  #frames() {
    const { refresh_min_hz } = this.needs;
    if (refresh_min_hz === 0) return "good";
    const hz = this.refresh_hz;
    if (this.#watched_ms < WATCH_MS || hz === null) return this.#watched_ms < PATIENCE_MS ? "open" : "bad";
    if (hz >= refresh_min_hz) return "good";
    return this.#watched_ms < PATIENCE_MS ? "open" : "bad";
  }

  get passed() {
    return Object.values(this.checks).every((verdict) => verdict === "good");
  }

  /** Why the device does not fit: what failed, else what is still open. @returns {Check} */
  get reason() {
    const { checks } = this;
    const failed = ORDER.find((check) => checks[check] === "bad") ?? ORDER.find((check) => checks[check] === "open");
    return failed ?? "keyboard";
  }
}

/** What the pages are built on; a browser without one of these cannot run the game. @type {[string, (page: any) => boolean][]} */
const FEATURES = [
  ["import maps", (page) => page.HTMLScriptElement?.supports?.("importmap") === true],
  ["frames", (page) => typeof page.requestAnimationFrame === "function"],
  ["clock", (page) => typeof page.performance?.now === "function"],
  ["requests", (page) => typeof page.fetch === "function" && typeof page.AbortSignal?.timeout === "function"],
  ["random numbers", (page) => typeof page.crypto?.getRandomValues === "function"],
];

/**
 * The features that a browser has not.
 * @param {object} page its window
 */
export function lacking(page) {
  return FEATURES.filter(([, has]) => !has(page)).map(([name]) => name);
}

/**
 * What stands beside a check.
 * @param {Gate} gate
 * @param {Check} check
 */
export function told(gate, check) {
  const { checks, needs, size } = gate;
  const good = checks[check] === "good";
  if (check === "keyboard") return good ? "works" : wanted(gate.keysLeft);
  if (check === "viewport") {
    const now = `${size.width} by ${size.height}`;
    return good ? "large enough" : `is ${now}; make it at least ${needs.width_min} by ${needs.height_min}`;
  }
  if (check === "frames") {
    if (good) return "fast enough";
    return checks.frames === "open" ? "is being measured …" : "is too slow for the game";
  }
  return good ? "new enough" : "is too old; use a new Chrome, Edge, Firefox or Safari";
}

/** @type {Record<string, string>} */
const CAPS = { brake: "F", go: "J" };

/** @param {string[][]} left */
function wanted(left) {
  const [first, second] = left.map(([key]) => CAPS[key ?? ""]);
  if (first === undefined) return "press any arrow key";
  return second === undefined ? `press ${first}` : `press ${first} and ${second}`;
}
