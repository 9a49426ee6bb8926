// @ts-check
// What happens to the window (focus, visibility, size, full screen), sent in batches. It is kept, never punished; it
// never holds anything up, and what does not get through after a few tries is let go. What comes twice is kept once.
// Pure: clock, timer and network come in.

/** @typedef {"focus" | "blur" | "visible" | "hidden" | "resize" | "fullscreen" | "windowed" | "loaded"} Kind */
/** @typedef {{ seq: number, kind: Kind, value: string, at_ms: number }} Happened */
/** @typedef {{ visit: string, page: string, events: Happened[] }} Batch */

/** Well below what the server takes at once (server/web/schemas.py: 200), and what a page may send while it is left. */
export const BATCH = 100;
/** A window that reports more than this in one visit says nothing new; the server keeps twice as many. */
export const MOST = 1000;
export const TRIES = 3;
export const EVERY_MS = 5000;

export class WindowLog {
  /** @type {Happened[]} */ #waiting = [];
  #seq = 0;
  #failed = 0;
  #due = false;

  /**
   * @param {object} seams
   * @param {string} seams.page
   * @param {string} seams.visit random, so that two visits to a page are told apart
   * @param {() => number} seams.now milliseconds since the page was loaded
   * @param {(callback: () => void, ms: number) => unknown} seams.later
   * @param {(batch: Batch, leaving: boolean) => Promise<boolean>} seams.send whether more trying would change nothing
   */
  constructor({ page, visit, now, later, send }) {
    this.page = page;
    this.visit = visit;
    this.now = now;
    this.later = later;
    this.send = send;
  }

  /**
   * @param {Kind} kind
   * @param {string} [value]
   */
  note(kind, value = "") {
    if (this.#seq >= MOST) return;
    this.#waiting.push({ seq: this.#seq, kind, value, at_ms: Math.round(this.now() * 1000) / 1000 });
    this.#seq += 1;
    this.#plan();
  }

  /** The page is being left, or may be: everything goes now, also what is on its way and may not arrive. */
  async leave() {
    const batches = [];
    for (let from = 0; from < this.#waiting.length; from += BATCH)
      batches.push(this.#waiting.slice(from, from + BATCH));
    await Promise.all(batches.map(async (batch) => (await this.#try(batch, true)) && this.#drop(batch)));
  }

  /** One batch after a while: an idle page sends nothing. */
  #plan() {
    if (this.#due || this.#waiting.length === 0) return;
    this.#due = true;
    this.later(() => void this.#flush(), EVERY_MS);
  }

  async #flush() {
    const batch = this.#waiting.slice(0, BATCH);
    const arrived = batch.length === 0 || (await this.#try(batch, false));
    this.#failed = arrived ? 0 : this.#failed + 1;
    if (arrived || this.#failed === TRIES) this.#drop(batch);
    this.#failed %= TRIES;
    this.#due = false;
    this.#plan();
  }

  /**
   * @param {Happened[]} events
   * @param {boolean} leaving
   */
  async #try(events, leaving) {
    try {
      return await this.send({ visit: this.visit, page: this.page, events }, leaving);
    } catch {
      return false;
    }
  }

  /** @param {Happened[]} batch */
  #drop(batch) {
    const gone = new Set(batch.map(({ seq }) => seq));
    this.#waiting = this.#waiting.filter(({ seq }) => !gone.has(seq));
  }
}

/** A name for one visit; `crypto.randomUUID` is missing on plain http. */
export function visitName(crypto = globalThis.crypto) {
  const bytes = crypto.getRandomValues(new Uint8Array(12));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
