// @ts-check
/** The builder without its scripts is a plain form; this only spares work: an agent brings its budget, changes are not lost. */
import { offerCopies } from "./copy.js";

const form = document.querySelector("[data-build]");
if (form instanceof HTMLFormElement) {
  for (const row of form.querySelectorAll("[data-arm]")) followAgent(row);
  warnOfLoss(form);
}
offerCopies(document);

/**
 * Choosing an agent fills in the budget that it was trained for, and a communication that it can speak.
 * @param {Element} row
 */
function followAgent(row) {
  const agent = row.querySelector("select[data-bundle]");
  const budget = row.querySelector("input[data-budget]");
  const communication = row.querySelector("[data-communication]");
  if (!(agent instanceof HTMLSelectElement) || !(budget instanceof HTMLInputElement)) return;
  agent.addEventListener("change", () => {
    const chosen = agent.selectedOptions[0];
    if (!chosen?.dataset.budget) return;
    budget.value = chosen.dataset.budget;
    if (!(communication instanceof HTMLSelectElement)) return;
    const speaksOneHot = chosen.dataset.channel === "one-hot";
    if (speaksOneHot !== (communication.value === "one-hot")) {
      communication.value = speaksOneHot ? "one-hot" : "prototype";
    }
  });
}

/** @param {HTMLFormElement} form */
function warnOfLoss(form) {
  const note = form.querySelector("[data-unsaved]");
  let unsaved = false;
  form.addEventListener("input", () => {
    unsaved = true;
    if (note instanceof HTMLElement) note.hidden = false;
  });
  form.addEventListener("submit", () => {
    unsaved = false;
  });
  addEventListener("beforeunload", (event) => {
    if (unsaved) event.preventDefault();
  });
}
