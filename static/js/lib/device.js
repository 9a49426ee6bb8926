// @ts-check
// What the browser says about itself, coarsely: allocation balances over the device class, because browsers differ in
// reaction time by as much as the effects do. Pure.

/**
 * @typedef {object} Signs
 * @property {string} userAgent
 * @property {number} maxTouchPoints
 * @property {boolean} coarse the first pointer is a finger
 * @property {number} shortSide of the screen, in CSS pixels
 */

/**
 * @param {Signs} signs
 * @returns {"desktop" | "tablet" | "phone"}
 */
export function deviceClass({ userAgent, maxTouchPoints, coarse, shortSide }) {
  if (/iPhone|Android.*Mobile|Windows Phone/.test(userAgent)) return "phone";
  // iPadOS calls itself a Macintosh; a Mac has no touch screen.
  const tablet = /iPad|Android|Tablet/.test(userAgent) || (/Macintosh/.test(userAgent) && maxTouchPoints > 1);
  if (tablet) return "tablet";
  if (coarse) return shortSide < 600 ? "phone" : "tablet";
  return "desktop";
}

/** The order matters: Edge and Opera name Chrome too, Chrome names Safari. @type {[RegExp, string][]} */
const BROWSERS = [
  [/\bEdgA?\/(\d+)/, "Edge"],
  [/\bOPR\/(\d+)/, "Opera"],
  [/\bSamsungBrowser\/(\d+)/, "Samsung"],
  [/\b(?:Firefox|FxiOS)\/(\d+)/, "Firefox"],
  [/\b(?:Headless)?(?:Chrome|CriOS)\/(\d+)/, "Chrome"],
  [/\bVersion\/(\d+)[\d.]* .*Safari\//, "Safari"],
];

/** @type {[RegExp, string][]} */
const SYSTEMS = [
  [/Windows/, "Windows"],
  [/iPhone|iPad/, "iOS"],
  [/Android/, "Android"],
  [/CrOS/, "ChromeOS"],
  [/Mac OS X/, "macOS"],
  [/Linux/, "Linux"],
];

/**
 * @param {string} userAgent
 * @returns {string} such as "Firefox 151 Windows"
 */
export function browserName(userAgent) {
  const browser = BROWSERS.map(([pattern, name]) => [pattern.exec(userAgent)?.[1], name]).find(([major]) => major);
  const system = SYSTEMS.find(([pattern]) => pattern.test(userAgent))?.[1] ?? "other";
  return browser ? `${browser[1]} ${browser[0]} ${system}` : `other ${system}`;
}
