// @ts-check
// How to use hatlab's plugins in an experiment of your own: they need a view and a way to get the next one.

import { ParentChildPlugin } from "hatlab/plugins/parent-child.js";
import { TrafficJunctionPlugin } from "hatlab/plugins/traffic-junction.js";
import { initJsPsych } from "jspsych";
import { childView, drive, driverView, parentView, say, walk } from "./worlds.js";

/** @import { ChildView, DriverView, ParentView } from "../../../static/js/lib/types.js" */

const later = (/** @type {object} */ view) => new Promise((resolve) => setTimeout(resolve, 20, view));

/** @type {Record<string, object>} */
const TRIALS = {
  parent: {
    type: ParentChildPlugin,
    view: parentView(),
    decide: (/** @type {number} */ action, /** @type {object} */ _timing, /** @type {ParentView} */ view) =>
      later(walk(view, action, [4, 1])),
  },
  child: {
    type: ParentChildPlugin,
    view: childView(),
    decide: (/** @type {number} */ action, /** @type {object} */ _timing, /** @type {ChildView} */ view) =>
      later(say(view, action)),
  },
  driver: {
    type: TrafficJunctionPlugin,
    view: driverView(),
    decide: (/** @type {number} */ action, /** @type {object} */ _timing, /** @type {DriverView} */ view) =>
      later(drive(view, action)),
  },
};

const jsPsych = initJsPsych({
  display_element: "play",
  use_webaudio: false,
  on_data_update: (/** @type {object} */ data) => Object.assign(window, { last: data }),
});
const role = new URLSearchParams(location.search).get("role") ?? "parent";
await jsPsych.run([TRIALS[role] ?? {}]);
