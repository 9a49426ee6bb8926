// @ts-check
// The same session in two tabs: the newest goes on, the older ones say so and stop.

/** @typedef {{ postMessage(message: unknown): void, onmessage: ((event: MessageEvent) => void) | null }} Channel */

/**
 * @param {string} name of the session
 * @returns {Channel | null} null where there is none (old browsers, sandboxed frames); the server's 409 still decides
 */
export function openChannel(name) {
  try {
    return new BroadcastChannel(`hatlab:${name}`);
  } catch {
    return null;
  }
}

/**
 * Announces this tab, and calls `left` whenever a newer one does the same.
 * @param {Channel | null} channel
 * @param {() => void} left
 * @returns {() => void} announces this tab again: "continue here"
 */
export function takeTurn(channel, left) {
  if (!channel) return () => {};
  channel.onmessage = ({ data }) => {
    if (data === "mine") left();
  };
  channel.postMessage("mine");
  return () => channel.postMessage("mine");
}
