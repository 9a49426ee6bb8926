// @ts-check
// In the page: a picture, and the same key press measured by hatlab and by jsPsych's keyboard API.

import { initJsPsych } from "jspsych";
import { Attention } from "/static/js/lib/attention.js";
import { browserClock } from "/static/js/lib/clock.js";
import { Responder } from "/static/js/lib/responder.js";

const picture = /** @type {HTMLElement} */ (document.querySelector("#picture"));
/** @type {any} */
const jsPsych = initJsPsych({ display_element: "jspsych-target", use_webaudio: false });
const page = { attention: new Attention(), clock: browserClock, page: document, boardPx: () => 490 };
const responder = new Responder(page);
let busy = false;

/** Keeps the main thread busy in pieces of 5 to 45 ms with short gaps, as a page that draws a lot does. */
function work() {
  if (!busy) return;
  const end = performance.now() + 5 + 40 * Math.random();
  while (performance.now() < end);
  setTimeout(work, 5 + 10 * Math.random());
}

/**
 * One round: shows a picture, tells the other side at once, and waits for the key.
 * @param {number} number
 */
async function round(number) {
  /** @type {Promise<number>} */
  let theirs = Promise.resolve(0);
  const ours = responder.ask({
    keys: { go: 0 },
    write: () => {
      picture.textContent = `picture ${number}`;
      theirs = new Promise((resolve) => {
        const callback_function = (/** @type {{ rt: number }} */ { rt }) => resolve(rt);
        jsPsych.pluginAPI.getKeyboardResponse({ callback_function, valid_responses: ["j"] });
      });
      // @ts-expect-error a binding that the benchmark adds
      queueMicrotask(() => globalThis.onset(String(number)));
    },
  });
  const { timing } = await ours;
  return { hatlab: timing.rt_ms, jspsych: await theirs, lag: timing.handler_lag_ms };
}

Object.assign(globalThis, {
  round,
  setBusy(/** @type {boolean} */ on) {
    busy = on;
    work();
  },
});
await jsPsych.run([
  {
    type: class Idle {
      static info = { name: "idle", version: "1", parameters: {}, data: {} };
      trial() {}
    },
  },
]);
