// @ts-check
// `node tests/e2e/play.mjs <scenario> <server> <artefacts>`: one participant from link to code in real Chromium.
// Prints one JSON line: what the browser sent, for the test to compare with the database.

import assert from "node:assert/strict";
import { randomBytes } from "node:crypto";
import { serve } from "../static/serve.mjs";
import {
  drawn,
  leaveRound,
  Participant,
  passGate,
  playing,
  press,
  ready,
  result,
  SIZES,
  steps,
  strip,
} from "./browser.mjs";

/** @import { Page } from "playwright-core" */

const [scenario = "", server = "", artefacts = ""] = process.argv.slice(2);

/**
 * @param {string} name
 * @param {(participant: Participant) => Promise<void>} go
 * @param {{ width: number, height: number }} [size]
 */
async function as(name, go, size) {
  /** @type {Participant | undefined} */ let who;
  const visiting = async (/** @type {Participant} */ each) => {
    who = each;
    await go(each);
  };
  await Participant.with(name, artefacts, visiting, size);
  return /** @type {Participant} */ (/** @type {unknown} */ (who));
}

/** Prolific's parameters, for somebody new. */
const invitation = () =>
  `PROLIFIC_PID=${randomBytes(12).toString("hex")}&STUDY_ID=s1&SESSION_ID=${randomBytes(12).toString("hex")}`;

/**
 * Reads the consent page, forgets the tick first, then agrees.
 * @param {Participant} who
 * @param {Page} page
 */
async function consent(who, page) {
  await passGate(page);
  await who.look(page, "consent");
  await page.getByRole("button", { name: "I agree, start" }).click();
  assert.match(String(await page.locator("#why").textContent()), /tick this box/);
  assert.equal(await page.evaluate(() => document.activeElement?.getAttribute("name")), "read");
  await who.look(page, "consent-unticked");
  await page.keyboard.press("Space");
  await page.getByRole("button", { name: "I agree, start" }).click();
  await page.waitForURL(/\/p\//);
}

/**
 * Reads how to play; "Next" asks for the keys first.
 * @param {Participant} who
 * @param {Page} page
 * @param {string} what
 * @param {string[]} keys
 */
async function instructions(who, page, what, keys) {
  await page.locator("#example-play").waitFor(); // shown once the page hears keys
  await page.getByRole("button", { name: "Next" }).click();
  assert.match(String(await page.locator("#why").textContent()), /Press/);
  for (const key of keys) await page.keyboard.press(key);
  await page.locator("#received .badge").waitFor();
  await who.look(page, `instructions-${what}`);
  await page.getByRole("button", { name: "Next" }).click();
  await page.locator(".board-wrap svg").waitFor();
}

const EXAMPLES = {
  parent: [...Array(6).fill("ArrowLeft"), ...Array(3).fill("ArrowUp")],
  child: ["9"],
  driver: ["f", ...Array(15).fill("j")],
};

const ARROWS = ["ArrowUp", "ArrowLeft", "ArrowUp", "ArrowRight", "ArrowRight", "ArrowDown"];

/**
 * Walks until the round is over.
 * @param {Page} page
 */
async function search(page) {
  for (let i = 0; await playing(page); i += 1) await press(page, ARROWS[i % ARROWS.length] ?? "ArrowUp");
  return result(page);
}

/**
 * Goes (with a brake now and then) until the round is over.
 * @param {Page} page
 */
async function drive(page) {
  for (let i = 0; await playing(page); i += 1) await press(page, i % 5 === 3 ? "f" : "j");
  return result(page);
}

/** @param {string} base */
async function parentChild(base) {
  return as("parent-child", async (who) => {
    const page = await who.tab();
    await page.goto(`${base}/s/short-parent-child?${invitation()}`);
    await consent(who, page);
    for (let block = 0; block < 2; block += 1) {
      await page.locator("#example-play").waitFor(); // shown once the page hears keys
      const role = await page.locator("#probe").getAttribute("data-role");
      await instructions(who, page, String(role), role === "parent" ? ["ArrowLeft"] : ["4"]);
      if (role === "parent") await asParent(who, page);
      else await asChild(who, page);
    }
    await complete(who, page);
  });
}

/**
 * Practice and two rounds; the page is loaded again in the middle of the first, and at its end.
 * @param {Participant} who
 * @param {Page} page
 */
async function asParent(who, page) {
  assert.match(String(await strip(page)), /does not count/);
  await press(page, "ArrowUp");
  await who.look(page, "parent-practice");
  await search(page);
  await who.look(page, "parent-practice-over");
  await leaveRound(page);
  await who.look(page, "parent-round");
  await page.keyboard.press("ArrowLeft");
  await press(page, "ArrowUp");
  if (await playing(page)) {
    const before = [await steps(page), await page.locator(".board-wrap svg").getAttribute("aria-label")];
    await page.reload();
    await page.locator(".board-wrap svg").waitFor();
    assert.deepEqual(
      [await steps(page), await page.locator(".board-wrap svg").getAttribute("aria-label")],
      before,
      "same step after a reload",
    );
  }
  const said = await search(page);
  await who.look(page, "parent-round-over");
  await page.reload();
  assert.equal(await result(page), said, "a reload shows the end again");
  await leaveRound(page);
  await search(page);
  await page.keyboard.press("Space");
}

/**
 * Practice and two rounds: one by digit, one by a click on the plane.
 * @param {Participant} who
 * @param {Page} page
 */
async function asChild(who, page) {
  await ready(page);
  await who.look(page, "child-practice");
  await page.keyboard.press("5");
  await result(page);
  await leaveRound(page);
  await ready(page);
  await page.locator("[data-number='3']").hover();
  await who.look(page, "child-round");
  await page.keyboard.press("3");
  await page.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("Replay"));
  await who.look(page, "child-replay");
  await result(page);
  await who.look(page, "child-round-over");
  await leaveRound(page);
  await ready(page);
  await page.locator("[data-number='7']").click();
  await result(page);
  await page.keyboard.press("Space");
}

