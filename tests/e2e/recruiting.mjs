// @ts-check
// docs/first-study.md by a browser: a copy of a study is launched, offered at the made-up Prolific, taken part in, and
// what differs is looked at and paid.

import { agree, answer, go, onward, readInstructions } from "./visitor.mjs";

/** @import { Page } from "playwright-core" */

const TITLE = "Evening traffic";
export const SLUG = "evening-traffic";
const PLACES = 6;
const ROUNDS = 2;

/**
 * @param {Page} page
 * @param {string} name
 */
const button = (page, name) => page.getByRole("button", { name });

/**
 * @param {Page} page
 * @param {string} url
 * @param {string} password
 */
export async function signIn(page, url, password) {
  await page.goto(`${url}/admin`);
  await page.locator("[name=username]").fill("admin");
  await page.locator("[name=password]").fill(password);
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { name: "Studies" }).waitFor();
}

/**
 * A short copy, launched.
 * @param {Page} page
 * @param {string} url
 */
export async function launch(page, url) {
  await page.goto(`${url}/admin/studies/new`);
  await page.getByLabel("Title").fill(TITLE);
  await page.locator('input[value="copy:traffic-junction"]').check();
  await button(page, "Create draft").click();
  await page.waitForURL(`${url}/admin/studies/${SLUG}`);
  await page.getByLabel("Trials in a block").fill(String(ROUNDS));
  await page.getByLabel("Attention checks", { exact: true }).fill("");
  await page.getByLabel("Questionnaires").fill("");
  await button(page, "Launch version 1").click();
  await page.waitForURL(/\/launch$/);
  await button(page, "Launch version 1").click();
  await page.waitForURL(/\/monitor$/);
}

/**
 * Drafted and published.
 * @param {Page} page
 * @param {string} url
 */
export async function offer(page, url) {
  await page.goto(`${url}/admin/studies/${SLUG}/recruitment`);
  await page.locator("input[value=prolific]").check();
  await page.getByLabel("Places", { exact: true }).fill(String(PLACES));
  await page.getByLabel("What people read there").fill("Drive a car across a junction, a few times.");
  await button(page, "Make a draft").click();
  await page.getByRole("link", { name: "Publish" }).click();
  await button(page, "Publish").click();
  await button(page, "Pause").waitFor();
}

/**
 * One person after the other: to the end, withdrawn, declined, failed the quiz, and handed in without ever starting.
 * @param {Page} page
 * @param {string} market
 */
export async function take(page, market) {
  await arrive(page, market);
  await playToTheCode(page);
  const code = String(await page.locator("#code").textContent());
  await handIn(page, market, code);

  await arrive(page, market);
  await agree(page);
  await readInstructions(page);
  await page.getByRole("link", { name: "Stop taking part" }).click();
  await button(page, "Stop, and keep my data").click();
  await page.locator("#code").waitFor();

  await arrive(page, market);
  await page.locator("#check").waitFor();
  await button(page, "I do not want to take part").last().click();
  await page.locator("main.done").waitFor();

  await arrive(page, market);
  await failTheQuiz(page);
  await handIn(page, market, String(await page.locator("#code").textContent()));

  await arrive(page, market);
  await handIn(page, market, "");
}

/**
 * Takes a place, which leads to the study.
 * @param {Page} page
 * @param {string} market
 */
async function arrive(page, market) {
  await page.goto(market);
  for (; !(await button(page, "Take a place").count()); await page.reload()) await page.waitForTimeout(500); // publishing
  await button(page, "Take a place").click();
  await page.waitForURL(/\/s\//);
}

/** @param {Page} page */
async function playToTheCode(page) {
  await agree(page);
  await readInstructions(page);
  do await go(page, ["j", "j", "f"]);
  while (await onward(page));
  await page.locator("#code").waitFor();
}

/** @param {Page} page */
async function failTheQuiz(page) {
  await agree(page);
  await readInstructions(page);
  await go(page, ["j"]);
  await page.keyboard.press("Space");
  for (let tries = 0; tries < 2; tries += 1) {
    await page.locator("#answers").waitFor();
    await answer(page, ["I see them on the map", "J", "Which way my car takes", "I stay where I am"]);
  }
  await page.locator("#code").waitFor();
}

/**
 * By the button of the newest participant.
 * @param {Page} page
 * @param {string} market
 * @param {string} code
 */
async function handIn(page, market, code) {
  await page.goto(market);
  const newest = page.locator("tbody tr").first();
  await newest.locator("[name=code]").fill(code);
  await newest.getByRole("button", { name: "Hand in" }).click();
  await page.waitForLoadState("load");
}

/**
 * Asks how everything stands there.
 * @param {Page} page
 * @param {string} url
 */
export async function ask(page, url) {
  await page.goto(`${url}/admin/studies/${SLUG}/recruitment`);
  await button(page, "Ask now").click();
  await page.getByText("went through everything, not yet paid").waitFor();
}

/**
 * Everything that can be done is done, after the page that says what it costs.
 * @param {Page} page
 */
export async function settle(page) {
  await button(page, "Choose all").click();
  await button(page, "Look at what was chosen").click();
  await button(page, "Yes, do all").click();
  await page.getByText(/\d+ done/).waitFor();
}
