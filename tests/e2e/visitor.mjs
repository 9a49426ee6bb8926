// @ts-check
// What somebody does who knows the paper's two studies: consent, instructions, rounds, and right answers.

import { leaveRound, passGate, playing, press, result } from "./browser.mjs";

/** @import { Page } from "playwright-core" */

/** Keys that the instructions ask for. @type {Record<string, string[]>} */
const PROBE = { parent: ["ArrowUp"], child: ["1"], driver: ["f", "j"] };

/** Right answers to the quiz of both studies, and to their attention checks. */
const RIGHT = [
  "Only when it is in the frame around you",
  "What the child says in this round",
  "As long as I like",
  "I choose one sign, which is my message",
  "I watch the parent walk",
  "One in which the parent finds me in few steps",
  "Triangles show where a car may be",
  "F",
  "When my car goes and when it waits",
  "I cross without touching another car",
  "River",
  "Seven",
];

/**
 * From the entry page to the instructions.
 * @param {Page} page
 */
export async function agree(page) {
  await passGate(page);
  await page.locator("[name=read]").check();
  await page.getByRole("button", { name: "I agree, start" }).click();
  await page.waitForURL(/\/p\//);
}

/**
 * To the first round after the instructions; the role.
 * @param {Page} page
 */
export async function readInstructions(page) {
  const role = String(await page.locator("#probe").getAttribute("data-role"));
  for (const key of PROBE[role] ?? []) await page.keyboard.press(key);
  await page.locator("#received .badge").waitFor();
  await page.getByRole("button", { name: "Next" }).click();
  await page.locator(".board-wrap svg").waitFor();
  return role;
}

/**
 * Keys in turn until the round is over, or for so many steps.
 * @param {Page} page
 * @param {string[]} keys
 * @param {number} [most]
 */
export async function go(page, keys, most = Number.POSITIVE_INFINITY) {
  for (let i = 0; i < most && (await playing(page)); i += 1) await press(page, keys[i % keys.length] ?? "");
}

/**
 * From the end of a round to the next one, through whatever is asked in between.
 * @param {Page} page
 * @returns {Promise<boolean>} whether there is another round
 */
export async function onward(page) {
  await result(page);
  await leaveRound(page);
  await page.locator(".board-wrap svg, #answers, #probe, main.done").first().waitFor();
  while (await page.locator("#answers").count()) await answer(page);
  return (await page.locator(".board-wrap svg").count()) > 0;
}

/**
 * Answers a form, rightly where there is a right answer, and sends it.
 * @param {Page} page
 * @param {string[]} [right]
 */
export async function answer(page, right = RIGHT) {
  for (const item of await page.locator("fieldset[data-required]").all()) {
    const options = item.locator("label");
    const labels = (await options.allTextContents()).map((label) => label.trim());
    const chosen = Math.max(
      0,
      labels.findIndex((label) => right.includes(label)),
    );
    await options.nth(chosen).locator("input").check();
  }
  await page.evaluate(() => Object.assign(window, { here: true }));
  await page.getByRole("button", { name: "Continue" }).click();
  await page.waitForFunction(() => !("here" in window));
  await page.locator(".board-wrap svg, #answers, #probe, main.done").first().waitFor();
}
