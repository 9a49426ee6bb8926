// @ts-check
// Full screen, offered and never demanded. A browser leaves it whenever a page follows another one, so the wish is
// remembered in the tab and fulfilled again between two rounds, never in the middle of one.

const WISH = "hatlab:full-screen";
const SOON_MS = 500;

/**
 * @typedef {object} Seams
 * @property {Document} page
 * @property {Pick<Storage, "getItem" | "setItem" | "removeItem"> | null} storage of the tab; null where it is forbidden
 */

export class FullScreen {
  /** @param {Seams} seams */
  constructor({ page, storage }) {
    this.page = page;
    this.storage = storage;
  }

  /** Whether this browser offers it (a frame of another site may not). */
  get offered() {
    return this.page.fullscreenEnabled === true;
  }

  get on() {
    return this.page.fullscreenElement !== null;
  }

  get wished() {
    try {
      return this.storage?.getItem(WISH) === "yes";
    } catch {
      return false;
    }
  }

  /** @param {boolean} wish */
  #wish(wish) {
    try {
      if (wish) this.storage?.setItem(WISH, "yes");
      else this.storage?.removeItem(WISH);
    } catch {
      // Without storage the wish ends with the page.
    }
  }

  /** The button was pressed. */
  async toggle() {
    this.#wish(!this.on);
    if (this.on) await this.page.exitFullscreen().catch(() => {});
    else await this.#enter();
  }

  /** Fulfils an earlier wish; called where a key or a click has just come. */
  async renew() {
    if (this.offered && this.wished && !this.on) await this.#enter();
  }

  async #enter() {
    await this.page.documentElement.requestFullscreen({ navigationUI: "hide" }).catch(() => {});
  }

  /**
   * Keeps a button's word right; whoever leaves by Escape no longer wishes it. A page that is left is not asked.
   * @param {HTMLElement} button
   */
  attach(button) {
    if (!this.offered) return;
    button.hidden = false;
    button.addEventListener("click", () => void this.toggle());
    this.page.addEventListener("fullscreenchange", () => {
      button.textContent = this.on ? "Leave full screen" : "Full screen";
      if (!this.on) setTimeout(() => this.on || this.#wish(false), SOON_MS);
    });
  }
}

/** The tab's storage, or null where reading it throws. */
export function tabStorage() {
  try {
    return globalThis.sessionStorage;
  } catch {
    return null;
  }
}
