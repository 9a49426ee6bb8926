// @ts-check
// Parent & Lost Child as a jsPsych 8 plugin: one trial is one round, in the role that the view names.
//
// It knows no server. `view` is the round as it stands; `decide(action, timing, view)` brings the view that follows. Actions:
// parent 0 up, 1 right, 2 down, 3 left; child: the number of the sign that is said. See tests/static/example/.

import { ParameterType } from "jspsych";
import { build } from "../board/drawing.js";
import { choiceBoard, parentBoard, replayBoard } from "../board/grid.js";
import { badge, plane } from "../board/tokens.js";
import { el } from "../lib/dom.js";
import { Round } from "../lib/round.js";
import { keyButton, meterBlock, setKeys } from "../lib/stage.js";
import { WORDS } from "../lib/words.js";

/** @import { Brought, ChildView, ParentView } from "../lib/types.js" */
/** @import { KeyName } from "../lib/keys.js" */
/** @import { RoundParameters } from "../lib/round.js" */

const MOVES = /** @type {const} */ ({ up: 0, right: 1, down: 2, left: 3 });

/** Parent's steps shown again to the child: the same pace for everyone. */
const PACE_MS = 400;

/** @type {Record<string, object>} */
const PARAMETERS = {
  /** The round as it stands (RoundView, role "parent" or "child"). */
  view: { type: ParameterType.OBJECT, default: undefined },
  /** async (action, timing, view) → the view that follows. */
  decide: { type: ParameterType.FUNCTION, default: undefined },
  /** (message) → shows it; null: the plugin makes a strip of its own below the board. */
  say: { type: ParameterType.FUNCTION, default: null },
  /** async (view) → awaited when the person leaves the finished round, before the trial ends. */
  proceed: { type: ParameterType.FUNCTION, default: null },
  /** (view) → told when a view has been drawn. */
  shown: { type: ParameterType.FUNCTION, default: null },
  /** () → an Attention (lib/attention.js); null: one that follows the page's visibility. */
  attention: { type: ParameterType.FUNCTION, default: null },
  /** Milliseconds a step of the replay. */
  pace_ms: { type: ParameterType.INT, default: PACE_MS },
};

export class ParentChildPlugin {
  static info = {
    name: "parent-child",
    version: "1.0.0",
    parameters: PARAMETERS,
    data: {
      round: { type: ParameterType.INT },
      role: { type: ParameterType.STRING },
      outcome: { type: ParameterType.STRING },
      steps: { type: ParameterType.INT },
      /** { action, timing } for each decision made on this page. */
      decisions: { type: ParameterType.COMPLEX, array: true },
    },
  };

  /** @param {jsPsychModule.JsPsych} jsPsych */
  constructor(jsPsych) {
    this.jsPsych = jsPsych;
  }

  /**
   * @param {HTMLElement} display
   * @param {RoundParameters<ParentView | ChildView> & { pace_ms: number }} trial
   */
  async trial(display, trial) {
    const round = new Round(display, trial);
    const { view } = trial;
    const last = view.role === "parent" ? await playParent(round, view) : await playChild(round, view, trial.pace_ms);
    await round.finish(last);
    this.jsPsych.finishTrial({
      round: view.round,
      role: view.role,
      outcome: last?.over?.outcome ?? "elsewhere",
      steps: last ? stepsOf(last) : null,
      decisions: round.decisions,
    });
  }
}

export default ParentChildPlugin;

/** @param {ParentView | ChildView} view */
function stepsOf(view) {
  return view.role === "child" ? (view.walk ?? [view.cell]).length - 1 : view.step;
}

/**
 * @param {Round} round
 * @param {ParentView & Brought} first
 * @returns {Promise<ParentView | null>} the view in which it ended; null: the round went on elsewhere
 */
async function playParent(round, first) {
  const meter = meterBlock("Steps");
  const { card, setTalk } = talk("The child says");
  const keys = /** @type {(keyof typeof MOVES)[]} */ (["up", "left", "down", "right"]).map((name) =>
    keyButton({ action: MOVES[name], label: `Move ${name}`, icon: name }, round.press),
  );
  const arrows = el("div", { class: "arrows" }, ...keys);
  round.lay("panel", meter.element, card, el("div", { class: "keys" }, arrows));
  const draw = (/** @type {ParentView} */ view) => {
    round.paint(build(parentBoard(view)));
    meter.set(view.step, view.limit);
    setTalk(view.sign, view, parentTalk(view));
    setKeys(keys, { active: !view.over });
    round.tell(view);
  };
  return round.play(first, {
    draw,
    keys: () => MOVES,
    taken: (action) => setKeys(keys, { active: false, pressed: action }),
  });
}

