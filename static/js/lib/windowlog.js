// @ts-check
// What happens to the window (focus, visibility, size, full screen), sent in batches. It is kept, never punished; it
// never holds anything up, and what cannot be sent after a few tries is let go. The server keeps what comes twice once.

/** @typedef {"focus" | "blur" | "visible" | "hidden" | "resize" | "fullscreen" | "windowed" | "loaded"} Kind */
/** @typedef {{ seq: number, kind: Kind, value: string, at_ms: number }} Happened */
/** @typedef {{ visit: string, page: string, events: Happened[] }} Batch */

/** The server takes so many at once. */
export const BATCH = 100;
/** A window that reports more than this in one visit says nothing new. */
export const MOST = 1000;
export const TRIES = 3;

export class WindowLog {
  /** @type {Happened[]} */ #waiting = [];
  #seq = 0;
  #failed = 0;
  #sending = false;

  /**
   * @param {object} seams
   * @param {string} seams.page
   * @param {string} seams.visit random, so that two visits to a page are told apart
   * @param {() => number} seams.now milliseconds since the page was loaded
   * @param {(batch: Batch, keepalive: boolean) => Promise<boolean>} seams.send whether it has arrived
   */
  constructor({ page, visit, now, send }) {
    this.page = page;
    this.visit = visit;
    this.now = now;
    this.send = send;
  }

  get waiting() {
    return this.#waiting.length;
  }

  /**
   * @param {Kind} kind
   * @param {string} [value]
   */
  note(kind, value = "") {
    if (this.#seq >= MOST) return;
    this.#waiting.push({ seq: this.#seq, kind, value, at_ms: Math.round(this.now() * 1000) / 1000 });
    this.#seq += 1;
  }

  /** Sends what is waiting, unless a batch is on its way. */
  async flush() {
    if (this.#sending || this.#waiting.length === 0) return;
    this.#sending = true;
    const batch = this.#waiting.slice(0, BATCH);
    const arrived = await this.#send(batch, false);
    this.#sending = false;
    this.#failed = arrived ? 0 : this.#failed + 1;
    if (arrived || this.#failed >= TRIES) this.#drop(batch);
    if (this.#failed >= TRIES) this.#failed = 0;
  }

  /** The page is being left: everything goes now, also what is on its way and may not arrive. */
  leave() {
    const batch = this.#waiting.slice(-BATCH);
    if (batch.length > 0) void this.#send(batch, true);
  }

  /**
   * @param {Happened[]} events
   * @param {boolean} keepalive
   */
  async #send(events, keepalive) {
    try {
      return await this.send({ visit: this.visit, page: this.page, events }, keepalive);
    } catch {
      return false;
    }
  }

  /** @param {Happened[]} batch */
  #drop(batch) {
    const last = batch.at(-1)?.seq ?? -1;
    this.#waiting = this.#waiting.filter(({ seq }) => seq > last);
  }
}

/** A name for one visit; `crypto.randomUUID` is missing on plain http. */
export function visitName(crypto = globalThis.crypto) {
  const bytes = crypto.getRandomValues(new Uint8Array(12));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
