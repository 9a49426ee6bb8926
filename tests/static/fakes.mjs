// @ts-check
// Doubles that the tests hand to the pure modules: a clock that goes when told, a server that answers from a list.

import { Attention } from "../../static/js/lib/attention.js";

/** A clock whose frames are run by hand. */
export class FakeClock {
  time = 0;
  /** @type {((time: number) => void)[]} */ waiting = [];

  now = () => this.time;
  frame = (/** @type {(time: number) => void} */ callback) => {
    this.waiting.push(callback);
  };

  /** Lets time pass without a frame. @param {number} ms */
  pass(ms) {
    this.time += ms;
  }

  /** One frame, `ms` later. @param {number} ms */
  tick(ms = 16) {
    this.time += ms;
    const due = this.waiting;
    this.waiting = [];
    for (const callback of due) callback(this.time);
  }
}

/** A page that hears keys and can be hidden. */
export class FakePage extends EventTarget {
  attention = new Attention();
  /** @type {string[]} */ prevented = [];

  /**
   * A key that went down at `timeStamp` (an event's own, read-only otherwise).
   * @param {string} key
   * @param {number} timeStamp
   * @param {object} [more]
   */
  key(key, timeStamp, more = {}) {
    const event = new Event("keydown", { cancelable: true });
    for (const [name, value] of Object.entries({ key, code: "", repeat: false, timeStamp, ...more })) {
      Object.defineProperty(event, name, { value });
    }
    this.dispatchEvent(event);
    if (event.defaultPrevented) this.prevented.push(key);
  }
}

/** Storage in memory; `broken` throws, as blocked frames do. */
export class FakeStorage {
  /** @type {Map<string, string>} */ items = new Map();
  broken = false;

  #check() {
    if (this.broken) throw new Error("storage is forbidden here");
  }
  /** @param {string} key */
  getItem(key) {
    this.#check();
    return this.items.get(key) ?? null;
  }
  /** @param {string} key @param {string} value */
  setItem(key, value) {
    this.#check();
    this.items.set(key, value);
  }
  /** @param {string} key */
  removeItem(key) {
    this.#check();
    this.items.delete(key);
  }
}

/**
 * A server that gives one prepared answer a request and then none; "down" is a lost connection.
 * @param {("down" | { status: number, body?: unknown })[]} answers
 */
export function fakeServer(answers) {
  /** @type {{ url: string, body: any }[]} */ const requests = [];
  const fetch = async (/** @type {any} */ url, /** @type {any} */ init) => {
    requests.push({ url, body: JSON.parse(init.body) });
    const answer = answers.shift();
    if (answer === undefined) return new Promise(() => {}); // an answer that never comes
    if (answer === "down") throw new TypeError("Failed to fetch");
    return new Response(JSON.stringify(answer.body ?? null), { status: answer.status });
  };
  /** @type {number[]} */ const naps = [];
  const wait = async (/** @type {number} */ ms) => void naps.push(ms);
  return { requests, naps, seams: { fetch, wait, timeout: () => new AbortController().signal } };
}
