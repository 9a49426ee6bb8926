// @ts-check
// Answers to a form: what is wrong with one (the server's words, server/domain/questionnaire.py), and when it was given.
// Times run from the frame in which the form was drawn; an event's own timeStamp is the moment of the answer. Pure.

/** @typedef {{ key: string, kind: string, required: boolean, minimum: number, maximum: number }} Item */
/** @typedef {{ first_ms: number, last_ms: number, changes: number }} ItemTiming */

export const REQUIRED = "Please answer this question.";
export const LOOK_AGAIN = "Please look at the marked questions.";
export const TEXT_MAX = 4000;
const NUMBER = /^-?\d{1,9}(\.\d{1,6})?$/;

/**
 * @param {Item} item
 * @param {string} value as it would be sent
 * @returns {string} empty: nothing is wrong
 */
export function problem({ kind, required, minimum, maximum }, value) {
  const given = value.trim();
  if (given === "") return required ? REQUIRED : "";
  if (kind === "number") {
    const within = NUMBER.test(given) && Number(given) >= minimum && Number(given) <= maximum;
    return within ? "" : `Please type a number from ${minimum} to ${maximum}.`;
  }
  return kind === "text" && [...given].length > TEXT_MAX ? `Please shorten this to ${TEXT_MAX} characters.` : "";
}

/** When each answer was given first and last, and how often it changed (a text: with every change of its field). */
export class AnswerClock {
  /** @type {number | null} */ #onset = null;
  /** @type {Map<string, ItemTiming>} */ #times = new Map();

  /** @param {number} now the form is drawn */
  onset(now) {
    this.#onset ??= now;
  }

  /**
   * @param {string} key
   * @param {number} stamp of the event
   */
  changed(key, stamp) {
    if (this.#onset === null) return; // nobody has seen the question yet
    const at = Math.max(0, Math.round((stamp - this.#onset) * 1000) / 1000);
    const before = this.#times.get(key);
    this.#times.set(key, { first_ms: before?.first_ms ?? at, last_ms: at, changes: (before?.changes ?? 0) + 1 });
  }

  /**
   * JSON for the hidden field of an item; empty for what was not touched.
   * @param {string} key
   */
  json(key) {
    const times = this.#times.get(key);
    return times ? JSON.stringify(times) : "";
  }

  /** @returns {[string, ItemTiming][]} */
  entries() {
    return [...this.#times];
  }

  /**
   * Takes up what was measured before a reload; what changes later is timed from the new picture.
   * @param {[string, ItemTiming][]} entries
   */
  resume(entries) {
    this.#times = new Map(entries);
  }
}

/** Answers that were not handed in yet: they survive a reload of the tab, and nothing else. */
export class Draft {
  /**
   * @param {string} name of the page, form and attempt
   * @param {Pick<Storage, "getItem" | "setItem"> | null} storage
   */
  constructor(name, storage) {
    this.key = `hatlab:draft:${name}`;
    this.storage = storage;
  }

  /**
   * @param {Record<string, string>} values
   * @param {[string, ItemTiming][]} times
   */
  keep(values, times) {
    try {
      this.storage?.setItem(this.key, JSON.stringify({ values, times }));
    } catch {
      // Storage full or forbidden: only a reload would need it.
    }
  }

  /** @returns {{ values: Record<string, string>, times: [string, ItemTiming][] } | null} */
  get() {
    try {
      const kept = JSON.parse(this.storage?.getItem(this.key) ?? "null");
      return kept && typeof kept.values === "object" && Array.isArray(kept.times) ? kept : null;
    } catch {
      return null;
    }
  }
}
