// @ts-check
// `node tests/e2e/admin.mjs <server> <artefacts> <password>`: an experimenter in real Chromium, from sign-in to live counts.

import assert from "node:assert/strict";
import { Participant, SIZES } from "./browser.mjs";

/** @import { Page } from "playwright-core" */

const [server = "", artefacts = "", password = ""] = process.argv.slice(2);
const STUDY = "short-traffic";
const COPY = "evening-traffic";

/**
 * Signs in without a pointer.
 * @param {Page} page
 */
async function signIn(page) {
  await page.goto(`${server}/admin/studies/${STUDY}`);
  assert.match(page.url(), /\/admin\/login\?next=/);
  await page.keyboard.press("Tab");
  await page.keyboard.type("admin");
  await page.keyboard.press("Tab");
  await page.keyboard.type(password);
  await page.keyboard.press("Enter");
  await page.waitForURL(`${server}/admin/studies/${STUDY}`);
}

/**
 * Every page fits the window and axe-core finds nothing.
 * @param {Participant} who
 * @param {Page} page
 */
async function walk(who, page) {
  const pages = [
    ["studies", "/admin"],
    ["new", "/admin/studies/new"],
    ["build", "/admin/studies/short-parent-child"],
    ["broken", "/admin/studies/traffic-junction"],
    ["monitor", "/admin/studies/short-parent-child/monitor"],
    ["close", "/admin/studies/short-parent-child/close"],
    ["agents", "/admin/agents"],
    ["agent", "/admin/agents/parent_child/prototype-9"],
  ];
  for (const [name = "", path] of pages) {
    await page.goto(`${server}${path}`);
    await who.look(page, name);
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(over <= 0, `${name} is ${over} px wider than the window`);
    assert.equal(await page.locator("h1").count(), 1, name);
  }
}

/**
 * A copy, a mistake, its message at the field, the correction, the launch.
 * @param {Participant} who
 * @param {Page} page
 */
async function build(who, page) {
  await page.goto(`${server}/admin/studies/new`);
  await page.getByLabel("Title").fill("Evening traffic");
  await page.locator(`input[value="copy:${STUDY}"]`).check();
  await page.getByRole("button", { name: "Create draft" }).click();
  await page.waitForURL(`${server}/admin/studies/${COPY}`);

  const budget = page.getByLabel("Budget of arm 1");
  await budget.fill("0.5");
  assert.ok(await page.getByText("There are changes that are not saved.").isVisible());
  await page.keyboard.press("Enter"); // saves, and removes no arm
  const message = "Budget 0.5 does not match this agent, which was trained for 1.";
  const said = page.locator("td .error", { hasText: message });
  await said.waitFor();
  const { height = 0 } = (await said.boundingBox()) ?? {};
  assert.ok(height < 30, `the message stands in one line below its arm, not ${height} px high in its first column`);
  assert.equal(await budget.inputValue(), "0.5");
  assert.equal(await budget.getAttribute("aria-invalid"), "true");
  await who.look(page, "mistake");
  await page.getByRole("link", { name: "Budget of arm 1" }).click();
  assert.equal(await page.evaluate(() => document.activeElement?.id), "arms.0.budget");

  await page.getByLabel("Agent in arm 1").selectOption("traffic_junction/budget-100");
  assert.equal(await budget.inputValue(), "1", "an agent brings its budget");
  await page.getByRole("button", { name: "Launch version 1" }).click();
  await page.waitForURL(`${server}/admin/studies/${COPY}/launch`);
  await who.look(page, "launch");
  await page.getByRole("button", { name: "Launch version 1" }).click();
  await page.waitForURL(`${server}/admin/studies/${COPY}/monitor`);
}

/**
 * Counts that move while one looks, links that can be copied.
 * @param {Participant} who
 * @param {Page} page
 */
async function watch(who, page) {
  const playing = page.locator(".stats div", { hasText: "Playing now" }).locator("dd");
  assert.equal(await playing.textContent(), "0");
  const form = { PROLIFIC_PID: "ada", STUDY_ID: "s", SESSION_ID: "t", agree: "yes", read: "yes" };
  const entered = await page.request.post(`${server}/s/${COPY}/consent`, { form, maxRedirects: 0 });
  assert.equal(entered.status(), 303);
  await page.waitForFunction(() =>
    [...document.querySelectorAll(".stats div")].some((each) => /Playing now\s*1/.test(each.textContent ?? "")),
  );
  await who.look(page, "monitor-live");

  await who.context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.getByRole("button", { name: "Copy the link for Prolific" }).click();
  await page.getByText("Copied", { exact: true }).waitFor();
  const copied = await page.evaluate(() => navigator.clipboard.readText());
  assert.equal(
    copied,
    `${server}/s/${COPY}?PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID={{%SESSION_ID%}}`,
  );
}

/**
 * The dark theme stays, and is readable too.
 * @param {Participant} who
 * @param {Page} page
 */
async function darken(who, page) {
  await page.getByRole("button", { name: "Dark theme" }).click();
  for (const path of ["/admin", `/admin/studies/${COPY}`, `/admin/studies/${COPY}/monitor`, "/admin/agents"]) {
    await page.goto(`${server}${path}`);
    await page.locator('html[data-theme="dark"]').waitFor();
    await who.look(page, `dark${path.replaceAll("/", "-")}`);
  }
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.waitForURL(/\/admin\/login/);
  await who.look(page, "login");
}

await Participant.with("admin", artefacts, async (who) => {
  const page = await who.tab();
  await signIn(page);
  await walk(who, page);
  await build(who, page);
  await watch(who, page);
  await darken(who, page);
});
await Participant.with(
  "admin-small",
  artefacts,
  async (who) => {
    const page = await who.tab();
    await signIn(page);
    await walk(who, page);
  },
  SIZES.small,
);
