// @ts-check
// The page of the board: joins session, plugin and page. One jsPsych trial is one round.

import { initJsPsych } from "jspsych";
import { build } from "../board/drawing.js";
import { pips } from "../board/meters.js";
import { Attention } from "../lib/attention.js";
import { startBar } from "../lib/bar.js";
import { el, find } from "../lib/dom.js";
import { Outbox, pageStorage } from "../lib/outbox.js";
import { roundsOver, Winnings } from "../lib/progress.js";
import { Session } from "../lib/session.js";
import { sayIn, setAside } from "../lib/strip.js";
import { openChannel, takeTurn } from "../lib/tabs.js";
import { Transport } from "../lib/transport.js";
import { watchViewport } from "../lib/viewport.js";
import { watchWindow } from "../lib/watch.js";
import { NOTICES } from "../lib/words.js";
import { ParentChildPlugin } from "../plugins/parent-child.js";
import { TrafficJunctionPlugin } from "../plugins/traffic-junction.js";

/** @import { Brought, Message, RoundView, Timing } from "../lib/types.js" */

/** @typedef {{ round_url: string, step_url: string, page_url: string, events_url: string, page: string }} Urls */
/** @type {Urls & { rounds: number, blocks: number, won: number, bonuses: string[] }} */
const data = JSON.parse(find("#page-data").textContent ?? "{}");
const urls = data;
const strip = find("#strip");
const attention = new Attention().watch(document);
const transport = new Transport();
const storage = pageStorage();

/** @type {Message} */ let spoken = {};
/** A newer tab has the game: nothing but that is said here. */
let elsewhere = false;
const write = sayIn(strip);
const say = (/** @type {Message} */ message) => {
  spoken = message;
  if (!elsewhere) write(message);
};

const session = new Session({
  urls: { round: urls.round_url, step: urls.step_url, page: urls.page_url },
  transport,
  outbox: new Outbox(urls.page_url, storage),
  storage,
  say,
  leave: (url) => location.assign(url),
});

/** @type {(RoundView & Brought) | null} */ let view = null;

/** @param {RoundView} now */
function head({ phase, number, of }) {
  const far = find("#far");
  if (phase === "practice") far.replaceChildren(el("b", {}, "Practice round"), ", does not count");
  else far.replaceChildren("Round ", el("b", {}, String(number)), ` of ${of}`);
  find("#pips").replaceChildren(...(phase === "practice" ? [] : [build(pips(number, of))]));
}

const bar = startBar();
const winnings = new Winnings(data.won);
const windowLog = watchWindow(data.events_url, data.page);

/**
 * The bar and the window's log, once a round has ended: after the picture, so that nothing delays it.
 * @param {RoundView} now
 */
function ended(now) {
  const left = data.rounds * data.blocks - roundsOver(now, data.rounds);
  setTimeout(() => {
    bar.tell(left, data.bonuses[winnings.count(now)]);
    void windowLog.leave(); // the session may end here
  });
}

/** Connection lost: the board dims, the keys are flat, the strip counts down to the next try. */
transport.addEventListener("lost", (event) => {
  if (elsewhere) return;
  const { delay_ms } = /** @type {CustomEvent} */ (event).detail;
  document.body.classList.add("paused");
  const press = () => transport.hurry();
  write({ ...NOTICES.lost, aside: trying(delay_ms), button: { label: "Try now", press } });
  countDown(delay_ms);
});

transport.addEventListener("found", () => {
  countDown(0);
  if (elsewhere) return;
  document.body.classList.remove("paused");
  write(spoken);
});

addEventListener("online", () => transport.hurry());

/** @type {ReturnType<typeof setInterval> | undefined} */ let ticking;

/** @param {number} left_ms */
function countDown(left_ms) {
  clearInterval(ticking);
  if (left_ms <= 0) return;
  const end = performance.now() + left_ms;
  ticking = setInterval(() => setAside(strip, trying(end - performance.now())), 1000);
}

/** @param {number} left_ms */
function trying(left_ms) {
  return left_ms < 500 ? "trying again" : `trying again in ${Math.round(left_ms / 1000) || 1} s`;
}

/** This tab stops until the person says otherwise. */
const announce = takeTurn(openChannel(urls.page_url), () => {
  elsewhere = true;
  attention.hold("elsewhere");
  document.body.classList.add("paused");
  const press = () => {
    announce();
    location.reload();
  };
  write({ ...NOTICES.elsewhere, button: { label: "Continue here", press } });
});

watchViewport(window, (small) => {
  find("#cover").hidden = !small;
  attention.set("covered", small);
});

/**
 * @param {number} action
 * @param {Timing} timing
 * @param {RoundView} about
 */
async function decide(action, timing, about) {
  const next = await session.decide(about, action, timing);
  view = next;
  if (next?.over) ended(next);
  return next;
}

/**
 * The next round, before the finished one leaves the screen: the board is never empty in between.
 * @param {RoundView} finished
 */
async function proceed(finished) {
  void bar.fullScreen.renew();
  view = await session.open(finished.round);
}

const trial = {
  view: () => view,
  decide,
  proceed,
  say,
  shown: (/** @type {RoundView} */ now) => session.shown(now),
  attention: () => attention,
  on_start: () => view && head(view),
};

view = await session.open(null);
if (view) {
  const plugin = view.task === "traffic_junction" ? TrafficJunctionPlugin : ParentChildPlugin;
  const jsPsych = initJsPsych({ display_element: find("#play"), use_webaudio: false });
  await jsPsych.run([{ timeline: [{ ...trial, type: plugin }], loop_function: () => view !== null }]);
}
