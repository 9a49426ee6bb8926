// @ts-check
// Whether the person can see the board and answer: the page may be hidden, covered, or gone on elsewhere.

/** @typedef {"hidden" | "covered" | "elsewhere"} Absence */

/**
 * Reasons to hold; `hold` fires when the first one comes, `release` when the last one goes.
 */
export class Attention extends EventTarget {
  /** @type {Set<Absence>} */ #reasons = new Set();

  get held() {
    return this.#reasons.size > 0;
  }

  /** @param {Absence} reason */
  hold(reason) {
    if (this.#reasons.has(reason)) return;
    this.#reasons.add(reason);
    this.dispatchEvent(new CustomEvent("hold", { detail: reason }));
  }

  /** @param {Absence} reason */
  release(reason) {
    if (this.#reasons.delete(reason) && !this.held) this.dispatchEvent(new Event("release"));
  }

  /**
   * @param {Absence} reason
   * @param {boolean} present
   */
  set(reason, present) {
    if (present) this.hold(reason);
    else this.release(reason);
  }

  /**
   * Follows the page's visibility.
   * @param {Document} page
   */
  watch(page) {
    const look = () => this.set("hidden", page.visibilityState === "hidden");
    page.addEventListener("visibilitychange", look);
    look();
    return this;
  }
}
