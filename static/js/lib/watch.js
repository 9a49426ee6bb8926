// @ts-check
// Joins the window's events to its log. Batches go soon after loading, every few seconds, and when the page is left.

import { visitName, WindowLog } from "./windowlog.js";

/** @import { Batch, Kind } from "./windowlog.js" */

const SOON_MS = 500;
const EVERY_MS = 5000;
const SETTLED_MS = 300; // a window that is being dragged has many sizes; the one it keeps counts

/**
 * @param {{ events_url: string, page: string }} where
 * @param {Window} [view]
 * @returns {WindowLog} to be flushed where the session may end: after the end the server keeps nothing
 */
export function watchWindow({ events_url, page }, view = window) {
  const log = new WindowLog({
    page,
    visit: visitName(),
    now: () => performance.now(),
    send: (batch, keepalive) => post(events_url, batch, keepalive),
  });
  const size = () => `${view.innerWidth}x${view.innerHeight}`;
  log.note("loaded", size());
  listen(view, log, size);
  setTimeout(() => void log.flush(), SOON_MS);
  setInterval(() => void log.flush(), EVERY_MS);
  return log;
}

/**
 * @param {Window} view
 * @param {WindowLog} log
 * @param {() => string} size
 */
function listen(view, log, size) {
  const page = view.document;
  for (const kind of /** @type {Kind[]} */ (["focus", "blur"])) view.addEventListener(kind, () => log.note(kind));
  page.addEventListener("visibilitychange", () => {
    log.note(page.visibilityState === "hidden" ? "hidden" : "visible");
    if (page.visibilityState === "hidden") log.leave();
  });
  page.addEventListener("fullscreenchange", () => log.note(page.fullscreenElement ? "fullscreen" : "windowed", size()));
  /** @type {ReturnType<typeof setTimeout> | undefined} */ let settling;
  view.addEventListener("resize", () => {
    clearTimeout(settling);
    settling = setTimeout(() => log.note("resize", size()), SETTLED_MS);
  });
  view.addEventListener("pagehide", () => log.leave());
}

/**
 * @param {string} url
 * @param {Batch} batch
 * @param {boolean} keepalive
 */
async function post(url, batch, keepalive) {
  const response = await fetch(url, {
    method: "POST",
    body: JSON.stringify(batch),
    headers: { "content-type": "application/json" },
    credentials: "same-origin",
    keepalive,
  });
  return response.status < 500 && response.status !== 408 && response.status !== 429;
}
