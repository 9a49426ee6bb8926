// @ts-check
// The end: a code to copy, and a way back that also goes by itself.

import { el, find } from "../lib/dom.js";

const BACK_IN_S = 20;

const copy = find("#copy");

copy.addEventListener("click", async () => {
  const code = find("#code");
  try {
    await navigator.clipboard.writeText(code.textContent ?? "");
    copy.textContent = "Copied";
  } catch {
    // No clipboard (http, or forbidden): mark the code, so that the person can copy it.
    getSelection()?.selectAllChildren(code);
    copy.textContent = "Press Ctrl+C";
  }
});

const way = document.querySelector("#return");
if (way?.hasAttribute("data-by-itself")) countDown(/** @type {HTMLElement} */ (way));

/** @param {HTMLElement} link */
function countDown(link) {
  let left = BACK_IN_S;
  const seconds = el("span", { class: "tnum", "aria-live": "off" }, String(left));
  const stay = el("button", { class: "link", type: "button" }, "Stay on this page");
  const going = find("#going");
  going.replaceChildren("You will be taken back in ", seconds, " seconds. ", stay);
  const timer = setInterval(() => {
    left -= 1;
    seconds.textContent = String(left);
    if (left > 0) return;
    clearInterval(timer);
    if (link instanceof HTMLFormElement) link.requestSubmit();
    else link.click();
  }, 1000);
  stay.addEventListener("click", () => {
    clearInterval(timer);
    going.replaceChildren("Use the button when you are ready.");
  });
}
