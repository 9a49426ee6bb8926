// @ts-check
// `node tests/e2e/journey.mjs <scenario> <server> <artefacts> [argument …]`: a participant with a keyboard only, through
// everything that a study can ask. Prints one JSON line for the test: the key of the session, and what was answered.

import assert from "node:assert/strict";
import { randomBytes } from "node:crypto";
import { leaveRound, Participant, passGate, playing, result, SIZES } from "./browser.mjs";

/** @import { Locator, Page } from "playwright-core" */

const [scenario = "", server = "", artefacts = "", ...more] = process.argv.slice(2);

/** @type {{ key: string, answers: Record<string, string> }} */
const told = { key: "", answers: {} };

const invitation = () => `PROLIFIC_PID=${randomBytes(12).toString("hex")}&STUDY_ID=s1&SESSION_ID=1`;
/** @param {string} slug */
const link = (slug) => `${server}/s/${slug}?${invitation()}`;

/**
 * A picture, no violation, and nothing that sticks out of the window.
 * @param {Participant} who
 * @param {Page} page
 * @param {string} what
 */
async function look(who, page, what) {
  await who.look(page, what);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(wide <= 0, `${what} is ${wide} px wider than the window`);
}

/**
 * Tab until the element has the focus.
 * @param {Page} page
 * @param {Locator} target
 */
async function tabTo(page, target) {
  const handle = await target.elementHandle();
  for (let presses = 0; presses < 150; presses += 1) {
    if (await page.evaluate((element) => document.activeElement === element, handle)) return;
    await page.keyboard.press("Tab");
  }
  assert.fail(`no Tab leads to ${target}`);
}

/**
 * @param {Page} page
 * @param {Locator} target
 * @param {string} [key]
 */
async function use(page, target, key = "Enter") {
  await tabTo(page, target);
  await page.keyboard.press(key);
}

/**
 * @param {Page} page
 * @param {string} name
 */
const button = (page, name) => page.getByRole("button", { name });

/**
 * @param {Participant} who
 * @param {Page} page
 * @param {string} slug
 */
