// @ts-check
// The entry page: the button is never disabled; without the tick it moves to the tick and says why.

import { browserName, deviceClass } from "../lib/device.js";
import { find } from "../lib/dom.js";

/** @type {HTMLFormElement} */
const form = find("#consent");
/** @type {HTMLInputElement} */
const tick = find("[name=read]", form);
const why = find("#why", form);

form.noValidate = true;

form.addEventListener("submit", (event) => {
  const button = /** @type {HTMLButtonElement | null} */ (event.submitter);
  if (button?.value === "no" || tick.checked) return report();
  event.preventDefault();
  why.textContent = "Please tick this box first.";
  tick.setAttribute("aria-invalid", "true");
  tick.focus();
});

tick.addEventListener("change", () => {
  why.textContent = "";
  tick.removeAttribute("aria-invalid");
});

/** Fills in what the browser says about itself. */
function report() {
  const { userAgent, maxTouchPoints } = navigator;
  const coarse = matchMedia("(pointer: coarse)").matches;
  const shortSide = Math.min(screen.width, screen.height);
  set("device", deviceClass({ userAgent, maxTouchPoints, coarse, shortSide }));
  set("browser", browserName(userAgent));
  set("viewport", `${innerWidth}x${innerHeight}`);
}

/**
 * @param {string} name
 * @param {string} value
 */
function set(name, value) {
  /** @type {HTMLInputElement} */ (find(`[name=${name}]`, form)).value = value;
}
