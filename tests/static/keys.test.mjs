// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { browserName, deviceClass } from "../../static/js/lib/device.js";
import { keyName } from "../../static/js/lib/keys.js";
import { isTooSmall } from "../../static/js/lib/viewport.js";

test("arrow keys, pedals and digits have names", () => {
  assert.equal(keyName({ key: "ArrowLeft", code: "ArrowLeft" }), "left");
  assert.equal(keyName({ key: "F", code: "KeyF" }), "brake");
  assert.equal(keyName({ key: "j", code: "KeyJ" }), "go");
  assert.equal(keyName({ key: "7", code: "Digit7" }), "digit-7");
  assert.equal(keyName({ key: " ", code: "Space" }), "continue");
});

test("the digit row needs no Shift on AZERTY, and the number pad works", () => {
  assert.equal(keyName({ key: "é", code: "Digit2" }), "digit-2");
  assert.equal(keyName({ key: "3", code: "Numpad3" }), "digit-3");
  assert.equal(keyName({ key: "ArrowDown", code: "Numpad2" }), "down");
  assert.equal(keyName({ key: "0", code: "Digit0" }), null);
});

test("pedals work by place on other alphabets", () => {
  assert.equal(keyName({ key: "а", code: "KeyF" }), "brake");
  assert.equal(keyName({ key: "о", code: "KeyJ" }), "go");
});

test("the browser's shortcuts stay the browser's", () => {
  assert.equal(keyName({ key: "f", code: "KeyF", ctrlKey: true }), null);
  assert.equal(keyName({ key: "ArrowLeft", altKey: true }), null);
  assert.equal(keyName({ key: "2", code: "Digit2", metaKey: true }), null);
});

const UA = {
  chrome:
    "Mozilla/5.0 (Windows NT 10.0; Win64; x64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/156.0.0.0 Safari/537.36",
  edge: "Mozilla/5.0 (Windows NT 10.0; Win64; x64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/156.0.0.0 Safari/537.36 Edg/156.0.0.0",
  safari:
    "Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/19.1 Safari/605.1.15",
  firefox: "Mozilla/5.0 (X11; Linux x86_64; rv:151.0) Gecko/20100101 Firefox/151.0",
  iphone:
    "Mozilla/5.0 (iPhone; CPU iPhone OS 19_1 like Mac OS X) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/19.1 Mobile/15E148 Safari/604.1",
};

test("browsers are named without the version's tail", () => {
  assert.equal(browserName(UA.chrome), "Chrome 156 Windows");
  assert.equal(browserName(UA.edge), "Edge 156 Windows");
  assert.equal(browserName(UA.safari), "Safari 19 macOS");
  assert.equal(browserName(UA.firefox), "Firefox 151 Linux");
  assert.equal(browserName("curl/8"), "other other");
});

test("a tablet that calls itself a Macintosh is a tablet", () => {
  const mouse = { maxTouchPoints: 0, coarse: false, shortSide: 900 };
  assert.equal(deviceClass({ userAgent: UA.safari, ...mouse }), "desktop");
  assert.equal(deviceClass({ userAgent: UA.safari, maxTouchPoints: 5, coarse: true, shortSide: 820 }), "tablet");
  assert.equal(deviceClass({ userAgent: UA.iphone, maxTouchPoints: 5, coarse: true, shortSide: 390 }), "phone");
  assert.equal(deviceClass({ userAgent: UA.chrome, maxTouchPoints: 10, coarse: false, shortSide: 1080 }), "desktop");
});

test("the smallest window is 1024 by 640", () => {
  assert.equal(isTooSmall({ innerWidth: 1024, innerHeight: 640 }), false);
  assert.equal(isTooSmall({ innerWidth: 1023, innerHeight: 900 }), true);
  assert.equal(isTooSmall({ innerWidth: 1600, innerHeight: 639 }), true);
});