/**
 * The code, and the way back that would go by itself.
 * @param {Participant} who
 * @param {Page} page
 */
async function complete(who, page) {
  await page.locator("#code").waitFor();
  await page.getByRole("button", { name: "Stay on this page" }).click();
  assert.match(String(await page.locator("#code").textContent()), /\S{4,}/);
  assert.match(String(await page.locator("#return").getAttribute("href")), /^https:\/\/app\.prolific\.com\//);
  await who.look(page, "complete");
  await page.reload();
  await page.locator("#code").waitFor();
}

/** @param {string} base */
async function traffic(base) {
  return as(
    "traffic",
    async (who) => {
      const page = await who.tab();
      await page.goto(`${base}/s/short-traffic?${invitation()}`);
      await consent(who, page);
      await instructions(who, page, "driver", ["f", "j"]);
      await press(page, "j");
      await who.look(page, "driver-practice");
      await drive(page);
      await who.look(page, "driver-practice-over");
      await leaveRound(page);
      await who.look(page, "driver-round");
      await offline(who, page);
      await drive(page);
      await who.look(page, "driver-round-over");
      await leaveRound(page);
      await secondTab(who, page);
      await drive(page);
      await leaveRound(page);
      await drive(page);
      await page.keyboard.press("Space");
      await complete(who, page);
    },
    SIZES.small,
  );
}

/**
 * The network goes and comes back: the action is kept, and the board stays.
 * @param {Participant} who
 * @param {Page} page
 */
async function offline(who, page) {
  await ready(page);
  const before = await steps(page);
  await who.context.setOffline(true);
  await page.keyboard.press("f");
  await page.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("Connection lost"));
  await who.look(page, "driver-connection-lost");
  await page.keyboard.press("f");
  await page.waitForTimeout(1200);
  assert.equal(await steps(page), before, "nothing moves without the server");
  await who.context.setOffline(false);
  await page.waitForFunction(
    (count) => Number(document.querySelector(".meter .value b")?.textContent) === count,
    before + 1,
  );
  assert.equal(await page.locator("body.paused").count(), 0);
}

/**
 * The same session in a second tab: the first stops and says so, and takes the round back when asked to.
 * @param {Participant} who
 * @param {Page} page
 */
async function secondTab(who, page) {
  await ready(page);
  await press(page, "f");
  const newer = await who.tab();
  await newer.goto(page.url());
  await ready(newer);
  assert.equal(await steps(newer), await steps(page), "the newer tab goes on at the same step");
  await page.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("Open in another tab"));
  await who.look(page, "driver-second-tab");
  const before = await steps(page);
  await page.keyboard.press("f");
  await page.waitForTimeout(300);
  assert.equal(await steps(page), before, "the older tab takes no keys");
  await press(newer, "f");
  await page.bringToFront();
  await page.getByRole("button", { name: "Continue here" }).click();
  await newer.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("Open in another tab"));
  await ready(page);
  assert.equal(await steps(page), await steps(newer), "back in the first tab at the step of the second");
}

/** @param {string} base */
async function decline(base) {
  return as("decline", async (who) => {
    const page = await who.tab();
    await page.goto(`${base}/s/short-traffic`);
    await page.getByRole("button", { name: "I do not want to take part" }).click();
    await page.locator("main.done h1").waitFor();
    await who.look(page, "declined");
    await page.goto(`${base}/s/no-such-study`);
    await who.look(page, "unknown-study");
    await page.goto(`${base}/p/${"x".repeat(43)}`);
    await who.look(page, "unknown-session");
    await page.goto(`${base}/s/short-traffic?assignmentId=ASSIGNMENT_ID_NOT_AVAILABLE&hitId=h1`);
    await who.look(page, "preview");
  });
}

/**
 * The server has the step but its answer never arrives; then the page is loaded again while a step is under way.
 * @param {string} base
 */
