// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Outbox } from "../../static/js/lib/outbox.js";
import { DELAYS_MS, Transport } from "../../static/js/lib/transport.js";
import { FakeStorage, fakeServer } from "./fakes.mjs";

test("an answer is an answer, whatever it says", async () => {
  for (const status of [200, 404, 409, 422]) {
    const { seams, requests } = fakeServer([{ status, body: { x: 1 } }]);
    assert.deepEqual(await new Transport(seams).post("/step", {}), { status, body: { x: 1 } });
    assert.equal(requests.length, 1);
  }
});

test("a lost connection and a failing server are waited out with growing delays, and the body stays the same", async () => {
  const answers = ["down", { status: 503 }, { status: 500 }, { status: 429 }, { status: 408 }, "down", "down"];
  const { seams, requests, naps } = fakeServer(/** @type {any} */ ([...answers, { status: 200, body: {} }]));
  await new Transport(seams).post("/step", { seq: 3 });
  assert.deepEqual(naps, [...DELAYS_MS, DELAYS_MS.at(-1)]);
  assert.deepEqual(new Set(requests.map(({ body }) => JSON.stringify(body))), new Set(['{"seq":3}']));
});

test("the page is told each time it failed, and once when it works again", async () => {
  const { seams } = fakeServer(["down", "down", { status: 200, body: {} }, { status: 200, body: {} }]);
  const transport = new Transport(seams);
  /** @type {string[]} */ const told = [];
  for (const type of ["lost", "found"]) transport.addEventListener(type, () => told.push(type));
  await transport.post("/step", {});
  await transport.post("/step", {});
  assert.deepEqual(told, ["lost", "lost", "found"]);
});

test("hurrying ends the wait", async () => {
  const { seams } = fakeServer(["down", { status: 200, body: {} }]);
  /** @type {any} */ const real = { ...seams };
  delete real.wait;
  const transport = new Transport(real);
  transport.addEventListener("lost", () => setTimeout(() => transport.hurry(), 5));
  const start = performance.now();
  await transport.post("/step", {});
  assert.ok(performance.now() - start < 400, "the first delay would be half a second");
});

const STEP = { round: 3, seq: 7, action: 1, timing: { rt_ms: 310 } };

test("a kept action survives a reload and is gone once it is confirmed", () => {
  const storage = new FakeStorage();
  new Outbox("/p/key", storage).put(STEP);
  const reloaded = new Outbox("/p/key", storage);
  assert.deepEqual(reloaded.get(), STEP);
  assert.equal(new Outbox("/p/other", storage).get(), null);
  reloaded.clear();
  assert.equal(new Outbox("/p/key", storage).get(), null);
});

test("where storage is forbidden the action is kept in memory", () => {
  const storage = new FakeStorage();
  storage.broken = true;
  for (const box of [new Outbox("/p/key", storage), new Outbox("/p/key", null)]) {
    box.put(STEP);
    assert.deepEqual(box.get(), STEP);
    box.clear();
    assert.equal(box.get(), null);
  }
});

test("what another program left in storage is no action", () => {
  const storage = new FakeStorage();
  storage.setItem("hatlab:outbox:/p/key", "{broken");
  assert.equal(new Outbox("/p/key", storage).get(), null);
});
