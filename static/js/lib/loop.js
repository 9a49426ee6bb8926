// @ts-check
// Pictures one after the other, again and again, with a pause. Timers come in, so that a fake clock can test it.

/** @template Picture @typedef {{ picture: Picture, ms: number }} Frame */

/** @template Picture */
export class Loop {
  #at = 0;
  /** @type {unknown} */ #timer = null;

  /**
   * @param {Frame<Picture>[]} frames
   * @param {(picture: Picture) => void} draw
   * @param {{ set: (callback: () => void, ms: number) => unknown, clear: (timer: any) => void }} timers
   */
  constructor(frames, draw, timers = { set: (f, ms) => setTimeout(f, ms), clear: (timer) => clearTimeout(timer) }) {
    this.frames = frames;
    this.draw = draw;
    this.timers = timers;
    this.#show();
  }

  get playing() {
    return this.#timer !== null;
  }

  play() {
    if (this.playing) return;
    this.#wait();
  }

  /** Stops at the picture that is there. */
  pause() {
    this.timers.clear(this.#timer);
    this.#timer = null;
  }

  #wait() {
    this.#timer = this.timers.set(() => {
      this.#at = (this.#at + 1) % this.frames.length;
      this.#show();
      this.#wait();
    }, this.frames[this.#at]?.ms ?? 1000);
  }

  #show() {
    const frame = this.frames[this.#at];
    if (frame) this.draw(frame.picture);
  }
}