async function enter(who, page, slug) {
  await page.goto(link(slug));
  await page.locator("#check").waitFor();
  await look(who, page, "gate");
  const before = await page.locator(".decide").boundingBox();
  await passGate(page);
  assert.deepEqual(await page.locator(".decide").boundingBox(), before, "nothing jumps");
  await look(who, page, "consent");
  await use(page, page.locator("[name=read]"), "Space");
  await use(page, button(page, "I agree, start"));
  await page.waitForURL(/\/p\//);
  told.key = String(page.url().split("/p/")[1]);
}

/** Keys that the instructions ask for, and those that play a round. @type {Record<string, { probe: string[], play: string[] }>} */
const HANDS = {
  parent: { probe: ["ArrowLeft"], play: ["ArrowUp", "ArrowLeft"] },
  child: { probe: ["4"], play: ["5"] },
  driver: { probe: ["f", "j"], play: ["j", "j", "f"] },
};

/**
 * @param {Participant} who
 * @param {Page} page
 */
async function readInstructions(who, page) {
  const role = String(await page.locator("#probe").getAttribute("data-role"));
  await page.locator("#example-picture > svg").waitFor();
  const letters = await page.locator(".callouts .mark:not(.mark-none)").allTextContents();
  await look(who, page, `instructions-${role}`);
  await use(page, button(page, "Pause"));
  await page.locator("#example-play", { hasText: "Play" }).waitFor();
  assert.ok(letters.length >= 3);
  for (const key of HANDS[role]?.probe ?? []) await page.keyboard.press(key);
  await page.locator("#received .badge").waitFor();
  await use(page, button(page, "Next"));
}

/**
 * All rounds of a page. The board stays where it is, whatever the bar says.
 * @param {Participant} who
 * @param {Page} page
 */
async function playRounds(who, page) {
  const role = String(
    await page.evaluate(() => JSON.parse(document.querySelector("#page-data")?.textContent ?? "").role),
  );
  const board = page.locator(".board-wrap");
  await board.waitFor();
  const place = await board.boundingBox();
  const fits = await page.evaluate(() => document.documentElement.scrollHeight <= innerHeight);
  assert.ok(fits, "a round needs no scrolling");
  await look(who, page, `round-${role}`);
  const before = await roundsLeft(page);
  for (let played = 0, url = page.url(); page.url() === url; played += 1) {
    for (let i = 0; await playing(page); i += 1) {
      await page.keyboard.press(String(HANDS[role]?.play[i % 3] ?? HANDS[role]?.play[i % 2] ?? "5"));
      await page.waitForTimeout(30);
    }
    await result(page);
    assert.deepEqual(await board.boundingBox(), place, "the board has not moved");
    const practice = /does not count/.test(String(await page.locator("#far").textContent()));
    await page.waitForTimeout(50);
    assert.ok((await roundsLeft(page)) < before || practice, "the bar counts down");
    if (played === 0) await look(who, page, `round-over-${role}`);
    if (await leaveRound(page)) return;
  }
}

/** @param {Page} page */
const roundsLeft = async (page) => Number.parseInt(String(await page.locator("#bar-rounds").textContent()), 10);

/** What to choose, by words in the question or else by kind: the right answers of journeys.py. @type {[RegExp, number][]} */
const CHOICES = [
  [/how many signs|time limit|Green/i, 1],
  [/./, 0],
];

/**
 * Answers a question with the keyboard.
 * @param {Page} page
 * @param {Locator} item
 * @param {number} number
 */
async function answer(page, item, number) {
  const kind = await item.getAttribute("data-kind");
  const key = String(await item.getAttribute("data-key"));
  const control = item.locator("input:not([type=hidden]), textarea").first();
  await tabTo(page, control);
  if (kind === "text" || kind === "number") {
    const text = kind === "number" ? "42" : "Looking twice.";
    await page.keyboard.type(text);
    told.answers[key] = text;
    return;
  }
  const text = String(await item.locator("legend").textContent());
  const steps = kind === "scale" ? 5 + number : (CHOICES.find(([words]) => words.test(text))?.[1] ?? 0);
  await page.keyboard.press("Space");
  for (let i = 0; i < steps; i += 1) await page.keyboard.press("ArrowDown");
  told.answers[key] = await item.locator("input:checked").inputValue();
}

/**
 * A form: sent empty first (said what is missing, focus there), then answered and sent with Enter.
 * @param {Participant} who
 * @param {Page} page
 */
async function fillIn(who, page) {
  const name = String(await page.locator("[name=form]").inputValue()).replace(":", "-");
  await look(who, page, `form-${name}`);
  await use(page, button(page, "Continue"));
  const required = page.locator("fieldset[data-required]");
  assert.equal(await page.locator("fieldset[data-wrong]").count(), await required.count());
  assert.match(String(await required.first().locator(".why").textContent()), /Please answer/);
  const [first, focused] = await Promise.all([
    required.first().getAttribute("data-key"),
    page.evaluate(() => document.activeElement?.closest("fieldset")?.dataset.key),
  ]);
  assert.equal(focused, first, "the focus is at the first one");
  await look(who, page, `form-${name}-empty`);
  await page.keyboard.press("Shift+Tab");
  const items = await page.locator("fieldset").all();
  for (const [number, item] of items.entries()) await answer(page, item, number);
  assert.equal(await page.locator("fieldset[data-wrong]").count(), 0);
  await look(who, page, `form-${name}-filled`);
  await keepsItsAnswers(page);
  await page.locator("input:checked, input.field-number").first().focus();
  await page.keyboard.press("Enter");
}

/** A reload loses nothing. @param {Page} page */
async function keepsItsAnswers(page) {
  const answered = await page.locator("#answered").textContent();
  await page.reload();
  await page.waitForFunction((text) => document.querySelector("#answered")?.textContent === text, answered);
}

/**
 * Three signs are marked, one of them twice, one taken away again.
 * @param {Participant} who
 * @param {Page} page
 */
async function markSigns(who, page) {
  await page.locator("#mark-board .board-wrap svg").waitFor();
  await look(who, page, "probe");
  const fits = await page.evaluate(() => document.documentElement.scrollHeight <= innerHeight);
  assert.ok(fits, "the probe needs no scrolling");
  for (const keys of ["3 ArrowUp Enter", "5 ArrowRight Enter", "7 Enter Delete", "3 ArrowUp Enter"]) {
    for (const key of keys.split(" ")) await page.keyboard.press(key);
  }
  assert.match(String(await page.locator("#mark-told").textContent()), /Sign 3 is at row 3, column 5/);
  const box = await page.locator("#mark-board .board-wrap").boundingBox();
  await page.keyboard.press("9");
  if (box) await page.mouse.click(box.x + 5, box.y + 5);
  Object.assign(told.answers, { sign_3: "2,4", sign_5: "3,5", sign_7: "", sign_9: "0,0" });
  await look(who, page, "probe-marked");
  await keepsItsAnswers(page);
  await use(page, button(page, "Continue"));
}

/**
 * Page after page, as they come, until the code.
 * @param {Participant} who
 * @param {Page} page
 */
async function goThrough(who, page) {
  const seen = new Set();
  for (let pages = 0; pages < 40; pages += 1) {
    await page.locator("#probe, #answers, #strip, main.done").first().waitFor();
    if (await page.locator("main.done").count()) return;
    const kind = await onward(who, page);
    seen.add(kind);
    await page.waitForLoadState("load");
    await page.waitForTimeout(150);
  }
  assert.fail(`no end after ${[...seen]}`);
}

/**
 * @param {Participant} who
 * @param {Page} page
 */
async function onward(who, page) {
  const doing = (await page.locator("#probe").count())
    ? readInstructions
    : (await page.locator("#mark-board").count())
      ? markSigns
      : (await page.locator("#answers").count())
        ? fillIn
        : playRounds;
  await page.evaluate(() => Object.assign(window, { before: true }));
  await doing(who, page);
  await page.waitForFunction(() => !("before" in window));
  return doing.name;
}

/**
 * @param {string} slug
 * @param {keyof typeof SIZES} size
 */
async function whole(slug, size) {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await enter(who, page, slug);
    await goThrough(who, page);
    await page.locator("#code").waitFor();
    await use(page, button(page, "Stay on this page"));
    await look(who, page, "finished");
  };
  await Participant.with(`${slug}-${size}`, artefacts, visit, SIZES[size]);
}