/** @param {ParentView} view */
function parentTalk(view) {
  const said = view.over ? "said" : "says";
  if (view.blank) return `${view.signs.length} blank signs; one is what the child ${said}`;
  return `${view.signs.length} messages; the child ${said} message ${view.sign}`;
}

/**
 * @param {Round} round
 * @param {ChildView & Brought} first
 * @param {number} pace_ms
 * @returns {Promise<ChildView | null>}
 */
async function playChild(round, first, pace_ms) {
  const meter = meterBlock("Parent’s steps");
  const { card, setTalk, plane: area } = talk("Choose what to say", "click, or press the number");
  const hint = el("p");
  const numbers = first.signs.map(({ number }) => number).sort((a, b) => a - b);
  const keys = numbers.map((number) =>
    keyButton({ action: number, label: `Say ${number}`, text: String(number) }, round.press),
  );
  const digits = el("div", { class: "keys digits" }, hint, ...keys);
  round.lay("panel", meter.element, card, digits);
  pointing(area, round.press);
  const draw = (/** @type {ChildView} */ view) => {
    round.paint(build(choiceBoard(view)));
    meter.set(0, view.limit);
    setTalk(null, view, `${view.signs.length} ${view.blank ? "blank signs" : "messages"} to choose from`);
    hint.textContent = WORDS.sent_at_once;
    setKeys(keys, { active: true });
    round.tell(view);
  };
  const byDigit = Object.fromEntries(numbers.map((number) => [`digit-${number}`, number]));
  const last = await round.play(first, {
    draw,
    keys: () => /** @type {Partial<Record<KeyName, number>>} */ (byDigit),
    taken: (action) => {
      setKeys(keys, { active: false, pressed: action });
      setTalk(action, first, youSaid(first, action), "You said");
      hint.textContent = WORDS.cannot_change;
    },
  });
  if (!last) return null;
  hint.textContent = WORDS.cannot_change;
  setKeys(keys, { active: false, pressed: last.sign });
  setTalk(last.sign, last, youSaid(last, last.sign), "You said");
  await replay(round, last, meter, pace_ms);
  return last;
}

/**
 * @param {ChildView} view
 * @param {number | null} number
 */
function youSaid(view, number) {
  return view.blank
    ? `${view.signs.length} blank signs; you said one`
    : `${view.signs.length} messages; you said message ${number}`;
}

/**
 * The parent's walk once more, at one pace for everyone; it waits while nobody can see it.
 * @param {Round} round
 * @param {ChildView} view
 * @param {ReturnType<typeof meterBlock>} meter
 * @param {number} pace_ms
 */
async function replay(round, view, meter, pace_ms) {
  round.say({
    kind: "plain",
    icon: "replay",
    title: "Replay",
    text: "This is how the parent walked after your message.",
  });
  const last = (view.walk ?? []).length - 1;
  for (let step = 0; step <= last; step += 1) {
    const board = build(replayBoard(view, step));
    await round.show(() => {
      round.paint(board);
      meter.set(step, view.limit);
    });
    await round.pause(step === 0 || step === last ? 2 * pace_ms : pace_ms);
  }
}

/**
 * The panel of signs.
 * @param {string} heading
 * @param {string} [hint]
 */
function talk(heading, hint) {
  const head = el("header", { class: "talk-head" });
  const area = el("div", { class: "plane-wrap" });
  const card = el("section", { class: "card talk", "aria-label": "Message" }, head, area);
  return {
    card,
    plane: area,
    /**
     * @param {number | null} said
     * @param {ParentView | ChildView} view
     * @param {string} label
     * @param {string} [title]
     */
    setTalk(said, { signs, blank, role }, label, title = heading) {
      const pick = role === "child" && said === null;
      head.replaceChildren(
        el("b", {}, title),
        said === null ? el("span", { class: "quiet" }, hint ?? "") : build(badge(said, blank)),
      );
      area.replaceChildren(build(plane({ signs, said, blank, pick, label })));
    },
  };
}

/**
 * Signs on the plane are a pointer's shortcut to the digit keys: pointed at by hovering, said by a click.
 * @param {HTMLElement} area
 * @param {(action: number, event: MouseEvent) => void} press
 */
function pointing(area, press) {
  const signOf = (/** @type {Event} */ event) =>
    /** @type {SVGElement | null} */ (/** @type {Element} */ (event.target).closest("[data-number]"));
  area.addEventListener("click", (event) => {
    const number = signOf(event)?.dataset.number;
    if (number) press(Number(number), event);
  });
  area.addEventListener("pointerover", (event) => {
    const aimed = signOf(event);
    for (const each of area.querySelectorAll(".aim")) each.classList.remove("aim");
    aimed?.classList.add("aim");
  });
  area.addEventListener("pointerleave", () => area.querySelector(".aim")?.classList.remove("aim"));
}
