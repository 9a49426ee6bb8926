// @ts-check
// The entry page: first the device shows what it can (nothing is sent), then the decision. The button is never
// disabled; without the tick it moves to the tick and says why.

import { build } from "../board/drawing.js";
import { icon } from "../board/symbols.js";
import { browserName, deviceClass } from "../lib/device.js";
import { el, find } from "../lib/dom.js";
import { Gate, lacking, told } from "../lib/gate.js";
import { keyName } from "../lib/keys.js";

/** @import { Check, Verdict } from "../lib/gate.js" */

/** @type {HTMLFormElement} */
const form = find("#consent");
/** @type {HTMLInputElement} */
const tick = find("[name=read]", form);
const why = find("#why", form);
const check = find("#check");
/** @type {HTMLButtonElement} */
const unfit = find("#unfit", check);

const device = deviceNow();
const gate = new Gate(JSON.parse(find("#gate").textContent ?? "{}"), { device, lacking: lacking(window) });
let done = false;

form.noValidate = true;

form.addEventListener("submit", (event) => {
  const button = /** @type {HTMLButtonElement | null} */ (event.submitter);
  if (button === unfit) return;
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

/** Which of the two faces is there; the other one keeps its room, so that nothing jumps. @param {boolean} open */
function face(open) {
  check.inert = !open;
  form.inert = open;
  check.classList.toggle("face-back", !open);
  form.classList.toggle("face-back", open);
}

function show() {
  if (done) return;
  if (gate.passed) return pass();
  for (const row of check.querySelectorAll("[data-check]")) {
    const name = /** @type {Check} */ (/** @type {HTMLElement} */ (row).dataset.check);
    mark(row, gate.checks[name], told(gate, name));
  }
  unfit.value = gate.reason;
}

/** @type {Record<Verdict, string>} */
const ICONS = { good: "good", open: "wait", bad: "bad" };

/**
 * @param {Element} row
 * @param {Verdict} verdict
 * @param {string} text
 */
function mark(row, verdict, text) {
  const word = find("span", row);
  if (word.textContent === text && row.className === `is-${verdict}`) return;
  row.className = `is-${verdict}`;
  word.textContent = text;
  row.querySelector("svg")?.remove();
  row.prepend(build(icon(ICONS[verdict], "icon")));
}

function pass() {
  done = true;
  const was = check.contains(document.activeElement);
  face(false);
  find("#fits").hidden = false;
  find("#check-status").textContent = "Your device fits. You can decide now.";
  if (was) tick.focus();
}

/** A phone or a tablet is told at once, and kindly; whether the site is told is up to the person. */
function turnAway() {
  find("main").classList.add("turned-away");
  find("#check-title").textContent = "This study needs a computer";
  find("#check-lead").replaceChildren(
    el("span", {}, "The game is played with a keyboard on a larger screen. A phone or a tablet cannot show it well."),
    el("span", {}, "You can open the same link on a computer and take part there."),
    el("span", {}, "Nothing about you has been sent or kept."),
  );
  find(".gate-list", check).remove();
  unfit.classList.remove("button-quiet");
  unfit.value = gate.reason;
}

function measure() {
  const step = (/** @type {number} */ time) => {
    if (done) return;
    gate.frame(time);
    show();
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
  document.addEventListener("visibilitychange", () => gate.pause());
}

function listen() {
  document.addEventListener("keydown", (event) => {
    if (done || event.repeat || !gate.key(keyName(event))) return;
    event.preventDefault(); // arrow keys scroll
    show();
  });
  const look = () => {
    gate.resize({ width: innerWidth, height: innerHeight });
    show();
  };
  addEventListener("resize", look);
  look();
}

/** Fills in what the browser says about itself. */
function report() {
  set("device", device);
  set("browser", browserName(navigator.userAgent));
  set("viewport", `${innerWidth}x${innerHeight}`);
}

function deviceNow() {
  const { userAgent, maxTouchPoints } = navigator;
  const coarse = matchMedia("(pointer: coarse)").matches;
  return deviceClass({ userAgent, maxTouchPoints, coarse, shortSide: Math.min(screen.width, screen.height) });
}

/**
 * @param {string} name
 * @param {string} value
 */
function set(name, value) {
  /** @type {HTMLInputElement} */ (find(`[name=${name}]`, form)).value = value;
}

check.hidden = false;
face(true);
if (why.textContent) {
  pass(); // sent once already: what is asked for again is the consent
} else if (gate.checks.phone === "bad") {
  turnAway();
} else {
  if (!gate.needs.keyboard) find("[data-check=keyboard]", check).remove();
  listen();
  measure();
}
