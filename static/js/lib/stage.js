// @ts-check
// The parts that both tasks put beside their board: meters and keys. Built once a round; only their contents change.

import { build } from "../board/drawing.js";
import { meter } from "../board/meters.js";
import { icon } from "../board/symbols.js";
import { el } from "./dom.js";

/** @param {string} label */
export function meterBlock(label) {
  const done = el("b");
  const value = el("span", { class: "value" }, done);
  const ticks = el("span", { class: "ticks" });
  const element = el("div", { class: "meter" }, el("span", {}, label), value, ticks);
  return {
    element,
    /**
     * @param {number} count
     * @param {number} limit
     */
    set(count, limit) {
      done.textContent = String(count);
      value.replaceChildren(done, ` of ${limit}`);
      ticks.replaceChildren(build(meter(count, limit)));
    },
  };
}

/**
 * A key on screen: a real button that does what the key does.
 * @param {{ action: number, label?: string, icon?: string, text?: string, key?: string }} look
 * @param {(action: number, event: MouseEvent) => void} press
 */
export function keyButton({ action, label, icon: name, text, key }, press) {
  const hint = key ? el("span", {}, "press ", el("kbd", {}, key)) : null;
  const element = el("button", { class: "key", type: "button", "aria-label": label, "data-action": String(action) });
  element.append(...[name ? build(icon(name)) : null, text ?? null, hint].filter((part) => part !== null));
  element.addEventListener("click", (event) => press(action, event));
  return element;
}

/**
 * Keys that work are drawn as keys; keys that do not work now go flat, and the one that was pressed stays dark.
 * @param {HTMLElement[]} keys
 * @param {{ active: boolean, pressed?: number | null }} state
 */
export function setKeys(keys, { active, pressed = null }) {
  for (const key of keys) {
    const on = pressed !== null && key.dataset.action === String(pressed);
    key.classList.toggle("key-on", on);
    key.classList.toggle("key-off", !active && !on);
    key.setAttribute("aria-disabled", String(!active));
  }
}
