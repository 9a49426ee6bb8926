// @ts-check
// How to play: the keys of the role are tried before the first round (a tablet has none).

import { build } from "../board/drawing.js";
import { icon } from "../board/symbols.js";
import { el, find } from "../lib/dom.js";
import { keyName } from "../lib/keys.js";
import { watchViewport } from "../lib/viewport.js";

const probe = find("#probe");
const why = find("#why");
const role = /** @type {"parent" | "child" | "driver"} */ (probe.dataset.role);

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

watchViewport(window, (small) => {
  find("#cover").hidden = !small;
});
