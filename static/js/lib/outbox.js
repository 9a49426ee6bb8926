// @ts-check
// The one action that the server has not confirmed yet. It survives a reload, so that nothing is lost; it is sent again
// byte for byte, so that nothing is doubled (the server answers the same body with the same answer).

/** @typedef {{ round: number, seq: number, action: number, timing: object }} Step */

export class Outbox {
  /**
   * @param {string} name one outbox a session
   * @param {Pick<Storage, "getItem" | "setItem" | "removeItem"> | null} storage null where the browser forbids it
   */
  constructor(name, storage) {
    this.key = `hatlab:outbox:${name}`;
    this.storage = storage;
    /** @type {Step | null} */ this.kept = null;
  }

  /** @param {Step} step */
  put(step) {
    this.kept = step;
    try {
      this.storage?.setItem(this.key, JSON.stringify(step));
    } catch {
      // Storage full or forbidden: the copy in memory still covers everything but a reload.
    }
  }

  /** @returns {Step | null} */
  get() {
    if (this.kept) return this.kept;
    try {
      return JSON.parse(this.storage?.getItem(this.key) ?? "null");
    } catch {
      return null;
    }
  }

  clear() {
    this.kept = null;
    try {
      this.storage?.removeItem(this.key);
    } catch {
      // As above.
    }
  }
}

/**
 * The page's storage, or null where reading it throws (blocked third-party frames).
 * @returns {Storage | null}
 */
export function pageStorage() {
  try {
    return globalThis.localStorage;
  } catch {
    return null;
  }
}
