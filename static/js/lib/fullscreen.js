// @ts-check
// Full screen, offered and never demanded. A browser leaves it whenever a page follows another one, so the wish is
// remembered in the tab and fulfilled again between two rounds, never in the middle of one: the board may grow by it.

const WISH = "hatlab:full-screen";
/** Whoever leaves a page leaves full screen too, and still wishes it; that page is gone before this has passed. */
const STAYED_MS = 500;

export class FullScreen {
  /**
   * @param {Document} page
   * @param {Pick<Storage, "getItem" | "setItem" | "removeItem"> | null} storage of the tab; null where it is forbidden
   * @param {(callback: () => void, ms: number) => unknown} [later]
   */
  constructor(page, storage, later = (callback, ms) => setTimeout(callback, ms)) {
    this.page = page;
    this.storage = storage;
    page.addEventListener("fullscreenchange", () => {
      if (!this.on) later(() => this.on || this.#wish(false), STAYED_MS);
    });
  }

  /** Whether this browser can (a frame of another site may not). */
  get possible() {
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

  /** A button was pressed. */
  async toggle() {
    this.#wish(!this.on);
    if (this.on) await this.page.exitFullscreen().catch(() => {});
    else await this.#enter();
  }

  /** Fulfils an earlier wish; called where a key or a click has just come, as browsers demand. */
  async renew() {
    if (this.possible && this.wished && !this.on) await this.#enter();
  }

  /** A browser that refuses is not asked why. */
  async #enter() {
    await this.page.documentElement.requestFullscreen({ navigationUI: "hide" }).catch(() => {});
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
}

/**
 * Shows a button where full screen is possible, and keeps its word right.
 * @param {HTMLElement} button
 * @param {FullScreen} fullScreen
 */
export function offerFullScreen(button, fullScreen) {
  if (!fullScreen.possible) return;
  button.hidden = false;
  button.addEventListener("click", () => void fullScreen.toggle());
  fullScreen.page.addEventListener("fullscreenchange", () => {
    button.textContent = fullScreen.on ? "Leave full screen" : "Full screen";
  });
}
