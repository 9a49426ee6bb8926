// @ts-check
// `make screenshots`: the pictures of README and docs, taken from a real server that is played in real Chromium.
// `node tests/e2e/screenshots.mjs <folder>`; HATLAB names the command (default .venv/bin/hatlab).

import { randomBytes } from "node:crypto";
import { mkdirSync, rmSync } from "node:fs";
import { join, resolve } from "node:path";
import { Participant, passGate, playing, result, SIZES } from "./browser.mjs";
import { ask, launch, offer, SLUG, settle, signIn, take } from "./recruiting.mjs";
import { served } from "./servers.mjs";
import { agree, go, onward, readInstructions } from "./visitor.mjs";

/** @import { Locator, Page } from "playwright-core" */

const FOLDER = resolve(process.argv[2] ?? "docs/images");
const ROBOTS = 8;
/** Steps after which the pictures of a round are taken: enough for a path, too few for the end. */
const STEPS = 4;
/** Triangles on the picture of the junction, at least; they are looked for in so many rounds. */
const TRIANGLES = 3;
const ROUNDS = 6;

/**
 * @param {Page | Locator} what a page's window, or a part of it
 * @param {string} name
 * @param {{ x: number, y: number, width: number, height: number }} [clip]
 */
async function picture(what, name, clip) {
  await what.screenshot({ path: join(FOLDER, `${name}.png`), ...(clip && { clip }) });
  console.log(join(FOLDER, `${name}.png`));
}

/**
 * Somebody new comes to a study and agrees.
 * @param {Page} page
 * @param {string} url
 * @param {string} study
 */
async function enter(page, url, study) {
  const person = randomBytes(12).toString("hex");
  await page.goto(`${url}/s/${study}?PROLIFIC_PID=${person}&STUDY_ID=pictures&SESSION_ID=${person}`);
  await agree(page);
}

const TOUR = ["ArrowUp", "ArrowUp", "ArrowRight", "ArrowRight", "ArrowDown", "ArrowLeft"];

/** @param {Page} page */
async function asParent(page) {
  await go(page, TOUR);
  await onward(page);
  await playing(page);
  await go(page, ["ArrowUp", "ArrowUp", "ArrowRight"], STEPS);
  await picture(page, "parent");
}

/**
 * One sign after the other until one of them brings the parent from some way off.
 * @param {Page} page
 */
async function asChild(page) {
  await playing(page);
  await page.keyboard.press("5");
  for (let sign = 1, found = false; sign <= 9 && !found; sign += 1) {
    await onward(page);
    await playing(page);
    await page.keyboard.press(String(sign));
    found = /found you in ([4-9]|1\d) /.test((await result(page)) ?? "");
  }
  await picture(page, "child");
}

/**
 * People come in until both roles were somebody's first one.
 * @param {Page} page
 * @param {string} url
 */
async function bothRoles(page, url) {
  for (const seen = new Set(); seen.size < 2; ) {
    await enter(page, url, "parent-child");
    const role = await readInstructions(page);
    if (!seen.has(role)) await (role === "parent" ? asParent(page) : asChild(page));
    seen.add(role);
  }
}

/** @param {Page} page */
async function drive(page) {
  await readInstructions(page);
  await go(page, ["j", "f", "j"]);
  for (let round = 0, warned = false; round < ROUNDS && !warned; round += 1) {
    await go(page, ["j"]);
    await onward(page);
    await go(page, ["j"], STEPS);
    warned = (await playing(page)) && (await page.locator(".board-wrap .caution").count()) >= TRIANGLES;
  }
  await picture(page, "driver");
}

/**
 * @param {Page} page
 * @param {string} url
 */
async function admin(page, url) {
  await page.goto(`${url}/admin/studies/traffic-junction`);
  await picture(page, "admin-build");
  await page.goto(`${url}/admin/agents`);
  await picture(page, "admin-agents");
  await page.goto(`${url}/admin/studies/traffic-junction/monitor?mode=robot&show=finished`);
  await picture(page, "admin-monitor");
}

/**
 * What docs/first-study.md tells, as far as the pictures of it.
 * @param {Page} page
 * @param {import("./servers.mjs").Served} served
 */
async function recruiting(page, { url, market }) {
  await launch(page, url);
  await offer(page, url);
  await take(page, market);
  await page.goto(market);
  await picture(page, "fake-prolific");
  await ask(page, url);
  await picture(page.locator(".posting"), "admin-recruitment");
  await page.goto(`${url}/admin/studies/${SLUG}/monitor?mode=test&show=all`);
  await picture(page.locator("section", { has: page.getByRole("heading", { name: "Flow of people" }) }), "admin-flow");
  await ask(page, url);
  await settle(page);
}

mkdirSync(FOLDER, { recursive: true });
await served(async (served) => {
  const { url, password, hatlab } = served;
  await hatlab("simulate", "traffic-junction", "--participants", String(ROBOTS), "--seed", "1", "--url", url);
  const artefacts = join(FOLDER, "failed");
  await Participant.with("pictures", artefacts, async (who) => {
    const page = await who.tab();
    await signIn(page, url, password);
    await recruiting(page, served);
    await page.setViewportSize(SIZES.small);
    await page.goto(`${url}/s/parent-child`);
    await passGate(page);
    await picture(page, "consent", { x: 0, y: 0, ...SIZES.small, height: 500 });
    await page.setViewportSize(SIZES.large);
    await enter(page, url, "traffic-junction");
    await picture(page, "instructions");
    await drive(page);
    await bothRoles(page, url);
    await admin(page, url);
    // Taking a picture puts a style into the page, which its content policy refuses; anything else is a fault.
    who.errors = who.errors.filter((error) => !/Content Security Policy/.test(error));
  });
  rmSync(artefacts, { recursive: true, force: true });
});