async function lostAnswer(base) {
  return as("lost-answer", async (who) => {
    const page = await who.tab();
    await page.goto(`${base}/s/short-traffic?${invitation()}`);
    await consent(who, page);
    await instructions(who, page, "again", ["f", "j"]);
    let swallowed = 0;
    await page.route("**/step", async (route) => {
      if (swallowed >= 2) return route.continue();
      swallowed += 1;
      await route.fetch();
      await route.abort();
    });
    await press(page, "j");
    assert.equal(swallowed, 2);
    assert.equal(await steps(page), 1, "one press is one step, however often it was sent");
    await page.unroute("**/step");
    await page.route("**/step", (route) => route.abort());
    await ready(page);
    await page.keyboard.press("j");
    await page.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("Connection lost"));
    await page.unroute("**/step");
    await page.reload();
    await ready(page);
    assert.equal(await steps(page), 2, "the kept step was sent after the reload");
    await drive(page);
  });
}

/**
 * Somebody else took the next step (a tab that this one knows nothing of): the server's view is adopted, and it is said.
 * @param {Participant} who
 * @param {Page} page
 */
async function movedOn(who, page) {
  await ready(page);
  const mine = [...who.sent.values()].map((body) => JSON.parse(body)).at(-1);
  const status = await page.evaluate(
    async (step) => {
      const { step_url } = JSON.parse(document.querySelector("#page-data")?.textContent ?? "{}");
      const headers = { "content-type": "application/json" };
      return (await fetch(step_url, { method: "POST", headers, body: JSON.stringify(step) })).status;
    },
    { ...mine, seq: mine.seq + 1, action: 1, timing: { ...mine.timing, hidden: false } },
  );
  assert.equal(status, 200);
  await page.keyboard.press("j");
  await page.waitForFunction(() => document.querySelector("#strip")?.textContent?.includes("went on elsewhere"));
  assert.equal(await steps(page), 3, "one step was made, not two");
  await who.look(page, "moved-on");
  await press(page, "j");
  assert.equal(await steps(page), 4);
}

/**
 * The page is hidden for a while, as behind another window.
 * @param {Page} page
 */
async function hide(page) {
  await ready(page);
  const show = (/** @type {string} */ state) =>
    page.evaluate((value) => {
      Object.defineProperty(document, "visibilityState", { value, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    }, state);
  const before = await steps(page);
  await show("hidden");
  await page.keyboard.press("j");
  await page.waitForTimeout(200);
  assert.equal(await steps(page), before, "nobody sees the board");
  await show("visible");
  await drawn(page);
  await press(page, "j");
}

/** The example page: both plugins in an experiment that knows no hatlab server. */
async function example() {
  const { url, close } = await serve();
  return as("example", async (who) => {
    const page = await who.tab();
    for (const [role, keys] of Object.entries(EXAMPLES)) {
      await page.goto(`${url}/example/?role=${role}`);
      for (const key of keys) {
        await ready(page);
        await page.keyboard.press(key);
        await page.waitForTimeout(80);
      }
      await page.locator(".strip .button-primary").waitFor();
      await who.look(page, role);
      await page.keyboard.press("Space");
      await page.waitForFunction(() => "last" in globalThis);
      const data = await page.evaluate(() => /** @type {any} */ (globalThis).last);
      assert.match(data.outcome, /found|arrived/);
      assert.equal(data.decisions.length, keys.length);
      assert.ok(data.decisions.every((/** @type {any} */ { timing }) => timing.is_trusted && timing.rt_ms > 0));
    }
    close();
  });
}

/** @param {string} base */
async function smallWindow(base) {
  return as("small-window", async (who) => {
    const page = await who.tab();
    await page.goto(`${base}/s/short-traffic?${invitation()}`);
    await consent(who, page);
    await instructions(who, page, "small", ["f", "j"]);
    await press(page, "j");
    await page.setViewportSize({ width: 900, height: 640 });
    await page.locator("#cover").waitFor();
    await who.look(page, "too-small");
    await page.keyboard.press("j");
    await page.setViewportSize(SIZES.small);
    await page.locator("#cover").waitFor({ state: "hidden" });
    assert.equal(await steps(page), 1, "a covered board takes no keys");
    await drawn(page);
    await press(page, "j");
    assert.equal(await steps(page), 2);
    await movedOn(who, page);
    await hide(page);
  });
}

/** @type {Record<string, (server: string) => Promise<Participant>>} */
const SCENARIOS = {
  parent_child: parentChild,
  traffic,
  decline,
  lost_answer: lostAnswer,
  small_window: smallWindow,
  example,
};

const visit = SCENARIOS[scenario];
assert.ok(visit, `no scenario ${scenario}; there are ${Object.keys(SCENARIOS).join(", ")}`);
const participant = await visit(server);
console.log(JSON.stringify({ scenario, sent: [...participant.sent.values()].map((body) => JSON.parse(body)) }));
