// @ts-check
// Joins the window's events to its log: `watchWindow(eventsUrl, page)`, once, on any page of a session.

import { visitName, WindowLog } from "./windowlog.js";

/** @import { Batch, Kind } from "./windowlog.js" */

const SETTLED_MS = 300; // a window that is being dragged has many sizes; the one it keeps counts

/**
 * Logs what happens to this window until it is left. A page that is loaded without focus or in the background says so.
 * @param {string} eventsUrl
 * @param {string} page the page's name in the journey, such as "play:1"
 * @returns {WindowLog} `leave` it where the session may end: after the end the server keeps nothing
 */
export function watchWindow(eventsUrl, page) {
  const log = new WindowLog({
    page,
    visit: visitName(),
    now: () => performance.now(),
    later: (callback, ms) => setTimeout(callback, ms),
    send: (batch, leaving) => post(eventsUrl, batch, leaving),
  });
  log.note("loaded", size());
  if (document.visibilityState === "hidden") log.note("hidden");
  if (!document.hasFocus()) log.note("blur");
  listen(log);
  return log;
}

/** @param {WindowLog} log */
function listen(log) {
  for (const kind of /** @type {Kind[]} */ (["focus", "blur"])) window.addEventListener(kind, () => log.note(kind));
  document.addEventListener("visibilitychange", () => {
    const hidden = document.visibilityState === "hidden";
    log.note(hidden ? "hidden" : "visible");
    if (hidden) void log.leave(); // a phone or a killed tab says no more than this
  });
  document.addEventListener("fullscreenchange", () => log.note(document.fullscreenElement ? "fullscreen" : "windowed"));
  window.addEventListener("pagehide", () => void log.leave());
  /** @type {ReturnType<typeof setTimeout> | undefined} */ let settling;
  window.addEventListener("resize", () => {
    clearTimeout(settling);
    settling = setTimeout(() => log.note("resize", size()), SETTLED_MS);
  });
}

function size() {
  return `${window.innerWidth}x${window.innerHeight}`;
}

/**
 * @param {string} url
 * @param {Batch} batch
 * @param {boolean} leaving the request outlives the page
 */
async function post(url, batch, leaving) {
  const response = await fetch(url, {
    method: "POST",
    body: JSON.stringify(batch),
    headers: { "content-type": "application/json" },
    credentials: "same-origin",
    priority: "low",
    keepalive: leaving,
  });
  return response.status < 500 && response.status !== 408 && response.status !== 429;
}
