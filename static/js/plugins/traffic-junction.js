// @ts-check
// Traffic Junction as a jsPsych 8 plugin: one trial is one round at the wheel of the yellow car.
//
// It knows no server. `view` is the round as it stands; `decide(action, timing, view)` brings the view that follows. Actions:
// 0 go (key J), 1 brake (key F). See tests/static/example/.

import { ParameterType } from "jspsych";
import { build, h } from "../board/drawing.js";
import { junctionBoard } from "../board/junction.js";
import { CAUTION, portrait } from "../board/symbols.js";
import { el } from "../lib/dom.js";
import { Round } from "../lib/round.js";
import { keyButton, meterBlock, setKeys } from "../lib/stage.js";

/** @import { Brought, DriverView, Roads } from "../lib/types.js" */
/** @import { RoundParameters } from "../lib/round.js" */

const PEDALS = /** @type {const} */ ({ go: 0, brake: 1 });

/** @type {Record<string, object>} */
const PARAMETERS = {
  /** The round as it stands (RoundView, role "driver", with its roads). */
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
};

export class TrafficJunctionPlugin {
  static info = {
    name: "traffic-junction",
    version: "1.0.0",
    parameters: PARAMETERS,
    data: {
      round: { type: ParameterType.INT },
      outcome: { type: ParameterType.STRING },
      steps: { type: ParameterType.INT },
      progress: { type: ParameterType.INT },
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
   * @param {RoundParameters<DriverView>} trial
   */
  async trial(display, trial) {
    const round = new Round(display, trial);
    const last = await drive(round, trial.view);
    await round.finish(last);
    this.jsPsych.finishTrial({
      round: trial.view.round,
      outcome: last?.over?.outcome ?? "elsewhere",
      steps: last?.step ?? null,
      progress: last?.position ?? null,
      decisions: round.decisions,
    });
  }
}

export default TrafficJunctionPlugin;

/**
 * @param {Round} round
 * @param {DriverView & Brought} first
 * @returns {Promise<DriverView | null>} the view in which it ended; null: the round went on elsewhere
 */
async function drive(round, first) {
  const steps = meterBlock("Steps");
  const route = meterBlock("Your route");
  const keys = [
    keyButton({ action: PEDALS.brake, icon: "brake", text: "BRAKE", key: "F" }, round.press),
    keyButton({ action: PEDALS.go, icon: "go", text: "GO", key: "J" }, round.press),
  ];
  const meters = el("div", { class: "stack-2" }, steps.element, route.element);
  round.lay("panel panel-drive", meters, legend(), el("div", { class: "drive" }, ...keys));
  /** @type {Roads} */
  const roads = first.roads ?? { rows: [], columns: [] };
  const draw = (/** @type {DriverView} */ view) => {
    round.paint(build(junctionBoard(view, view.roads ?? roads)));
    steps.set(view.step, view.limit);
    route.set(view.position, view.route.length);
    setKeys(keys, { active: !view.over });
    round.tell(view);
  };
  return round.play(first, {
    draw,
    keys: () => PEDALS,
    taken: (action) => setKeys(keys, { active: false, pressed: action }),
  });
}

/** What the signs on the map mean: the same in every arm. */
function legend() {
  return el(
    "section",
    { class: "card signs", "aria-label": "Signs on the map" },
    el(
      "ul",
      {},
      el("li", {}, build(portrait("car")), el("span", {}, el("b", {}, "You"))),
      el("li", {}, build(routeSample()), el("span", {}, el("b", {}, "Your route"))),
      el(
        "li",
        {},
        build(cautionSample()),
        el("span", {}, el("b", {}, "Another car may be here"), el("br"), "larger and darker: more likely"),
      ),
    ),
  );
}

function routeSample() {
  return h(
    "svg",
    { viewBox: "0 0 48 48", "aria-hidden": "true" },
    h("path", { class: "path", d: "M24 48V16" }),
    h("path", { class: "path-end", d: "M24 3 36 22H12Z" }),
  );
}

function cautionSample() {
  const samples = [
    { x: 2, y: 15, size: 20, opacity: 0.35 },
    { x: 38, y: 10, size: 29, opacity: 0.65 },
    { x: 86, y: 3, size: 40, opacity: 1 },
  ];
  return h(
    "svg",
    { viewBox: "0 0 132 48", "aria-hidden": "true" },
    samples.map(({ x, y, size, opacity }) =>
      h("path", {
        class: "caution",
        fill: "currentColor",
        "fill-rule": "evenodd",
        d: CAUTION,
        opacity,
        transform: `translate(${x} ${y}) scale(${Math.round((size / 24) * 1000) / 1000})`,
      }),
    ),
  );
}
