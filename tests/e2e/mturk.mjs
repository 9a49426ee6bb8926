// @ts-check
// `node tests/e2e/mturk.mjs preview|work <worker site> <server> <artefacts>`: a worker of the fake MTurk in Chromium.
// The study stands in a frame of another site, and third-party cookies are blocked. Prints the code that was handed in.

import assert from "node:assert/strict";
import { join } from "node:path";
import { Participant, passGate, playing, press, result } from "./browser.mjs";

/** @import { Frame, Page } from "playwright-core" */
/** @import { Place } from "./browser.mjs" */

const [visit = "", site = "", server = "", artefacts = ""] = process.argv.slice(2);
const WINDOW = { width: 1280, height: 800 };
const NO_FOREIGN_COOKIES = { profile: { cookie_controls_mode: 1, block_third_party_cookies: true } };
const COOKIE = "probe=1; SameSite=None; Secure";

/**
 * The study's frame, once it shows this.
 * @param {Page} page
 * @param {string} selector
 */
async function inside(page, selector) {
  await page.frameLocator("#task").locator(selector).first().waitFor();
  const frame = page.frames().find((each) => each !== page.mainFrame());
  assert.ok(frame, "the task stands in a frame");
  return frame;
}

/**
 * The frame with the keyboard, which types into it.
 * @param {Page} page
 * @param {Frame} frame
 * @returns {Promise<Place>}
 */
async function typing(page, frame) {
  await page.locator("#task").evaluate((task) => task.blur()); // else a new page inside gets no keys
  await page.locator("#task").focus();
  return {
    locator: frame.locator.bind(frame),
    waitForFunction: frame.waitForFunction.bind(frame),
    keyboard: page.keyboard,
  };
}

/**
 * From the list of HITs to the preview.
 * @param {Page} page
 */
async function preview(page) {
  await page.goto(`${site}/?worker=AEVA`);
  await page.getByRole("link", { name: "Drive through a crossing" }).click();
  const frame = await inside(page, "main.done h1");
  assert.match(String(await frame.locator("h1").textContent()), /preview/);
  assert.equal(new URL(frame.url()).origin, server);
  assert.notEqual(new URL(page.url()).hostname, new URL(server).hostname, "two sites");
  await page.screenshot({ path: join(artefacts, "mturk-01-preview.png") });
}

/**
 * The browser keeps no cookie of the framed site, and would keep the same one if the site were not framed.
 * @param {Participant} who
 * @param {Frame} frame
 */
async function cookiesAreBlocked(who, frame) {
  const kept = (/** @type {string} */ cookie) => {
    // biome-ignore lint/suspicious/noDocumentCookie: this is about the plain thing
    document.cookie = cookie;
    return document.cookie;
  };
  assert.equal(await frame.evaluate(kept, COOKIE), "");
  const alone = await who.tab();
  await alone.goto(server);
  assert.equal(await alone.evaluate(kept, COOKIE), "probe=1");
  await alone.close();
}

/**
 * Presses the keys until the page says that it got them, as people do: another site's frame has the keyboard a moment
 * after it was given to it, and that moment is long on a busy machine.
 * @param {Page} page
 * @param {Frame} frame
 */
async function tryKeys(page, frame) {
  const received = frame.locator("#received .badge");
  for (let i = 0; i < 10 && (await received.count()) === 0; i += 1) {
    const { keyboard } = await typing(page, frame);
    for (const key of ["f", "j"]) await keyboard.press(key);
    await received.waitFor({ timeout: 2_000 }).catch(() => {});
  }
  await received.waitFor();
}

/**
 * Consent and how to play; gives the frame at the first round.
 * @param {Page} page
 */
async function enter(page) {
  const consent = await inside(page, "#check");
  await passGate(await typing(page, consent));
  await consent.locator("input[name=read]").check();
  await consent.getByRole("button", { name: "I agree, start" }).click();
  const probe = await inside(page, "#example-play"); // shown once the page hears keys
  await tryKeys(page, probe);
  await page.screenshot({ path: join(artefacts, "mturk-02-instructions.png") });
  await probe.getByRole("button", { name: "Next" }).click();
  return inside(page, ".board-wrap svg");
}

/**
 * Every round of the session, until there is a code.
 * @param {Page} page
 * @param {Frame} frame
 */
async function play(page, frame) {
  const place = await typing(page, frame);
  await page.screenshot({ path: join(artefacts, "mturk-03-round.png") });
  for (let round = 0; round < 10 && (await frame.locator("#code").count()) === 0; round += 1) {
    for (let i = 0; await playing(place); i += 1) await press(place, i % 5 === 3 ? "f" : "j");
    await result(place);
    const before = await frame.locator("#far").textContent();
    await page.keyboard.press("Space");
    await frame.waitForFunction(
      (text) => document.querySelector("#code") || document.querySelector("#far")?.textContent !== text,
      before,
    );
    await frame.locator("#code, .key").first().waitFor();
  }
}

/**
 * Hands in by the form; the worker site says so in the frame.
 * @param {Page} page
 */
async function handIn(page) {
  const frame = await inside(page, "#code");
  const code = String(await frame.locator("#code").textContent());
  await page.screenshot({ path: join(artefacts, "mturk-04-complete.png") });
  await frame.getByRole("button", { name: "Return to Mechanical Turk" }).click();
  const after = await inside(page, "#said");
  assert.equal(await after.locator("#said").textContent(), "Submitted");
  assert.equal(new URL(after.url()).origin, site);
  return code;
}

/** @param {Participant} who */
async function work(who) {
  const page = await who.tab();
  await preview(page);
  await page.getByRole("button", { name: "Accept" }).click();
  const frame = await enter(page);
  await cookiesAreBlocked(who, frame);
  await play(page, frame);
  console.log(await handIn(page));
}

/** @param {Participant} who */
async function look(who) {
  await preview(await who.tab());
}

await Participant.with(`mturk-${visit}`, artefacts, visit === "work" ? work : look, WINDOW, {}, NO_FOREIGN_COOKIES);
