// @ts-check
// Everything that a round says. Part of the stimulus: other words are another study version. Pure.

/** @import { ChildView, DriverView, Message, ParentView, RoundView } from "./types.js" */

export const WORDS = {
  parent_prompt: "Move with the arrow keys. Find the child in as few steps as you can.",
  child_prompt: "You stay where you are. Send one message that helps the parent to find you.",
  driver_prompt: "Reach the end of your route without touching another car.",
  sent_at_once: "Your message is sent at once.",
  cannot_change: "Your message cannot be changed.",
  next: "Next round",
  next_practice: "Next practice round",
  practice_over: "Start the rounds",
  block_over: "Continue",
};

/** @type {Record<"waiting" | "lost" | "elsewhere" | "moved_on" | "refused", Message>} */
export const NOTICES = {
  waiting: { icon: "wait", kind: "plain", text: "One moment …" },
  lost: {
    icon: "offline",
    kind: "warn",
    title: "Connection lost",
    text: "Your last move is kept. No time is counted.",
  },
  elsewhere: {
    icon: "tabs",
    kind: "warn",
    title: "Open in another tab",
    text: "You are playing in a newer tab or window.",
  },
  moved_on: {
    icon: "tabs",
    kind: "warn",
    title: "Carried on",
    text: "This round went on elsewhere. This is how it stands now.",
  },
  refused: {
    icon: "bad",
    kind: "bad",
    title: "Something went wrong",
    text: "Your rounds are safe. Load the page again to go on.",
  },
};

/**
 * What the strip says while a decision is waited for.
 * @param {RoundView} view
 * @returns {Message}
 */
export function prompt(view) {
  if (view.phase === "practice") return { icon: "practice", kind: "plain", title: "Practice", text: coach(view) };
  return { text: WORDS[/** @type {"parent_prompt"} */ (`${view.role}_prompt`)] };
}

/**
 * The guide through the practice round: what to press next, and what the drawing means.
 * @param {RoundView} view
 */
export function coach(view) {
  if (view.role === "parent") return coachParent(view);
  if (view.role === "child") return coachChild(view);
  return coachDriver(view);
}

/** @param {ParentView} view */
function coachParent(view) {
  if (view.child) return "There is the child, inside your frame. Walk onto its square.";
  if (view.step === 0) return "This round does not count. Press an arrow key: one press is one step.";
  if (view.step === 1) return "You took one step. The ring is where you began, the line is where you walked.";
  if (view.step === 2) return "The filled sign is what the child says. In practice all signs are blank.";
  if (view.step === 3) return "You see only the squares inside the black frame. Walk on until the child shows up.";
  return "Walk on until the child shows up inside your frame. A step against the border counts too.";
}

/** @param {ChildView} view */
function coachChild(view) {
  const partner = view.parent ? "The pale figure is the parent. " : "";
  return `This round does not count. ${partner}Press a number, or click a sign. Here all signs are blank.`;
}

/** @param {DriverView} view */
function coachDriver(view) {
  const braked = view.step > view.position;
  if (view.step === 0) return "This round does not count. Press J to drive one square along the red line.";
  if (view.position <= 2 && !braked) return "Your car moved one square. Now press F: you wait, and the others drive.";
  if (view.step <= 3) return "You waited one step. Now drive on with J.";
  if (view.step <= 6)
    return "A triangle: another car may be there. Larger and darker is more likely. These are examples.";
  return "Drive to the end of the red line: J to go, F to wait.";
}

/**
 * What the strip says when a round is over.
 * @param {RoundView} view
 * @returns {Message}
 */
export function result(view) {
  const said = mainResult(view);
  if (view.phase === "main" || view.number < view.of) return said;
  return { ...said, text: [said.text, "That was practice. From now on rounds count."].filter(Boolean).join(" ") };
}

/** @param {RoundView} view */
function mainResult(view) {
  if (view.role === "parent") return parentResult(view);
  if (view.role === "child") return childResult(view);
  return driverResult(view);
}

/** @param {ParentView} view @returns {Message} */
function parentResult(view) {
  if (view.over?.outcome === "found") return { kind: "good", icon: "good", title: `Found in ${steps(view.step)}` };
  return {
    kind: "bad",
    icon: "bad",
    title: "Not found",
    text: `The child was in the ring. Your ${steps(view.limit)} are used up.`,
  };
}

/** @param {ChildView} view @returns {Message} */
function childResult(view) {
  const walked = steps((view.walk ?? []).length - 1);
  if (view.over?.outcome === "found") return { kind: "good", icon: "good", title: `The parent found you in ${walked}` };
  return { kind: "bad", icon: "bad", title: "Not found", text: `The parent did not reach you in ${walked}.` };
}

/** @param {DriverView} view @returns {Message} */
function driverResult(view) {
  const cells = view.route.length;
  if (view.over?.outcome === "arrived") {
    return {
      kind: "good",
      icon: "good",
      title: "Arrived",
      text: `You drove all ${cells} cells without touching another car.`,
    };
  }
  if (view.over?.outcome === "collision") {
    return {
      kind: "bad",
      icon: "bad",
      title: "Collision",
      text: `You touched another car after ${view.position} of ${cells} cells.`,
    };
  }
  return {
    kind: "bad",
    icon: "bad",
    title: "Not arrived",
    text: `Your ${steps(view.limit)} are used up after ${view.position} of ${cells} cells.`,
  };
}

/**
 * The word on the button that leaves a finished round.
 * @param {RoundView} view
 */
export function onward(view) {
  if (view.phase === "practice") return view.number < view.of ? WORDS.next_practice : WORDS.practice_over;
  return view.over?.last ? WORDS.block_over : WORDS.next;
}

/** @param {number} count */
function steps(count) {
  return count === 1 ? "1 step" : `${count} steps`;
}
