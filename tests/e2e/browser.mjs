// @ts-check
// A real Chromium and what a participant does in it. Used by play.mjs; the assertions are node's own.

import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { delimiter, join } from "node:path";
import { chromium } from "playwright-core";

/** @import { BrowserContext, Page } from "playwright-core" */

const FLAGS = [
  "--headless",
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];
const PLACES = (process.env.PATH ?? "").split(delimiter);
/** The same names as in .ci/need-browser and conftest.py. */
const CHROMIUM = ["chromium", "chromium-browser", "google-chrome"]
  .flatMap((name) => PLACES.map((place) => join(place, name)))
  .find((file) => existsSync(file));
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const SIZES = { large: { width: 1280, height: 720 }, small: { width: 1024, height: 640 } };

/** One participant at one computer. */
export class Participant {
  /** @type {string[]} */ errors = [];
  /** Decisions that the server confirmed, by round and seq. @type {Map<string, string>} */ sent = new Map();
  shots = 0;
  #looking = false;

  /**
   * @param {BrowserContext} context
   * @param {string} name
   * @param {string} artefacts
   */
  constructor(context, name, artefacts) {
    this.context = context;
    this.name = name;
    this.artefacts = artefacts;
    context.setDefaultTimeout(20_000);
  }

  /**
   * @param {string} name
   * @param {string} artefacts folder of the screenshots
   * @param {(participant: Participant) => Promise<void>} visit
   * @param {{ width: number, height: number }} [viewport]
   * @param {import("playwright-core").BrowserContextOptions} [device]
   * @param {object} [preferences] of the Chromium profile
   */
  static async with(name, artefacts, visit, viewport = SIZES.large, device = {}, preferences = {}) {
    const profile = mkdtempSync(join(tmpdir(), "hatlab-profile-"));
    mkdirSync(artefacts, { recursive: true });
    mkdirSync(join(profile, "Default"));
    writeFileSync(join(profile, "Default", "Preferences"), JSON.stringify(preferences));
    const context = await chromium.launchPersistentContext(profile, {
      executablePath: process.env.HATLAB_CHROMIUM ?? CHROMIUM ?? "chromium",
      args: FLAGS,
      viewport,
      ...device,
    });
    const participant = new Participant(context, name, artefacts);
    try {
      await visit(participant);
      assert.deepEqual(participant.errors, [], "the console stays silent");
    } catch (error) {
      for (const [i, page] of context.pages().entries()) {
        await page.screenshot({ path: join(artefacts, `${name}-failed-${i}.png`) }).catch(() => {});
      }
      throw error;
    } finally {
      await context.close();
      rmSync(profile, { recursive: true, force: true });
    }
  }

