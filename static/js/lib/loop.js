// @ts-check
// Pictures one after the other, again and again, until paused. The timers come in, so that a fake clock can test it.

/** @template Picture @typedef {{ picture: Picture, ms: number }} Frame */

/** @type {{ set: (callback: () => void, ms: number) => any, clear: (timer: any) => void }} */
const BROWSER = { set: (callback, ms) => setTimeout(callback, ms), clear: (timer) => clearTimeout(timer) };

/** @template Picture */
export class Loop {
  #at = 0;
  /** @type {any} */ #timer = null;

  /**
   * Draws the first picture at once.
   * @param {Frame<Picture>[]} frames at least one
   * @param {(picture: Picture) => void} draw
   * @param {typeof BROWSER} [timers]
   */
  constructor(frames, draw, timers = BROWSER) {
    this.frames = frames;
    this.draw = draw;
    this.timers = timers;
    draw(this.#frame.picture);
  }

  get playing() {
    return this.#timer !== null;
  }

  get #frame() {
    return /** @type {Frame<Picture>} */ (this.frames[this.#at]);
  }

  play() {
    if (!this.playing) this.#wait();
  }

  /** Stops at the picture that is there. */
  pause() {
    this.timers.clear(this.#timer);
    this.#timer = null;
  }

  #wait() {
    this.#timer = this.timers.set(() => {
      this.#at = (this.#at + 1) % this.frames.length;
      this.draw(this.#frame.picture);
      this.#wait();
    }, this.#frame.ms);
  }
}
