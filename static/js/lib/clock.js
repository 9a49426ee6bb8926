// @ts-check
// Reaction time as arithmetic: no DOM, no timers, so that a fake clock can test it.
//
// onset     performance.now() at the DOM write inside a requestAnimationFrame callback
// response  the event's own timeStamp (same axis, set by the browser when the key went down)
// rt        response − onset; network time is in neither
// wait      onset − the response before: people think while they wait

/** @import { Clock, Timing } from "./types.js" */

/** @type {Clock} */
export const browserClock = {
  now: () => performance.now(),
  frame: (callback) => requestAnimationFrame(callback),
};

/**
 * The times of one decision after the other.
 *
 * `begin` (waiting for the picture) → `onset` (the picture is there) → `respond`. An interruption (page hidden or
 * covered) throws the onset away: the next one counts, and the decision is flagged.
 */
export class Stopwatch {
  /** @type {number | null} */ #onset = null;
  /** @type {number | null} */ #previous = null;
  #early = 0;
  #hidden = false;
  #resumed = false;

  get running() {
    return this.#onset !== null;
  }

  /** @param {{ resumed?: boolean }} [how] resumed: after a reload, a lost connection or another tab */
  begin({ resumed = false } = {}) {
    this.#onset = null;
    this.#hidden = false;
    this.#resumed = resumed;
    if (resumed) this.#previous = null;
  }

  /** @param {number} now */
  onset(now) {
    this.#onset = now;
  }

  /** @param {{ hidden?: boolean, resumed?: boolean }} why */
  interrupt({ hidden = false, resumed = false }) {
    this.#onset = null;
    this.#hidden ||= hidden;
    this.#resumed ||= resumed;
  }

  /** A key that came before the picture. */
  early() {
    this.#early += 1;
  }

  /**
   * @param {number} response the event's timeStamp
   * @param {number} handled performance.now() in the handler
   * @returns {Pick<Timing, "onset_ms" | "response_ms" | "rt_ms" | "handler_lag_ms" | "wait_ms" | "hidden" | "resumed" | "early_keys"> | null}
   *   null (and counted as early) when the key went down before the picture was there
   */
  respond(response, handled) {
    if (this.#onset === null || response < this.#onset) {
      this.early();
      return null;
    }
    const timing = {
      onset_ms: thousandth(this.#onset),
      response_ms: thousandth(response),
      rt_ms: thousandth(response - this.#onset),
      handler_lag_ms: thousandth(handled - response),
      wait_ms: this.#previous === null ? null : thousandth(this.#onset - this.#previous),
      hidden: this.#hidden,
      resumed: this.#resumed,
      early_keys: this.#early,
    };
    this.#previous = response;
    this.#early = 0;
    this.#onset = null;
    return timing;
  }
}

/** Frame times: the display's refresh rate, and how many frames were missed since a mark. */
export class FrameMeter {
  /** @type {number[]} */ #intervals = [];
  /** @type {number | null} */ #last = null;
  #dropped = 0;

  /** @param {number} time of a frame */
  frame(time) {
    if (this.#last !== null && time > this.#last) this.#count(time - this.#last);
    this.#last = time;
  }

  /** @param {number} interval */
  #count(interval) {
    const usual = this.#median();
    if (usual !== null && interval > 1.5 * usual) this.#dropped += Math.round(interval / usual) - 1;
    this.#intervals.push(interval);
    if (this.#intervals.length > 120) this.#intervals.shift();
  }

  /** The page was hidden: the gap says nothing about the display. */
  pause() {
    this.#last = null;
  }

  mark() {
    this.#dropped = 0;
  }

  get dropped() {
    return this.#dropped;
  }

  /** Frames a second to a tenth, or null before ten intervals are known. */
  get refresh_hz() {
    const usual = this.#median();
    return usual === null ? null : Math.round(10000 / usual) / 10;
  }

  #median() {
    if (this.#intervals.length < 10) return null;
    const sorted = [...this.#intervals].sort((a, b) => a - b);
    return sorted[Math.floor(sorted.length / 2)] ?? null;
  }
}

/** @param {number} value milliseconds, to a microsecond */
function thousandth(value) {
  return Math.round(value * 1000) / 1000;
}
