// @ts-check
// Requests that do not give up: a lost connection or a busy server is waited out, everything else is an answer.

/** @typedef {{ status: number, body: any }} Answer */
/** @typedef {{ fetch: typeof globalThis.fetch, wait: (ms: number, signal: AbortSignal) => Promise<void>, timeout: (ms: number) => AbortSignal }} Seams */

/** Back-off, then every ten seconds for ever: a participant may walk through a tunnel. */
export const DELAYS_MS = [500, 1000, 2000, 4000, 8000, 10000];

/** A request that takes longer is given up and sent again; the server makes that harmless. */
export const PATIENCE_MS = 15000;

/** @type {Seams} */
const BROWSER = {
  fetch: (input, init) => globalThis.fetch(input, init),
  wait: (ms, signal) =>
    new Promise((resolve) => {
      setTimeout(resolve, ms);
      signal.addEventListener("abort", () => resolve(), { once: true });
    }),
  timeout: (ms) => AbortSignal.timeout(ms),
};

/**
 * Fires `lost` (detail: { attempt, delay_ms }) each time a request failed, `found` when one got through again.
 */
export class Transport extends EventTarget {
  /** @type {AbortController | null} */ #nap = null;

  /** @param {Partial<Seams>} [seams] */
  constructor(seams = {}) {
    super();
    /** @type {Seams} */ this.seams = { ...BROWSER, ...seams };
  }

  /** Tries again now, if it is waiting to. */
  hurry() {
    this.#nap?.abort();
  }

  /**
   * POSTs JSON until an answer comes that more trying would not change.
   * @param {string} url
   * @param {unknown} body
   * @returns {Promise<Answer>} any status below 500 except 408 and 429
   */
  async post(url, body) {
    for (let attempt = 0; ; attempt += 1) {
      const answer = await this.#try(url, JSON.stringify(body));
      if (answer) {
        if (attempt > 0) this.dispatchEvent(new Event("found"));
        return answer;
      }
      const delay_ms = DELAYS_MS[Math.min(attempt, DELAYS_MS.length - 1)] ?? 10000;
      this.dispatchEvent(new CustomEvent("lost", { detail: { attempt, delay_ms } }));
      this.#nap = new AbortController();
      await this.seams.wait(delay_ms, this.#nap.signal);
      this.#nap = null;
    }
  }

  /**
   * @param {string} url
   * @param {string} body
   * @returns {Promise<Answer | null>} null: worth trying again
   */
  async #try(url, body) {
    try {
      const response = await this.seams.fetch(url, {
        method: "POST",
        body,
        headers: { "content-type": "application/json", accept: "application/json" },
        credentials: "same-origin",
        cache: "no-store",
        signal: this.seams.timeout(PATIENCE_MS),
      });
      if (response.status >= 500 || response.status === 408 || response.status === 429) return null;
      return { status: response.status, body: await response.json().catch(() => null) };
    } catch {
      return null;
    }
  }
}
