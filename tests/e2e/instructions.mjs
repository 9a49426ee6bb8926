// @ts-check
// `node tests/e2e/instructions.mjs <scenario> <session> <artefacts>`: the page that says how to play, and what it and the
// page of the board tell about their window. By keyboard only. Prints one JSON line for the test.

import assert from "node:assert/strict";
import { drawn, Participant, playing, press, ready, result, SIZES } from "./browser.mjs";

/** @import { Page } from "playwright-core" */

const [scenario = "", session = "", artefacts = ""] = process.argv.slice(2);
const TABS_MAX = 30;
/** @type {Record<string, string[]>} */
const KEYS = { parent: ["ArrowUp"], child: ["4"], driver: ["f", "j"] };

/**
 * Tab until something has the focus; nothing is ever clicked.
 * @param {Page} page
 * @param {string} selector
 */
async function tabTo(page, selector) {
  const here = () => page.evaluate((wanted) => document.activeElement?.matches(wanted) ?? false, selector);
  for (let tabs = 0; tabs < TABS_MAX && !(await here()); tabs += 1) await page.keyboard.press("Tab");
  assert.ok(await here(), `the keyboard reaches ${selector}`);
}

/**
 * @param {Page} page
 * @param {string} selector
 */
async function enter(page, selector) {
  await tabTo(page, selector);
  await page.keyboard.press("Enter");
}

/** @param {Page} page */
const picture = (page) => page.locator("#example-picture").innerHTML();

/** @param {Page} page */
const word = (page) => page.locator("#example-play").textContent();

/** @param {Page} page */
const isFull = (page) => page.evaluate(() => document.fullscreenElement !== null);

/**
 * The same for longer than any frame of the example.
 * @param {Page} page
 */
async function staysStill(page) {
  const before = await picture(page);
  await page.waitForTimeout(2700);
  assert.equal(await picture(page), before);
}

/**
 * The example is another picture soon.
 * @param {Page} page
 */
async function moves(page) {
  const before = await picture(page);
  await page.waitForFunction((html) => document.querySelector("#example-picture")?.innerHTML !== html, before);
}

/** @param {Page} page */
async function fits(page) {
  const { height, width } = await page.evaluate(() => ({
    height: document.documentElement.scrollHeight - window.innerHeight,
    width: document.documentElement.scrollWidth - window.innerWidth,
  }));
  assert.ok(height <= 0 && width <= 0, `nothing to scroll, but ${width} × ${height} px`);
}

/**
 * Reads, stops the example and lets it go on, tries the keys.
 * @param {Participant} who
 * @param {Page} page
 * @param {string} size
 */
async function read(who, page, size) {
  await page.goto(session);
  const role = String(await page.locator("#probe").getAttribute("data-role"));
  await page.locator("#example-picture svg").first().waitFor();
  await who.look(page, `${size}-${role}`);
  await fits(page);
  const box = await page.locator("#example").boundingBox();
  await moves(page);
  assert.equal(await word(page), "Pause");
  await enter(page, "#example-play");
  assert.equal(await word(page), "Play");
  await staysStill(page);
  await page.keyboard.press("Enter");
  await moves(page);
  assert.deepEqual(await page.locator("#example").boundingBox(), box, "the example keeps its place");
  await enter(page, "#next button");
  assert.match(String(await page.locator("#why").textContent()), /^Press .* The game is played with it\.$/);
  await who.look(page, `${size}-${role}-keys-missing`);
  await fits(page);
  for (const key of KEYS[role] ?? []) await page.keyboard.press(key);
  await page.locator("#received .badge").waitFor();
  await page.waitForTimeout(6000); // somewhere in the middle of the example
  await who.look(page, `${size}-${role}-tried`);
  await fits(page);
}

/** @param {"large" | "small"} size */
function readAt(size) {
  return Participant.with("how-to-play", artefacts, async (who) => read(who, await who.tab(), size), SIZES[size]);
}

/** Who wants little motion gets a still picture, and the example when asking for it. */
function still() {
  return Participant.with("how-to-play-still", artefacts, async (who) => {
    const page = await who.tab();
    await page.emulateMedia({ reducedMotion: "reduce" });
    await page.goto(session);
    await page.locator("#example-picture svg").first().waitFor();
    assert.equal(await word(page), "Show the example");
    await who.look(page, "still");
    await staysStill(page);
    await enter(page, "#example-play");
    assert.equal(await word(page), "Pause");
    await moves(page);
  });
}

/**
 * Full screen by keyboard; it ends with the page, as browsers have it, and comes again between two rounds.
 * @param {Participant} who
 * @param {Page} page
 */
async function fullScreen(who, page) {
  await enter(page, "#full-screen");
  await page.waitForFunction(() => document.fullscreenElement !== null);
  assert.equal(await page.locator("#full-screen").textContent(), "Leave full screen");
  await who.look(page, "full-screen");
  for (const key of ["f", "j"]) await page.keyboard.press(key);
  await Promise.all([page.waitForEvent("load"), enter(page, "#next button")]);
  assert.equal(await isFull(page), false, "a browser leaves full screen with the page");
  while (await playing(page)) await press(page, "j");
  assert.equal(await isFull(page), false, "not in the middle of a round");
  await result(page);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => document.fullscreenElement !== null);
  await ready(page);
}

/**
 * Leaving full screen is nobody's business: play goes on, and the wish is over.
 * @param {Page} page
 */
async function leaveFullScreen(page) {
  await page.evaluate(() => document.exitFullscreen());
  await page.waitForFunction(() => sessionStorage.getItem("hatlab:full-screen") === null);
  assert.equal(await playing(page), true);
  while (await playing(page)) await press(page, "j");
  await result(page);
  await page.keyboard.press("Space");
  await ready(page);
  assert.equal(await isFull(page), false);
}

/**
 * The page is hidden for a while, as behind another window.
 * @param {Page} page
 */
async function hide(page) {
  for (const state of ["hidden", "visible"]) {
    await page.evaluate((value) => {
      Object.defineProperty(document, "visibilityState", { value, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    }, state);
    await drawn(page);
  }
}

/** Everything that the log of the window is for, while its way to the server is down for a while. */
function watched() {
  return Participant.with("watched", artefacts, async (who) => {
    const page = await who.tab();
    let tries = 0;
    await page.route("**/events", (route) => {
      if (!route.request().postDataJSON().page.startsWith("play")) return route.continue();
      tries += 1;
      return tries <= 2 ? route.fulfill({ status: 503 }) : route.continue();
    });
    await page.goto(session);
    await page.locator("#example-picture svg").first().waitFor();
    const stored = page.waitForResponse(
      (answer) => answer.url().endsWith("/events") && answer.ok() && tries > 0, // on a slow machine it comes early
    );
    await fullScreen(who, page);
    await leaveFullScreen(page);
    await page.setViewportSize({ width: 1100, height: 700 });
    await stored;
    assert.ok(tries >= 3, "it was tried again, and the game went on meanwhile");
    await page.waitForTimeout(500);
    await hide(page);
    await page.reload();
    await ready(page);
    await page.goto("about:blank");
    await page.waitForTimeout(500);
  });
}

/** @type {Record<string, () => Promise<void>>} */
const SCENARIOS = { large: () => readAt("large"), small: () => readAt("small"), still, watched };

const visit = SCENARIOS[scenario];
assert.ok(visit, `no scenario ${scenario}; there are ${Object.keys(SCENARIOS).join(", ")}`);
await visit();
