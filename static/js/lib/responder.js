// @ts-check
// One decision at a time: writes the picture in a frame, then waits for an allowed key or button.
// Everything it needs from the browser comes in, so that a fake clock and a fake page can test it.

import { FrameMeter, Stopwatch } from "./clock.js";
import { keyName } from "./keys.js";

/** @import { Clock, Timing } from "./types.js" */
/** @import { Attention } from "./attention.js" */
/** @import { KeyName } from "./keys.js" */

/**
 * @typedef {object} Question
 * @property {() => void} write puts the picture on the page; runs inside an animation frame, and again after an interruption
 * @property {Partial<Record<KeyName, number>>} keys the actions that keys stand for
 * @property {boolean} [resumed]
 */

/** @typedef {{ action: number, timing: Timing }} Decision */

export class Responder {
  #watch = new Stopwatch();
  #frames;
  /** @type {Question | null} */ #question = null;
  /** @type {((decision: Decision) => void) | null} */ #resolve = null;
  /** @type {Partial<Record<KeyName, number>>} */ #keys = {};
  #counting = true;
  #shows = 0;

  /**
   * @param {{ clock: Clock, attention: Attention, page: EventTarget, boardPx: () => number, frames?: FrameMeter }} seams
   *   frames: one for the page, so that a new round knows the refresh rate at once
   */
  constructor({ clock, attention, page, boardPx, frames = new FrameMeter() }) {
    this.clock = clock;
    this.attention = attention;
    this.page = page;
    this.boardPx = boardPx;
    this.#frames = frames;
    this.page.addEventListener("keydown", this.#onKey);
    this.attention.addEventListener("hold", this.#onHold);
    this.attention.addEventListener("release", this.#onRelease);
    this.clock.frame(this.#onFrame);
  }

  /** The round is over for this page: nothing is listened to any more. */
  close() {
    this.#counting = false;
    this.#frames.pause();
    this.#question = null;
    this.page.removeEventListener("keydown", this.#onKey);
    this.attention.removeEventListener("hold", this.#onHold);
    this.attention.removeEventListener("release", this.#onRelease);
  }

  /**
   * Shows the picture and waits for the decision about it.
   * @param {Question} question
   * @returns {Promise<Decision>}
   */
  ask(question) {
    this.#question = question;
    this.#keys = question.keys;
    this.#watch.begin({ resumed: question.resumed ?? false });
    return new Promise((resolve) => {
      this.#resolve = resolve;
      if (this.attention.held) this.#watch.interrupt({ hidden: true });
      else this.#show();
    });
  }

  /**
   * Writes a picture in the next frame without asking anything.
   * @param {() => void} write
   * @returns {Promise<number>} the time of the write
   */
  show(write) {
    return new Promise((resolve) => {
      this.clock.frame(() => {
        write();
        resolve(this.clock.now());
      });
    });
  }

  /**
   * An on-screen key was pressed.
   * @param {number} action
   * @param {{ timeStamp: number, isTrusted: boolean, detail?: number }} event a click; detail 0 is one made by a key
   */
  press(action, event) {
    this.#answer(action, event, event.detail === 0 ? "key" : "click");
  }

  #show() {
    const question = this.#question;
    this.#shows += 1;
    const mine = this.#shows;
    this.clock.frame(() => {
      if (this.#question !== question || this.#shows !== mine || this.attention.held) return;
      question?.write();
      this.#frames.mark();
      this.#watch.onset(this.clock.now());
    });
  }

  /** @param {Event} event */
  #onKey = (event) => {
    const key = /** @type {KeyboardEvent} */ (event);
    const name = keyName(key);
    const action = name === null ? undefined : this.#keys[name];
    if (action === undefined) return;
    key.preventDefault(); // arrow keys scroll
    if (!key.repeat) this.#answer(action, key, "key");
  };

  /**
   * @param {number} action
   * @param {{ timeStamp: number, isTrusted: boolean }} event
   * @param {"key" | "click"} input
   */
  #answer(action, event, input) {
    const handled = this.clock.now();
    if (this.attention.held) return;
    if (this.#question === null) {
      this.#watch.early();
      return;
    }
    const times = this.#watch.respond(event.timeStamp, handled);
    if (times === null) return;
    const resolve = this.#resolve;
    this.#question = null;
    this.#resolve = null;
    resolve?.({ action, timing: this.#timing(times, event.isTrusted, input) });
  }

  /**
   * @param {NonNullable<ReturnType<Stopwatch["respond"]>>} times
   * @param {boolean} is_trusted
   * @param {"key" | "click"} input
   * @returns {Timing}
   */
  #timing(times, is_trusted, input) {
    const { refresh_hz, dropped } = this.#frames;
    return { ...times, is_trusted, refresh_hz, dropped_frames: dropped, board_px: this.boardPx(), input };
  }

  /** @param {Event} event */
  #onHold = (event) => {
    const reason = /** @type {CustomEvent} */ (event).detail;
    this.#watch.interrupt({ hidden: reason !== "elsewhere", resumed: reason === "elsewhere" });
    this.#frames.pause();
  };

  #onRelease = () => {
    if (this.#question) this.#show();
  };

  /** @param {number} time */
  #onFrame = (time) => {
    if (!this.#counting) return;
    if (!this.attention.held) this.#frames.frame(time);
    this.clock.frame(this.#onFrame);
  };
}
