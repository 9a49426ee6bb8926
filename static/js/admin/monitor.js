// @ts-check
/** Keeps the counts of the monitor fresh: asks for the same page and puts its counts in the place of the old ones. */
import { offerCopies } from "./copy.js";

const EVERY_MS = 5000;
offerCopies(document);
setInterval(() => {
  if (!document.hidden) refresh().catch(() => say("Not refreshed: no connection"));
}, EVERY_MS);

async function refresh() {
  const response = await fetch(location.href, { headers: { accept: "text/html" }, redirect: "manual" });
  if (response.type === "opaqueredirect") {
    say("Signed out: reload to sign in");
    return;
  }
  if (!response.ok) throw new Error(String(response.status));
  const page = new DOMParser().parseFromString(await response.text(), "text/html");
  const now = document.querySelector("[data-live]");
  const fresh = page.querySelector("[data-live]");
  if (!now || !fresh) return;
  if (!now.contains(document.activeElement)) now.replaceWith(fresh); // nobody loses the focus
  say(page.querySelector("[data-updated]")?.textContent ?? "");
}

/** @param {string} text */
function say(text) {
  const place = document.querySelector("[data-updated]");
  if (place) place.textContent = text;
}
