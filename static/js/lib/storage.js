// @ts-check
// Where a page keeps what must survive a reload of its own tab, and nothing else.

/** @returns {Storage | null} null: the browser forbids it (a frame without storage) */
export function tabStorage() {
  try {
    return globalThis.sessionStorage;
  } catch {
    return null;
  }
}
