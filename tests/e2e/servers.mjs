// @ts-check
// Commands of hatlab with a database of their own, and servers for as long as they are used.

import { execFile, spawn } from "node:child_process";
import { randomBytes } from "node:crypto";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { promisify } from "node:util";

const HATLAB = resolve(process.env.HATLAB ?? ".venv/bin/hatlab");

/** @typedef {{ url: string, market: string, password: string, hatlab: (...words: string[]) => Promise<unknown> }} Served */

/**
 * A migrated database, a server, and a made-up Prolific that it recruits from.
 * @param {(served: Served) => Promise<void>} use
 */
export async function served(use) {
  const home = mkdtempSync(join(tmpdir(), "hatlab-pictures-"));
  const password = randomBytes(12).toString("hex");
  const token = randomBytes(12).toString("hex");
  const env = {
    ...process.env,
    HATLAB_DATABASE_URL: `sqlite:///${join(home, "hatlab.sqlite3")}`,
    HATLAB_ADMIN_PASSWORD: password,
    HATLAB_PROLIFIC_TOKEN: token,
    OMP_NUM_THREADS: "1",
  };
  const hatlab = (/** @type {string[]} */ ...words) => promisify(execFile)(HATLAB, words, { env });
  try {
    await hatlab("init");
    await running(["fake-prolific", "--port", "0", "--token", token], env, async (market) => {
      const recruiting = { ...env, HATLAB_PROLIFIC_API: `${market}/api/v1` };
      await reachable(recruiting, (url) => use({ url, market, password, hatlab }));
    });
  } finally {
    rmSync(home, { recursive: true, force: true });
  }
}

/**
 * A server whose links lead back to itself: its port is found by a first start.
 * @param {NodeJS.ProcessEnv} env
 * @param {(url: string) => Promise<void>} use
 */
async function reachable(env, use) {
  let found = "";
  await running(["serve", "--port", "0"], env, async (url) => {
    found = url;
  });
  const port = new URL(found).port;
  await running(["serve", "--port", port], { ...env, HATLAB_PUBLIC_URL: found }, async (url) => {
    await fetch(`${url}/healthz`); // it listens before its agents are loaded: this waits for them
    await use(url);
  });
}

/**
 * @param {string[]} words of the command
 * @param {NodeJS.ProcessEnv} env
 * @param {(url: string) => Promise<void>} use
 */
async function running(words, env, use) {
  const server = spawn(HATLAB, words, { env, stdio: ["ignore", "pipe", "inherit"] });
  const ended = new Promise((resolve) => server.once("exit", resolve));
  try {
    await use(await addressOf(server));
  } finally {
    server.kill();
    await ended;
  }
}

/** @param {import("node:child_process").ChildProcessByStdio<null, import("node:stream").Readable, null>} server */
async function addressOf(server) {
  for await (const line of createInterface(server.stdout)) {
    const found = /listens on (\S+)/.exec(line);
    if (found?.[1]) {
      server.stdout.resume();
      return found[1];
    }
  }
  throw new Error("the server ended before it listened");
}
