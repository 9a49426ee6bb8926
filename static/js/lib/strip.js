// @ts-check
// The strip below the board: prompts, waits, errors and results appear here and nowhere else. Always 56 px high.

import { build } from "../board/drawing.js";
import { icon } from "../board/symbols.js";
import { el } from "./dom.js";

/** @import { Message } from "./types.js" */

/**
 * Writes messages into a strip.
 * @param {HTMLElement} strip an element with role="status"
 */
export function sayIn(strip) {
  return (/** @type {Message} */ message) => strip.replaceChildren(line(message));
}

/**
 * Changes only the quiet word at the end (a countdown), so that nothing is read out again.
 * @param {HTMLElement} strip
 * @param {string} text
 */
export function setAside(strip, text) {
  const aside = strip.querySelector(".aside");
  if (aside) aside.textContent = text;
}

/** @returns {HTMLElement} a strip of its own, for pages that bring none */
export function newStrip() {
  return el("div", { class: "strip", role: "status", "aria-live": "polite" });
}

/** @param {Message} message */
function line({ kind, icon: name, title, text, aside, button }) {
  const sentence = el("span", {}, title ? el("b", {}, title) : null, title && text ? "\u2002" : null, text ?? null);
  const end = aside !== undefined || button ? el("span", { class: "end" }) : null;
  if (aside !== undefined) end?.append(el("span", { class: "tnum aside", "aria-live": "off" }, aside));
  if (button) end?.append(pressable(button));
  return el("div", { class: kind ? `say-${kind}` : null }, name ? build(icon(name, "icon")) : null, sentence, end);
}

/** @param {NonNullable<Message["button"]>} button */
function pressable({ label, key, primary, press }) {
  const classes = primary ? "button button-primary" : "button";
  const element = el("button", { class: classes, type: "button" }, label, key ? el("kbd", {}, key) : null);
  element.addEventListener("click", press);
  return element;
}

/**
 * Shows a message with a button, and waits for a click on it or for Space.
 * @param {(message: Message) => void} say
 * @param {Message} message
 * @param {string} label
 * @param {{ held: boolean }} attention while it is held Space does nothing
 * @returns {Promise<void>}
 */
export function confirmation(say, message, label, attention) {
  return new Promise((resolve) => {
    const go = () => {
      document.removeEventListener("keydown", onKey);
      // The key that was clicked last must not be pressed again when Space comes up.
      if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
      resolve();
    };
    const onKey = (/** @type {Event} */ event) => {
      const key = /** @type {KeyboardEvent} */ (event);
      if (key.key !== " " || attention.held) return;
      key.preventDefault();
      if (!key.repeat) go();
    };
    document.addEventListener("keydown", onKey);
    say({ ...message, button: { label, key: "Space", primary: true, press: go } });
  });
}
