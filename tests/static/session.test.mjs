// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Outbox } from "../../static/js/lib/outbox.js";
import { Session } from "../../static/js/lib/session.js";
import { Transport } from "../../static/js/lib/transport.js";
import { driverView, parentView } from "./example/worlds.js";
import { FakeStorage, fakeServer } from "./fakes.mjs";

const URLS = { round: "/p/k/round", step: "/p/k/step", page: "/p/k" };
/** @type {any} */ const TIMING = { rt_ms: 300 };

/**
 * @param {Parameters<typeof fakeServer>[0]} answers
 * @param {FakeStorage} [storage]
 */
function page(answers, storage = new FakeStorage()) {
  const server = fakeServer(answers);
  /** @type {any[]} */ const said = [];
  /** @type {string[]} */ const left = [];
  const session = new Session({
    urls: URLS,
    transport: new Transport(server.seams),
    outbox: new Outbox(URLS.page, storage),
    storage,
    say: (message) => said.push(message),
    leave: (url) => left.push(url),
  });
  return { session, said, left, storage, ...server };
}

test("a fresh round is no second look", async () => {
  const { session, requests } = page([{ status: 200, body: parentView() }]);
  const view = await session.open(null);
  assert.equal(view?.resumed, false);
  assert.deepEqual(requests, [{ url: URLS.round, body: { after: null } }]);
});

test("a decision carries the seq that it makes, and the answer is the next view", async () => {
  const after = parentView({ seq: 6, step: 6 });
  const { session, requests, storage } = page([{ status: 200, body: after }]);
  const next = await session.decide(parentView({ seq: 5 }), 2, TIMING);
  assert.equal(next?.seq, 6);
  assert.deepEqual(requests[0], { url: URLS.step, body: { round: 7, seq: 6, action: 2, timing: TIMING } });
  assert.equal(storage.items.size, 0, "confirmed, so the outbox is empty");
});

test("a reload in the middle of a round is flagged", async () => {
  const { session } = page([{ status: 200, body: parentView({ seq: 5 }) }]);
  assert.equal((await session.open(null))?.resumed, true);
});

test("a reload before the first decision is flagged once the picture has been seen", async () => {
  const storage = new FakeStorage();
  page([], storage).session.shown(parentView());
  const { session } = page([{ status: 200, body: parentView() }], storage);
  assert.equal((await session.open(null))?.resumed, true);
});

test("an action that a reload left behind is sent first, byte for byte", async () => {
  const storage = new FakeStorage();
  const lost = page([], storage);
  void lost.session.decide(parentView({ seq: 5 }), 2, TIMING);
  const again = page(
    [
      { status: 200, body: parentView({ seq: 6 }) },
      { status: 200, body: parentView({ seq: 6 }) },
    ],
    storage,
  );
  const view = await again.session.open(null);
  assert.deepEqual(again.requests[0], { url: URLS.step, body: { round: 7, seq: 6, action: 2, timing: TIMING } });
  assert.equal(again.requests[1]?.url, URLS.round);
  assert.equal(view?.seq, 6);
  assert.equal(storage.items.size, 0);
});

test("a left-behind action that ended its round shows that round's end", async () => {
  const storage = new FakeStorage();
  new Outbox(URLS.page, storage).put({ round: 7, seq: 9, action: 0, timing: {} });
  const over = parentView({ seq: 9, over: { outcome: "found", last: false } });
  const { session, requests } = page(
    [
      { status: 200, body: over },
      { status: 200, body: over },
    ],
    storage,
  );
  assert.equal((await session.open(null))?.over?.outcome, "found");
  assert.deepEqual(requests[1]?.body, { after: null });
});

test("a left-behind action that came too late is thrown away", async () => {
  const storage = new FakeStorage();
  new Outbox(URLS.page, storage).put({ round: 7, seq: 2, action: 0, timing: {} });
  const now = parentView({ seq: 4 });
  const { session } = page(
    [
      { status: 409, body: { view: now } },
      { status: 200, body: now },
    ],
    storage,
  );
  assert.equal((await session.open(null))?.seq, 4);
  assert.equal(storage.items.size, 0);
});

test("a stale decision adopts the view that the server returns, and says so", async () => {
  const { session } = page([{ status: 409, body: { view: parentView({ seq: 9 }) } }]);
  const next = await session.decide(parentView({ seq: 5 }), 2, TIMING);
  assert.equal(next?.seq, 9);
  assert.equal(next?.resumed, true);
  assert.equal(next?.notice?.title, "Carried on");
});

test("a lost connection flags the next decision, and nothing is lost", async () => {
  const { session, requests } = page(["down", "down", { status: 200, body: parentView({ seq: 6 }) }]);
  const next = await session.decide(parentView({ seq: 5 }), 2, TIMING);
  assert.equal(next?.resumed, true);
  assert.equal(requests.length, 3);
  const { session: calm } = page([{ status: 200, body: parentView({ seq: 7 }) }]);
  assert.equal((await calm.decide(parentView({ seq: 6 }), 2, TIMING))?.resumed, false);
});

test("a page that the server names is gone to", async () => {
  const { session, left } = page([{ status: 200, body: { page: "/p/k" } }]);
  assert.equal(await session.open(7), null);
  assert.deepEqual(left, ["/p/k"]);
});

test("what is neither view nor page is said, and never leads into a loop of reloads", async () => {
  for (const status of [403, 404, 410, 413, 422]) {
    const { session, said, left } = page([{ status, body: { title: "no" } }]);
    assert.equal(await session.open(null), null);
    assert.equal(said[0].title, "Something went wrong");
    assert.deepEqual(left, []);
    said[0].button.press();
    assert.deepEqual(left, ["/p/k"]);
  }
});

test("a refused decision is said, and never sent again", async () => {
  const { session, said, left, storage } = page([{ status: 422, body: {} }]);
  assert.equal(await session.decide(parentView(), 2, TIMING), null);
  assert.equal(said[0].title, "Something went wrong");
  assert.deepEqual(left, []);
  assert.equal(storage.items.size, 0);
});

test("roads come once a round and are kept for the steps", async () => {
  const { roads, ...bare } = driverView({ seq: 1 });
  const { session } = page([
    { status: 200, body: driverView() },
    { status: 200, body: bare },
  ]);
  await session.open(null);
  const next = await session.decide(driverView(), 0, TIMING);
  assert.deepEqual(next?.role === "driver" ? next.roads : null, roads);
});

test("a page of questions in between does not bring back the end of a round that was left", async () => {
  const storage = new FakeStorage();
  const before = page([{ status: 200, body: { page: "/p/k" } }], storage);
  await before.session.open(7);
  const after = page([{ status: 200, body: parentView({ round: 8 }) }], storage);
  const view = await after.session.open(null);
  assert.deepEqual(after.requests[0]?.body, { after: 7 });
  assert.equal(view?.resumed, false);
  storage.broken = true;
  const blind = page([{ status: 200, body: parentView() }], storage);
  await blind.session.open(null);
  assert.deepEqual(blind.requests[0]?.body, { after: null });
});