const PHONE = {
  userAgent:
    "Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/18.0 Mobile/15E148 Safari/604.1",
  hasTouch: true,
  isMobile: true,
};

/** A phone is told at once and nothing is sent; only the person tells the site. */
async function phone() {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    /** @type {string[]} */ const posted = [];
    page.on("request", (request) => request.method() === "POST" && posted.push(request.url()));
    await page.goto(link("whole-traffic"));
    await page.getByRole("heading", { name: "This study needs a computer" }).waitFor();
    await look(who, page, "told");
    await page.waitForTimeout(1500);
    assert.deepEqual(posted, [], "nothing is sent by itself");
    await button(page, "This device does not fit").click();
    await page.locator("#code").waitFor();
    assert.match(String(await page.locator("main").textContent()), /phone or a tablet/);
    await look(who, page, "screened-out");
  };
  await Participant.with("phone", artefacts, visit, { width: 390, height: 800 }, PHONE);
}

/** The consent can be read and declined while the window is too small, and given once it is large enough. */
async function smallGate() {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await page.goto(link("whole-traffic"));
    for (const key of ["j", "f"]) await page.keyboard.press(key);
    await page.locator("[data-check=frames].is-good").waitFor();
    assert.match(String(await page.locator("[data-check=viewport]").textContent()), /at least 1024 by 640/);
    assert.ok(!(await button(page, "I agree, start").isVisible()));
    await look(who, page, "too-small");
    assert.equal(await page.locator("#unfit").getAttribute("value"), "viewport");
    await page.setViewportSize(SIZES.small);
    await page.locator("#fits").waitFor();
    await button(page, "I agree, start").waitFor();
  };
  await Participant.with("small-gate", artefacts, visit, { width: 900, height: 640 });
}

