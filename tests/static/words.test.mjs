// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { coach, onward, prompt, result } from "../../static/js/lib/words.js";
import { childView, driverView, parentView } from "./example/worlds.js";

/** @param {"found" | "not_found" | "arrived" | "collision" | "limit"} outcome */
const over = (outcome, last = false) => ({ outcome, last });

test("results name what happened, in the participant's words", () => {
  assert.equal(result(parentView({ step: 9, over: over("found") })).title, "Found in 9 steps");
  assert.equal(result(parentView({ step: 1, over: over("found") })).title, "Found in 1 step");
  assert.match(String(result(parentView({ step: 20, over: over("not_found") })).text), /in the ring/);
  assert.equal(
    result(
      childView({
        walk: [
          [1, 5],
          [1, 6],
          [1, 7],
        ],
        over: over("found"),
      }),
    ).title,
    "The parent found you in 2 steps",
  );
  assert.match(String(result(driverView({ position: 7, over: over("collision") })).text), /after 7 of 15 cells/);
  assert.match(String(result(driverView({ position: 15, over: over("arrived") })).text), /all 15 cells/);
  assert.match(
    String(result(driverView({ position: 3, over: over("limit") })).text),
    /40 steps are used up after 3 of 15/,
  );
});

test("the way on is named by what comes next", () => {
  assert.equal(onward(parentView({ over: over("found") })), "Next round");
  assert.equal(onward(parentView({ over: over("found", true) })), "Continue");
  assert.equal(onward(parentView({ phase: "practice", number: 1, of: 1, over: over("found") })), "Start the rounds");
  assert.equal(onward(parentView({ phase: "practice", number: 1, of: 2, over: over("found") })), "Next practice round");
});

test("practice says at once that it does not count", () => {
  for (const view of [
    parentView({ phase: "practice" }),
    childView({ phase: "practice" }),
    driverView({ phase: "practice" }),
  ]) {
    assert.equal(prompt(view).title, "Practice");
    assert.match(String(prompt(view).text), /does not count/);
  }
});

test("the end of practice says that rounds count from now on", () => {
  const practice = { phase: /** @type {const} */ ("practice"), number: 1, of: 1 };
  assert.match(String(result(parentView({ ...practice, over: over("found") })).text), /^That was practice/);
  assert.match(
    String(result(driverView({ ...practice, over: over("arrived") })).text),
    /another car. That was practice/,
  );
  assert.equal(result(parentView({ ...practice, of: 2, over: over("found") })).text, undefined);
});

test("main rounds carry no guide", () => {
  for (const view of [parentView(), childView(), driverView()]) assert.equal(prompt(view).title, undefined);
});

test("the guide goes through the drawing step by step", () => {
  const said = [0, 1, 2, 3, 4].map((step) => coach(parentView({ step })));
  assert.equal(new Set(said).size, 5);
  assert.match(coach(parentView({ step: 1, child: [6, 6] })), /Walk onto its square/);
});

test("the driver learns to go, to brake, and what triangles are", () => {
  assert.match(coach(driverView({ step: 0 })), /Press J/);
  assert.match(coach(driverView({ step: 1, position: 1 })), /press F/);
  assert.match(coach(driverView({ step: 2, position: 1 })), /waited/);
  assert.match(coach(driverView({ step: 5, position: 4 })), /triangle/);
});

test("a driver who brakes at once is guided too", () => {
  assert.match(coach(driverView({ step: 1, position: 0 })), /waited one step. Now drive on/);
});

test("nobody is told what a sign means or that nearness means anything", () => {
  const all = [parentView(), childView(), driverView()].flatMap((view) =>
    [0, 1, 2, 3, 4, 8].map((step) => coach(/** @type {any} */ ({ ...view, step, phase: "practice" }))),
  );
  for (const text of all) assert.doesNotMatch(text, /near|close|similar|corner|distance|means/i);
});
