// @ts-check
// Questions: quiz, attention check, questionnaire.

import { startBar } from "../lib/bar.js";
import { find } from "../lib/dom.js";
import { Form } from "../lib/form.js";
import { watchWindow } from "../lib/watch.js";

new Form();
startBar();
/** @type {{ events_url: string, page: string }} */
const { events_url, page } = JSON.parse(find("#page-data").textContent ?? "{}");
watchWindow(events_url, page);
