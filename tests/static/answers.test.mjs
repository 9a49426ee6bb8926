// @ts-check
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { AnswerClock, Draft, problem, REQUIRED, TEXT_MAX } from "../../static/js/lib/answers.js";
import { FakeStorage } from "./fakes.mjs";

const ITEM = { key: "x", kind: "choice", required: true, minimum: 18, maximum: 99 };

test("the words are the server's", () => {
  const server = readFileSync(new URL("../../server/domain/questionnaire.py", import.meta.url), "utf8");
  assert.ok(server.includes(`REQUIRED = "${REQUIRED}"`));
  assert.ok(server.includes("Please type a number from {self.minimum:g} to {self.maximum:g}."));
  assert.ok(server.includes("TEXT_MAX = 4_000") && TEXT_MAX === 4000);
});

test("what must be answered and is not is told; what may be left out is not", () => {
  assert.equal(problem(ITEM, ""), REQUIRED);
  assert.equal(problem({ ...ITEM, kind: "text" }, "  "), REQUIRED);
  assert.equal(problem({ ...ITEM, required: false }, ""), "");
  assert.equal(problem(ITEM, "1"), "");
});

test("a number is one, and within its bounds", () => {
  const age = { ...ITEM, kind: "number" };
  for (const good of ["18", " 42 ", "98.5"]) assert.equal(problem(age, good), "");
  for (const bad of ["17", "100", "4x", "1e2", "0x20", "-20", "1."]) {
    assert.equal(problem(age, bad), "Please type a number from 18 to 99.", bad);
  }
});

test("a text may be as long as the server stores, counted in characters", () => {
  const text = { ...ITEM, kind: "text" };
  assert.equal(problem(text, "🙂".repeat(TEXT_MAX)), "");
  assert.match(problem(text, "x".repeat(TEXT_MAX + 1)), /shorten/);
});

test("answers are timed from the first picture, by the moment of the event", () => {
  const clock = new AnswerClock();
  clock.changed("early", 5);
  clock.onset(100);
  clock.onset(900);
  clock.changed("a", 350.12345);
  clock.changed("a", 500);
  assert.deepEqual(JSON.parse(clock.json("a")), { first_ms: 250.123, last_ms: 400, changes: 2 });
  assert.equal(clock.json("early"), "", "nobody had seen the question");
  assert.equal(clock.json("b"), "");
});

test("a reload loses no answer and no time", () => {
  const storage = new FakeStorage();
  const clock = new AnswerClock();
  clock.onset(0);
  clock.changed("a", 80);
  new Draft("tlx:0:1", storage).keep({ a: "35" }, clock.entries());
  const kept = new Draft("tlx:0:1", storage).get();
  assert.deepEqual(kept?.values, { a: "35" });
  const after = new AnswerClock();
  after.resume(kept?.times ?? []);
  assert.equal(after.json("a"), clock.json("a"));
  assert.equal(new Draft("tlx:0:2", storage).get(), null, "another attempt is another form");
});

test("a storage that is forbidden or holds something else changes nothing", () => {
  const storage = new FakeStorage();
  const draft = new Draft("f", storage);
  for (const odd of ["{", "null", "3", '{"values":1}']) {
    storage.setItem("hatlab:draft:f", odd);
    assert.equal(draft.get(), null, odd);
  }
  storage.broken = true;
  draft.keep({ a: "1" }, []);
  assert.equal(draft.get(), null);
  assert.equal(new Draft("f", null).get(), null);
});
