// @ts-check
// The rounds of one page: asks the server for the round, sends each decision until it has arrived, and says what is
// going on. Knows nothing about boards.

import { NOTICES } from "./words.js";

/** @import { Brought, Message, RoundView, Timing } from "./types.js" */
/** @import { Outbox, Step } from "./outbox.js" */
/** @import { Transport, Answer } from "./transport.js" */

/** How long an answer may take before the strip says so. */
export const QUIET_MS = 700;

/**
 * @typedef {object} Seams
 * @property {{ round: string, step: string, page: string }} urls
 * @property {Transport} transport
 * @property {Outbox} outbox
 * @property {Pick<Storage, "getItem" | "setItem"> | null} storage
 * @property {(message: Message) => void} say
 * @property {(url: string) => void} leave goes to another page
 */

export class Session {
  #lost = false;
  #flushed = false;
  /** @type {import("./types.js").Roads | undefined} */ #roads;

  /** @param {Seams} seams */
  constructor(seams) {
    this.seams = seams;
    seams.transport.addEventListener("lost", () => {
      this.#lost = true;
    });
  }

  /**
   * The round to play; an action that a reload left behind is sent first.
   * @param {number | null} after the round that was just finished, null on a fresh page: then the last one that was
   *   left, because a page of questions may have come in between
   * @returns {Promise<(RoundView & Brought) | null>} null: the page is being left
   */
  async open(after) {
    if (!this.#flushed) await this.#flush();
    this.#flushed = true;
    if (after !== null) this.#keep(this.#leftKey, String(after));
    const answer = await this.#post(this.seams.urls.round, { after: after ?? this.#left() });
    const view = this.#viewOf(answer);
    return view && this.#brought(view, after === null && this.#wasSeen(view));
  }

  /**
   * Sends a decision and brings what follows from it; the same view twice if another tab was faster.
   * @param {RoundView} view the view that was decided about
   * @param {number} action
   * @param {Timing} timing
   * @returns {Promise<(RoundView & Brought) | null>} null: the page is being left
   */
  async decide(view, action, timing) {
    const step = { round: view.round, seq: view.seq + 1, action, timing };
    this.seams.outbox.put(step);
    const answer = await this.#post(this.seams.urls.step, step);
    this.seams.outbox.clear();
    const next = this.#viewOf(answer);
    if (!next || answer.status === 200) return next && this.#brought(next, false);
    return { ...this.#brought(next, true), notice: NOTICES.moved_on };
  }

  /** @param {RoundView} view The picture is on screen: a reload from here on is a second look. */
  shown(view) {
    this.#keep(this.#seenKey, `${view.round}:${view.seq}`);
  }

  /**
   * @param {string} key
   * @param {string} value
   */
  #keep(key, value) {
    try {
      this.seams.storage?.setItem(key, value);
    } catch {
      // Storage forbidden: the server still knows which round is open.
    }
  }

  /** The last round whose end the person has left. */
  #left() {
    try {
      const kept = this.seams.storage?.getItem(this.#leftKey) ?? "";
      return /^\d{1,6}$/.test(kept) ? Number(kept) : null;
    } catch {
      return null;
    }
  }

  get #leftKey() {
    return `hatlab:left:${this.seams.urls.page}`;
  }

  get #seenKey() {
    return `hatlab:seen:${this.seams.urls.page}`;
  }

  /** @param {RoundView} view */
  #wasSeen(view) {
    if (view.seq > 0) return true;
    try {
      return this.seams.storage?.getItem(this.#seenKey) === `${view.round}:${view.seq}`;
    } catch {
      return false;
    }
  }

  /** Sends the action that a reload left behind; whatever the answer, the server now knows more than we do. */
  async #flush() {
    const step = this.seams.outbox.get();
    if (step) await this.#post(this.seams.urls.step, step);
    this.seams.outbox.clear();
  }

  /**
   * @param {string} url
   * @param {unknown} body
   */
  async #post(url, body) {
    this.#lost = false;
    const timer = setTimeout(() => !this.#lost && this.seams.say(NOTICES.waiting), QUIET_MS);
    try {
      return await this.seams.transport.post(url, body);
    } finally {
      clearTimeout(timer);
    }
  }

  /**
   * @param {Answer} answer
   * @returns {RoundView | null} null: the server showed us another page, or refused
   */
  #viewOf({ status, body }) {
    const view = status === 409 ? body?.view : body;
    if ((status === 200 || status === 409) && view?.role) return view;
    if (status === 200 && body?.page) this.seams.leave(body.page);
    else this.#refuse();
    return null;
  }

  #refuse() {
    const press = () => this.seams.leave(this.seams.urls.page);
    this.seams.say({ ...NOTICES.refused, button: { label: "Load again", primary: true, press } });
  }

  /**
   * @param {RoundView} view
   * @param {boolean} resumed
   * @returns {RoundView & Brought}
   */
  #brought(view, resumed) {
    if (view.role === "driver") {
      this.#roads = view.roads ?? this.#roads;
      return { ...view, ...(this.#roads ? { roads: this.#roads } : {}), resumed: resumed || this.#lost };
    }
    return { ...view, resumed: resumed || this.#lost };
  }
}
