// @ts-check
// Which key is which, on any keyboard layout. Pure.

/** @typedef {"up" | "right" | "down" | "left" | "brake" | "go" | "continue" | `digit-${number}`} KeyName */

const ARROWS = { ArrowUp: "up", ArrowRight: "right", ArrowDown: "down", ArrowLeft: "left" };

/** Traffic: F and J by the letter and by the place; both have a bump and stand alike on QWERTY, AZERTY and QWERTZ. */
const PEDALS = { KeyF: "brake", KeyJ: "go", f: "brake", j: "go" };

/**
 * @param {{ key: string, code?: string, ctrlKey?: boolean, metaKey?: boolean, altKey?: boolean }} event
 * @returns {KeyName | null} null for keys that mean nothing here, and for the browser's own shortcuts
 */
export function keyName(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return null;
  if (event.key in ARROWS) return /** @type {KeyName} */ (ARROWS[/** @type {keyof typeof ARROWS} */ (event.key)]);
  if (event.key === " ") return "continue";
  // By place first: on AZERTY the digits of the top row need Shift.
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code ?? "")?.[1] ?? /^[1-9]$/.exec(event.key)?.[0];
  if (digit) return `digit-${Number(digit)}`;
  const pedal = /** @type {Record<string, string>} */ (PEDALS);
  return /** @type {KeyName | null} */ (pedal[event.key.toLowerCase()] ?? pedal[event.code ?? ""] ?? null);
}
