// @ts-check
// Presses keys at known delays after the picture and prints what the page measured, one JSON line a press.
// The delay that counts is the one really kept: from the page's signal at the DOM write to the dispatch of the key.

import { setTimeout as sleep } from "node:timers/promises";
import { Participant } from "../../tests/e2e/browser.mjs";
import { serve } from "../../tests/static/serve.mjs";

const ROUNDS = Number(process.argv[2] ?? 40);
const SHORTEST_MS = 150;
const LONGEST_MS = 450;
const KEY = { key: "j", code: "KeyJ", windowsVirtualKeyCode: 74, text: "j" };

const { url, close } = await serve();
await Participant.with("reaction-time", "artefacts/bench", async (who) => {
  const page = await who.tab();
  await page.goto(`${url}/benchmarks/`);
  await page.waitForFunction(() => "round" in globalThis);
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Runtime.enable");
  await devtools.send("Runtime.addBinding", { name: "onset" });
  for (const load of ["idle", "busy"]) {
    await page.evaluate((on) => /** @type {any} */ (globalThis).setBusy(on), load === "busy");
    await sleep(500);
    for (let i = -3; i < ROUNDS; i += 1) {
      const shown = new Promise((resolve) => devtools.once("Runtime.bindingCalled", () => resolve(performance.now())));
      const measured = page.evaluate((number) => /** @type {any} */ (globalThis).round(number), i);
      const onset = await shown;
      const delay = SHORTEST_MS + (LONGEST_MS - SHORTEST_MS) * ((i * 0.618034 + 2) % 1);
      const pressed = await pressAt(devtools, onset + delay);
      const { hatlab, jspsych, lag } = await measured;
      if (i >= 0) console.log(JSON.stringify({ load, delay_ms: pressed - onset, hatlab, jspsych, lag }));
    }
  }
});
close();

/**
 * Sleeps to just before the moment, then spins: timers are off by milliseconds.
 * @param {import("playwright-core").CDPSession} devtools
 * @param {number} moment
 * @returns {Promise<number>} when the key went down
 */
async function pressAt(devtools, moment) {
  await sleep(Math.max(0, moment - performance.now() - 12));
  while (performance.now() < moment);
  const pressed = performance.now();
  await devtools.send("Input.dispatchKeyEvent", { type: "keyDown", ...KEY });
  await devtools.send("Input.dispatchKeyEvent", { type: "keyUp", ...KEY });
  return pressed;
}