/** Little motion is wished: the example stands still until it is asked for. */
async function still() {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await page.goto(link("whole-traffic"));
    await passGate(page);
    await page.locator("[name=read]").check();
    await button(page, "I agree, start").click();
    await page.locator("#example-picture > svg").waitFor();
    const picture = () => page.locator("#example-picture").innerHTML();
    const first = await picture();
    await page.waitForTimeout(3000);
    assert.equal(await picture(), first);
    await look(who, page, "instructions");
    await button(page, "Show the example").click();
    await page.waitForFunction((html) => document.querySelector("#example-picture")?.innerHTML !== html, first);
  };
  await Participant.with("still", artefacts, visit, SIZES.large, { reducedMotion: "reduce" });
}

/** Help is there during a round, full screen is offered, and leaving takes two steps and no reason. */
async function leave() {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await enter(who, page, "whole-traffic");
    await readInstructions(who, page);
    const board = page.locator(".board-wrap svg");
    await board.waitFor();
    const place = await board.boundingBox();
    await use(page, page.locator("#help summary"));
    await look(who, page, "help");
    assert.deepEqual(await board.boundingBox(), place);
    await page.keyboard.press("Escape");
    assert.equal(await page.locator("#help[open]").count(), 0);
    await use(page, button(page, "Full screen"));
    await button(page, "Leave full screen").waitFor();
    await use(page, button(page, "Leave full screen"));
    await button(page, "Full screen").waitFor();
    await use(page, page.getByRole("link", { name: "Stop taking part" }));
    await page.locator("#withdraw").waitFor();
    await look(who, page, "withdraw");
    await use(page, button(page, "Stop, and keep my data"));
    await page.locator("#code").waitFor();
    await look(who, page, "withdrawn");
  };
  await Participant.with("leave", artefacts, visit, SIZES.small);
}

/** Every question of the quiz is answered wrongly, twice. */
async function failQuiz() {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await enter(who, page, "whole-traffic");
    await onward(who, page);
    await onward(who, page);
    for (const what of ["first", "second"]) {
      await page.locator("#answers").waitFor();
      await look(who, page, `quiz-${what}`);
      for (const item of await page.locator("fieldset").all()) {
        await tabTo(page, item.locator("input").first());
        await page.keyboard.press("Space");
        await page.keyboard.press("ArrowDown");
      }
      await page.keyboard.press("Enter");
      await page.waitForLoadState("load");
      if (what === "first") await page.getByText("answer again").waitFor();
    }
    await page.locator("main.done").waitFor();
    await look(who, page, "screened-out");
  };
  await Participant.with("fail-quiz", artefacts, visit, SIZES.small);
}

/**
 * The end that somebody has come to.
 * @param {string} key
 * @param {string} state
 */
async function end(key, state) {
  const visit = async (/** @type {Participant} */ who) => {
    const page = await who.tab();
    await page.goto(`${server}/p/${key}`);
    assert.equal(await page.locator("main.done").getAttribute("data-state"), state);
    assert.ok((await page.locator("main .button-primary").count()) === 1, "there is a way on");
    await look(who, page, state);
  };
  await Participant.with("end", artefacts, visit, SIZES.small);
}

/** @type {Record<string, (...words: string[]) => Promise<void>>} */
const SCENARIOS = {
  whole: (slug = "", size = "") => whole(slug, /** @type {keyof typeof SIZES} */ (size)),
  phone,
  small_gate: smallGate,
  still,
  leave,
  fail_quiz: failQuiz,
  end: (key = "", state = "") => end(key, state),
};

const visit = SCENARIOS[scenario];
assert.ok(visit, `no scenario ${scenario}; there are ${Object.keys(SCENARIOS).join(", ")}`);
await visit(...more);
console.log(JSON.stringify(told));
