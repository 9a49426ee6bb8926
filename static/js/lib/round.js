// @ts-check
// What the two plugins share: the stage with its board, the loop of show → decide → show, and the end of a round.

import { Attention } from "./attention.js";
import { browserClock, FrameMeter } from "./clock.js";
import { el } from "./dom.js";
import { Responder } from "./responder.js";
import { confirmation, newStrip, sayIn } from "./strip.js";
import { onward, prompt, result } from "./words.js";

/** @import { Brought, Decide, Message, RoundView } from "./types.js" */
/** @import { KeyName } from "./keys.js" */
/** @import { Decision } from "./responder.js" */

/**
 * @template {RoundView} [View=RoundView]
 * @typedef {object} RoundParameters
 * @property {View & Brought} view
 * @property {Decide<View>} decide
 * @property {((message: Message) => void) | null} say
 * @property {((view: View) => Promise<void>) | null} proceed
 * @property {((view: View) => void) | null} shown
 * @property {(() => Attention) | null} attention
 */

/**
 * @template {RoundView} View
 * @typedef {object} Play
 * @property {(view: View) => void} draw writes the view on the page; called inside a frame
 * @property {(view: View) => Partial<Record<KeyName, number>>} keys
 * @property {(action: number) => void} taken a decision was made: keys go flat, nothing else changes
 */

/** @type {Attention | undefined} */ let own;

/** For experiments that bring no attention of their own: the page's visibility. */
function ownAttention() {
  own ??= new Attention().watch(document);
  return own;
}

/** There is one display, whatever the number of rounds. */
const display_frames = new FrameMeter();

export class Round {
  /** @type {Decision[]} */ decisions = [];
  #board = el("div", { class: "board-wrap" });

  /**
   * @param {HTMLElement} display
   * @param {RoundParameters<any>} parameters
   */
  constructor(display, parameters) {
    this.display = display;
    this.parameters = parameters;
    this.attention = parameters.attention?.() ?? ownAttention();
    const strip = parameters.say ? null : newStrip();
    this.say = parameters.say ?? sayIn(/** @type {HTMLElement} */ (strip));
    this.strip = strip;
    this.responder = new Responder({
      clock: browserClock,
      attention: this.attention,
      page: document,
      frames: display_frames,
      boardPx: () => Math.round(this.#board.getBoundingClientRect().width),
    });
  }

  /** An on-screen key was pressed. */
  press = (/** @type {number} */ action, /** @type {MouseEvent} */ event) => this.responder.press(action, event);

  /**
   * Puts board and panel in their places; nothing moves afterwards.
   * @param {string} classes
   * @param {...HTMLElement} parts
   */
  lay(classes, ...parts) {
    const stage = el("div", { class: "stage" }, this.#board, el("div", { class: classes }, ...parts));
    this.display.replaceChildren(stage, ...(this.strip ? [this.strip] : []));
  }

  /** @param {Element} board */
  paint(board) {
    this.#board.replaceChildren(board);
  }

  /** @param {() => void} write */
  async show(write) {
    await this.#present();
    return this.responder.show(write);
  }

  /**
   * Asks for decision after decision until the round is over.
   * @template {RoundView} View
   * @param {View & Brought} first
   * @param {Play<View>} how
   * @returns {Promise<View | null>} null: this page has no part in the round any more
   */
  async play(first, { draw, keys, taken }) {
    let view = first;
    while (!view.over) {
      const decision = await this.responder.ask({
        write: () => {
          draw(view);
          // After the frame: what is noted about the picture must not delay it.
          setTimeout(() => this.parameters.shown?.(view));
        },
        keys: keys(view),
        resumed: view.resumed ?? false,
      });
      taken(decision.action);
      this.decisions.push(decision);
      const next = await this.parameters.decide(decision.action, decision.timing, view);
      if (!next || next.round !== view.round) return null;
      view = next;
    }
    if (view.role !== "child") await this.show(() => draw(view));
    return view;
  }

  /**
   * What the strip says while the view is on screen.
   * @param {RoundView & Brought} view
   */
  tell(view) {
    this.say(view.over ? result(view) : (view.notice ?? prompt(view)));
  }

  /**
   * Says how it ended and waits for Space or a click.
   * @param {RoundView | null} view
   */
  async finish(view) {
    this.responder.close();
    if (!view) return;
    await confirmation(this.say, result(view), onward(view), this.attention);
    await this.parameters.proceed?.(view);
  }

  /** @param {number} ms */
  async pause(ms) {
    await new Promise((resolve) => setTimeout(resolve, ms));
  }

  /** Waits until the person can see the board. */
  async #present() {
    if (!this.attention.held) return;
    await new Promise((resolve) => this.attention.addEventListener("release", resolve, { once: true }));
  }
}
