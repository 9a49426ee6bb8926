// @ts-check
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";

const VENDOR = new URL("../../static/vendor/", import.meta.url);
const rows = [
  ...readFileSync(new URL("VENDOR.md", VENDOR), "utf8").matchAll(/^\| (\S+\.js) \|.*\| ([0-9a-f]{64}) \|$/gm),
];

test("every vendored script is the one that VENDOR.md names", () => {
  assert.ok(rows.length >= 2);
  for (const [, file = "", sha256] of rows) {
    const content = readFileSync(new URL(file, VENDOR));
    assert.equal(createHash("sha256").update(content).digest("hex"), sha256, file);
  }
});

test("no script is vendored that VENDOR.md does not name", () => {
  const files = readdirSync(VENDOR, { recursive: true })
    .map(String)
    .filter((file) => file.endsWith(".js"));
  assert.deepEqual(files.sort(), rows.map(([, file]) => file).sort());
});
