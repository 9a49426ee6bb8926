// @ts-check
// Questions: quiz, attention check, questionnaire.

import { startBar } from "../lib/bar.js";
import { find } from "../lib/dom.js";
import { Form } from "../lib/form.js";
import { watchWindow } from "../lib/watch.js";

new Form();
startBar();
watchWindow(JSON.parse(find("#page-data").textContent ?? "{}"));
