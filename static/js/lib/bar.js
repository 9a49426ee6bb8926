// @ts-check
// The last line of every page of a session: rounds left, minutes, bonus, help, the way out. Changes nothing else.

import { find } from "./dom.js";
import { FullScreen, tabStorage } from "./fullscreen.js";
import { minutesSoFar, roundsLeft } from "./progress.js";

const EVERY_MS = 15_000;

/** @returns {{ fullScreen: FullScreen, tell: (rounds_left: number, bonus: string | undefined) => void }} */
export function startBar() {
  const bar = find("#bar");
  const at_load = Number(bar.dataset.minutes);
  const minutes = find("#bar-minutes");
  setInterval(() => write(minutes, minutesSoFar(at_load, performance.now())), EVERY_MS);
  closeHelp(/** @type {HTMLDetailsElement} */ (find("#help")));
  const fullScreen = new FullScreen({ page: document, storage: tabStorage() });
  fullScreen.attach(find("#full-screen"));
  const bonusWord = document.querySelector("#bar-bonus");
  return {
    fullScreen,
    tell(rounds_left, bonus) {
      write(find("#bar-rounds"), roundsLeft(rounds_left));
      if (bonusWord && bonus !== undefined) write(bonusWord, bonus);
    },
  };
}

/**
 * @param {Element} element
 * @param {string} text
 */
function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Help closes with Escape and with a press anywhere else.
 * @param {HTMLDetailsElement} help
 */
function closeHelp(help) {
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !help.open) return;
    help.open = false;
    help.querySelector("summary")?.focus();
  });
  document.addEventListener("pointerdown", (event) => {
    if (!help.contains(/** @type {Node} */ (event.target))) help.open = false;
  });
}