  /** A tab whose errors and requests are watched. */
  async tab() {
    const page = await this.context.newPage();
    page.on("pageerror", (error) => this.errors.push(String(error)));
    page.on("console", (message) => {
      const text = message.text();
      // A lost connection and a 409 are part of the tests; Chromium reports every failed request.
      // Taking a picture and checking it put styles into the page, which the policy refuses; on a busy machine that is
      // told late. What the page's own files do has their address.
      const ours = message.location().url !== "" || !/Content Security Policy/.test(text);
      if (this.#looking || !ours) return;
      if (message.type() === "error" && !/Failed to load resource|net::ERR/.test(text)) this.errors.push(text);
    });
    page.on("response", (response) => {
      if (!response.url().endsWith("/step") || response.status() !== 200) return;
      const body = response.request().postData() ?? "";
      const { round, seq } = JSON.parse(body);
      this.sent.set(`${round}:${seq}`, body);
    });
    return page;
  }

  /**
   * A screenshot that is kept, and no accessibility violation.
   * @param {Page} page
   * @param {string} what
   */
  async look(page, what) {
    this.shots += 1;
    const file = `${this.name}-${String(this.shots).padStart(2, "0")}-${what}.png`;
    this.#looking = true;
    await page.screenshot({ path: join(this.artefacts, file) });
    await accessible(page, what);
    // Console messages come on their own time, but in order: what precedes the last word belongs to the look.
    const last_word = page.waitForEvent("console", (message) => message.text() === "looked");
    await page.evaluate(() => setTimeout(() => console.debug("looked")));
    await last_word;
    this.#looking = false;
  }
}

/**
 * axe-core finds nothing. It is run through the debugger, which no content policy stops.
 * @param {Page} page
 * @param {string} what
 */
export async function accessible(page, what) {
  await page.evaluate(AXE);
  const found = await page.evaluate(async () => {
    // @ts-expect-error axe is the script above
    const { violations } = await globalThis.axe.run(document, { resultTypes: ["violations"] });
    return violations.map(
      (/** @type {any} */ { id, nodes }) => `${id}: ${nodes.map((/** @type {any} */ n) => n.html).join(" | ")}`,
    );
  });
  assert.deepEqual(found, [], `accessibility of ${what}`);
}

/** Keys by the names that the entry page asks for. @type {Record<string, string>} */
const KEYS = { up: "ArrowUp", brake: "f", go: "j" };

/**
 * The look at the device before consent: presses the keys that it asks for, and waits for the rest.
 * @param {Place} page
 */
export async function passGate(page) {
  const { keys } = JSON.parse(String(await page.locator("#gate").textContent()));
  await page.locator("#check").waitFor();
  for (const [first] of keys) await page.keyboard.press(KEYS[first] ?? "");
  await page.locator("#fits").waitFor();
}

/** @typedef {{ task: string, role: string, phase: string, round: number, seq: number, step: number, over: object | null }} Shown */

/** A page, or a frame with its page's keyboard. @typedef {Pick<Page, "locator" | "keyboard" | "waitForFunction">} Place */

/**
 * What the strip says.
 * @param {Place} page
 */
export const strip = (page) => page.locator("#strip").textContent();

/**
 * Waits until the round is over and its result can be left.
 * @param {Place} page
 */
export async function result(page) {
  await page.locator("#strip .button-primary").waitFor();
  return strip(page);
}

/**
 * The steps that the meter shows.
 * @param {Place} page
 */
export async function steps(page) {
  return Number(await page.locator(".meter .value b").first().textContent());
}

/**
 * Until the board takes a decision: before that, and for a moment after each, keys are not heard.
 * @param {Place} page
 */
export async function ready(page) {
  await page.locator(".key[aria-disabled=false]").first().waitFor();
}

/**
 * One key press, and the wait for what follows: another step on the meter, or the end of the round.
 * @param {Place} page
 * @param {string} key
 */
export async function press(page, key) {
  await ready(page);
  const before = await steps(page);
  await page.keyboard.press(key);
  await page.waitForFunction((count) => {
    const shown = document.querySelector(".meter .value b")?.textContent;
    return Number(shown) > count || document.querySelector("#strip .button-primary");
  }, before);
}

/**
 * Whether the round still takes decisions.
 * @param {Place} page
 */
export async function playing(page) {
  await page.locator(".key[aria-disabled=false], #strip .button-primary").first().waitFor();
  return (await page.locator("#strip .button-primary").count()) === 0;
}

/**
 * Space leaves the finished round.
 * @param {Page} page
 * @returns {Promise<boolean>} whether another page came
 */
export async function leaveRound(page) {
  const before = await page.locator("#far").textContent();
  await page.evaluate(() => Object.assign(window, { here: true }));
  await page.keyboard.press("Space");
  await page.waitForFunction(
    (text) =>
      !("here" in window) ||
      (document.querySelector("#far")?.textContent !== text && !document.querySelector("#strip .button-primary")),
    before,
  );
  return page.evaluate(() => !("here" in window));
}

/**
 * Two frames have passed: what was to be drawn is on screen, and keys are heard again.
 * @param {Page} page
 */
export async function drawn(page) {
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
}
