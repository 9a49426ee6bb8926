// @ts-check
// How to play: an example that plays by itself, and the keys of the role, tried before the first round.

import { build } from "../board/drawing.js";
import { exampleFrames } from "../board/example.js";
import { icon } from "../board/symbols.js";
import { startBar } from "../lib/bar.js";
import { el, find } from "../lib/dom.js";
import { keyName } from "../lib/keys.js";
import { Loop } from "../lib/loop.js";
import { watchViewport } from "../lib/viewport.js";
import { watchWindow } from "../lib/watch.js";

/** @type {{ events_url: string, page: string } & import("../board/example.js").Example} */
const data = JSON.parse(find("#page-data").textContent ?? "{}");
const { role } = data;
const probe = find("#probe");
const why = find("#why");

/** What must have been pressed: each group once. */
const GROUPS = {
  parent: [["up", "right", "down", "left"]],
  child: [Array.from({ length: 9 }, (_, i) => `digit-${i + 1}`)],
  driver: [["brake"], ["go"]],
};
const missing = new Set(GROUPS[role]);

document.addEventListener("keydown", (event) => {
  const name = keyName(event);
  if (name === null || name === "continue") return;
  for (const group of missing) {
    if (!group.includes(name)) continue;
    event.preventDefault();
    missing.delete(group);
    if (missing.size === 0) received();
  }
});

find("#next").addEventListener("submit", (event) => {
  if (missing.size === 0) return;
  event.preventDefault();
  why.textContent = `${find("span", probe).textContent} The game is played with it.`;
  probe.classList.add("probe-open");
});

function received() {
  const words = GROUPS[role].length > 1 ? "Keys received" : "Key received";
  find("#received").replaceChildren(el("span", { class: "badge badge-good" }, build(icon("good")), words));
  why.textContent = "";
  probe.classList.remove("probe-open");
}

/** Plays by itself, unless the person wants little motion: then a still picture and a button. */
function showExample() {
  const picture = find("#example-picture");
  const loop = new Loop(exampleFrames(data), (drawing) => picture.replaceChildren(build(drawing)));
  const button = find("#example-play");
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let begun = !still;
  const word = () => {
    button.textContent = loop.playing ? "Pause" : begun ? "Play" : "Show the example";
  };
  button.addEventListener("click", () => {
    begun = true;
    if (loop.playing) loop.pause();
    else loop.play();
    word();
  });
  button.hidden = false;
  if (!still) loop.play();
  word();
}

showExample();
startBar();
watchWindow(data.events_url, data.page);
watchViewport(window, (small) => {
  find("#cover").hidden = !small;
});
