// @ts-check
// `make screenshots`: the pictures of README and docs, taken from a real server that is played in real Chromium.
// `node tests/e2e/screenshots.mjs <folder>`; HATLAB names the command (default .venv/bin/hatlab).

import { execFile, spawn } from "node:child_process";
import { randomBytes } from "node:crypto";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { promisify } from "node:util";
import { Participant, passGate, playing, press, result } from "./browser.mjs";

/** @import { Page } from "playwright-core" */

const HATLAB = resolve(process.env.HATLAB ?? ".venv/bin/hatlab");
const FOLDER = resolve(process.argv[2] ?? "docs/images");
const PASSWORD = randomBytes(12).toString("hex");
const ROBOTS = 4;
/** Steps after which the pictures of a round are taken: enough for a path, too few for the end. */
const STEPS = 4;
/** Triangles on the picture of the junction, at least; they are looked for in so many rounds. */
const TRIANGLES = 3;
const ROUNDS = 6;

/**
 * A migrated database and a server of its own, for as long as `use` runs.
 * @param {(url: string, hatlab: (...words: string[]) => Promise<unknown>) => Promise<void>} use
 */
async function served(use) {
  const home = mkdtempSync(join(tmpdir(), "hatlab-pictures-"));
  const env = {
    ...process.env,
    HATLAB_DATABASE_URL: `sqlite:///${join(home, "hatlab.sqlite3")}`,
    HATLAB_ADMIN_PASSWORD: PASSWORD,
    OMP_NUM_THREADS: "1",
  };
  const hatlab = (/** @type {string[]} */ ...words) => promisify(execFile)(HATLAB, words, { env });
  await hatlab("init");
  const server = spawn(HATLAB, ["serve", "--port", "0"], { env, stdio: ["ignore", "pipe", "inherit"] });
  try {
    const url = await addressOf(server);
    await fetch(`${url}/healthz`); // it listens before its agents are loaded: this waits for them
    await use(url, hatlab);
  } finally {
    server.kill();
    await new Promise((ended) => server.once("exit", ended));
    rmSync(home, { recursive: true, force: true });
  }
}

/** @param {import("node:child_process").ChildProcessByStdio<null, import("node:stream").Readable, null>} server */
async function addressOf(server) {
  for await (const line of createInterface(server.stdout)) {
    const found = /listens on (\S+)/.exec(line);
    if (found?.[1]) return found[1];
  }
  throw new Error("the server ended before it listened");
}

/**
 * @param {Page} page
 * @param {string} name
 */
async function picture(page, name) {
  await page.screenshot({ path: join(FOLDER, `${name}.png`) });
  console.log(join(FOLDER, `${name}.png`));
}

/**
 * The link of somebody new.
 * @param {string} url
 * @param {string} study
 */
function invitation(url, study) {
  return `${url}/s/${study}?PROLIFIC_PID=${randomBytes(12).toString("hex")}&STUDY_ID=pictures&SESSION_ID=1`;
}

/**
 * Through consent, as far as the instructions.
 * @param {Page} page
 * @param {string} link
 */
async function enter(page, link) {
  await page.goto(link);
  await passGate(page);
  await page.locator("[name=read]").check();
  await page.getByRole("button", { name: "I agree, start" }).click();
  await page.waitForURL(/\/p\//);
}

/** Keys that the instructions ask for. @type {Record<string, string[]>} */
const PROBE = { parent: ["ArrowUp"], child: ["1"], driver: ["f", "j"] };

/** @param {Page} page */
async function readInstructions(page) {
  const role = String(await page.locator("#probe").getAttribute("data-role"));
  for (const key of PROBE[role] ?? []) await page.keyboard.press(key);
  await page.locator("#received .badge").waitFor();
  await page.getByRole("button", { name: "Next" }).click();
  await page.locator(".board-wrap svg").waitFor();
  return role;
}

/** @param {Page} page */
async function onward(page) {
  await result(page);
  const before = await page.locator("#far").textContent();
  await page.keyboard.press("Space");
  await page.waitForFunction((text) => document.querySelector("#far")?.textContent !== text, before);
}

const TOUR = ["ArrowUp", "ArrowUp", "ArrowRight", "ArrowRight", "ArrowDown", "ArrowLeft"];

/**
 * A walk until the round is over, or for so many steps.
 * @param {Page} page
 * @param {string[]} keys
 * @param {number} [most]
 */
async function go(page, keys, most = Number.POSITIVE_INFINITY) {
  for (let i = 0; i < most && (await playing(page)); i += 1) await press(page, keys[i % keys.length] ?? "");
}

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
    await enter(page, invitation(url, "parent-child"));
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
  await page.goto(`${url}/admin`);
  await page.locator("[name=username]").fill("admin");
  await page.locator("[name=password]").fill(PASSWORD);
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { name: "Studies" }).waitFor();
  for (const [name, path] of [
    ["admin-build", "/admin/studies/traffic-junction"],
    ["admin-monitor", "/admin/studies/traffic-junction/monitor?mode=robot&show=finished"],
    ["admin-agents", "/admin/agents"],
  ]) {
    await page.goto(`${url}${path}`);
    await picture(page, String(name));
  }
}

mkdirSync(FOLDER, { recursive: true });
await served(async (url, hatlab) => {
  await hatlab("simulate", "traffic-junction", "--participants", String(ROBOTS), "--seed", "1", "--url", url);
  const artefacts = join(FOLDER, "failed");
  await Participant.with("pictures", artefacts, async (who) => {
    const page = await who.tab();
    await page.goto(`${url}/s/parent-child`);
    await passGate(page);
    await picture(page, "consent");
    await enter(page, invitation(url, "traffic-junction"));
    await picture(page, "instructions");
    await drive(page);
    await bothRoles(page, url);
    await admin(page, url);
    // Taking a picture puts a style into the page, which its content policy refuses; anything else is a fault.
    who.errors = who.errors.filter((error) => !/Content Security Policy/.test(error));
  });
  rmSync(artefacts, { recursive: true, force: true });
});
