// @ts-check
// A form of questions on the page: reads and restores answers, times them, says what is missing before it is sent.

import { AnswerClock, Draft, LOOK_AGAIN, problem } from "./answers.js";
import { find } from "./dom.js";
import { tabStorage } from "./fullscreen.js";

/** @import { Item } from "./answers.js" */

/** @typedef {HTMLInputElement | HTMLTextAreaElement} Control */

export class Form {
  /** @type {HTMLFormElement} */ element = find("#answers");
  clock = new AnswerClock();
  #error = find("#why");
  #answered = find("#answered");

  constructor() {
    /** @type {HTMLElement[]} */
    this.items = [...this.element.querySelectorAll("fieldset")];
    const { form, attempt } = this.#names();
    this.draft = new Draft(`${location.pathname}:${form}:${attempt}`, tabStorage());
    this.#restore();
    requestAnimationFrame(() => this.clock.onset(performance.now()));
    this.element.addEventListener("input", (event) => this.#onInput(event));
    this.element.addEventListener("submit", (event) => this.#onSubmit(event));
    this.#count();
    for (const item of this.items) if (item.hasAttribute("data-wrong")) this.#mark(item, this.#told(item));
    this.items.find((item) => item.hasAttribute("data-wrong")) && this.#focusFirstWrong();
  }

  #names() {
    const value = (/** @type {string} */ name) =>
      /** @type {HTMLInputElement} */ (find(`[name=${name}]`, this.element)).value;
    return { form: value("form"), attempt: value("attempt") };
  }

  /**
   * @param {HTMLElement} item
   * @returns {Control[]}
   */
  controls(item) {
    return [...item.querySelectorAll(`[name="a.${item.dataset.key}"]`)].map((each) => /** @type {Control} */ (each));
  }

  /**
   * What would be sent for an item.
   * @param {HTMLElement} item
   */
  value(item) {
    const controls = this.controls(item);
    const radio = controls.find((each) => each.type === "radio");
    if (!radio) return controls[0]?.value ?? "";
    return controls.find((each) => /** @type {HTMLInputElement} */ (each).checked)?.value ?? "";
  }

  /**
   * Sets an answer from a script, as if it had been given at `stamp`.
   * @param {string} key
   * @param {string} value
   * @param {number} stamp
   */
  answer(key, value, stamp) {
    const item = this.items.find((each) => each.dataset.key === key);
    const [control] = item ? this.controls(item) : [];
    if (!control) return;
    control.value = value;
    this.#changed(key, stamp);
  }

  /** @param {Event} event */
  #onInput(event) {
    const item = /** @type {HTMLElement} */ (event.target).closest("fieldset");
    const key = item?.dataset.key;
    if (!item || !key) return;
    if (item.hasAttribute("data-wrong")) this.#mark(item, "");
    this.#changed(key, event.timeStamp);
  }

  /**
   * @param {string} key
   * @param {number} stamp
   */
  #changed(key, stamp) {
    this.clock.changed(key, stamp);
    this.#count();
    const values = Object.fromEntries(this.items.map((item) => [item.dataset.key ?? "", this.value(item)]));
    this.draft.keep(values, this.clock.entries());
  }

  #restore() {
    const kept = this.draft.get();
    if (!kept) return;
    this.clock.resume(kept.times);
    for (const item of this.items) {
      const value = kept.values[item.dataset.key ?? ""] ?? "";
      for (const control of this.controls(item)) {
        if (control instanceof HTMLInputElement && control.type === "radio") control.checked = control.value === value;
        else control.value = value;
      }
    }
  }

  #count() {
    const done = this.items.filter((item) => this.value(item).trim() !== "");
    for (const item of this.items) item.classList.toggle("is-open", !done.includes(item));
    this.#answered.textContent = this.items.length > 1 ? `${done.length} of ${this.items.length} answered` : "";
  }

  /** @param {SubmitEvent} event */
  #onSubmit(event) {
    for (const item of this.items) this.#mark(item, problem(facts(item), this.value(item)));
    if (this.items.some((item) => item.hasAttribute("data-wrong"))) {
      event.preventDefault();
      this.#focusFirstWrong();
      return;
    }
    for (const item of this.items) {
      const { key } = facts(item);
      /** @type {HTMLInputElement} */ (find(`[name="t.${key}"]`, item)).value = this.clock.json(key);
    }
  }

  /** @param {HTMLElement} item */
  #told(item) {
    return find(".why", item).textContent ?? "";
  }

  /**
   * @param {HTMLElement} item
   * @param {string} wrong
   */
  #mark(item, wrong) {
    item.toggleAttribute("data-wrong", wrong !== "");
    find(".why", item).textContent = wrong;
    for (const control of this.controls(item)) {
      if (wrong === "") control.removeAttribute("aria-invalid");
      else control.setAttribute("aria-invalid", "true");
    }
    const left = this.items.some((each) => each.hasAttribute("data-wrong"));
    if (!left) this.#error.textContent = "";
  }

  #focusFirstWrong() {
    const item = this.items.find((each) => each.hasAttribute("data-wrong"));
    this.#error.textContent = LOOK_AGAIN;
    if (item) this.controls(item)[0]?.focus();
  }
}

/**
 * @param {HTMLElement} item
 * @returns {Item}
 */
function facts({ dataset }) {
  return {
    key: dataset.key ?? "",
    kind: dataset.kind ?? "",
    required: dataset.required !== undefined,
    minimum: Number(dataset.minimum),
    maximum: Number(dataset.maximum),
  };
}
