// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { FullScreen } from "../../static/js/lib/fullscreen.js";
import { minutesSoFar, roundsLeft, roundsOver, Winnings } from "../../static/js/lib/progress.js";
import { parentView } from "./example/worlds.js";
import { FakeStorage } from "./fakes.mjs";

const FOUND = { outcome: /** @type {const} */ ("found"), last: false };

test("rounds that are over follow from the view: blocks before, rounds before, and this one once it has ended", () => {
  assert.equal(roundsOver(parentView({ block: 1, number: 1 }), 20), 0);
  assert.equal(roundsOver(parentView({ block: 1, number: 1, over: FOUND }), 20), 1);
  assert.equal(roundsOver(parentView({ block: 2, number: 7 }), 20), 26);
  assert.equal(roundsOver(parentView({ block: 2, phase: "practice", number: 1, over: FOUND }), 20), 20);
});

test("a round won counts once, practice and losses never", () => {
  const won = new Winnings(3);
  assert.equal(won.count(parentView({ round: 5, over: FOUND })), 4);
  assert.equal(won.count(parentView({ round: 5, over: FOUND })), 4);
  assert.equal(won.count(parentView({ round: 6, over: { outcome: "not_found", last: false } })), 4);
  assert.equal(won.count(parentView({ round: 1, phase: "practice", over: FOUND })), 4);
  assert.equal(won.count(parentView({ round: 7, over: { outcome: "arrived", last: true } })), 5);
});

test("the words of the bar", () => {
  assert.deepEqual([roundsLeft(1), roundsLeft(12)], ["1 round left", "12 rounds left"]);
  assert.equal(minutesSoFar(4, 119_999), "5 min so far");
});

/** A page that goes into and out of full screen. */
class FakePage extends EventTarget {
  fullscreenEnabled = true;
  /** @type {object | null} */ fullscreenElement = null;
  asked = 0;
  documentElement = {
    requestFullscreen: async () => {
      this.asked += 1;
      this.fullscreenElement = {};
    },
  };
  async exitFullscreen() {
    this.fullscreenElement = null;
  }
}

test("full screen is wished with the button, renewed on the next page, and given up with the button", async () => {
  const storage = new FakeStorage();
  const first = new FullScreen({ page: /** @type {any} */ (new FakePage()), storage });
  await first.renew();
  assert.equal(first.on, false, "nobody asked for it");
  await first.toggle();
  assert.equal(first.on, true);
  const page = new FakePage();
  const second = new FullScreen({ page: /** @type {any} */ (page), storage });
  await second.renew();
  await second.renew();
  assert.deepEqual([second.on, page.asked], [true, 1]);
  await second.toggle();
  assert.deepEqual([second.on, second.wished], [false, false]);
});
