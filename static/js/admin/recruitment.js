// @ts-check
// The reconciler: one press chooses every difference of a posting.

for (const button of document.querySelectorAll("[data-choose-all]")) {
  const control = /** @type {HTMLButtonElement} */ (button);
  control.hidden = false;
  control.addEventListener("click", () => {
    const boxes = control.closest("form")?.querySelectorAll("input[type=checkbox]") ?? [];
    for (const box of boxes) /** @type {HTMLInputElement} */ (box).checked = true;
  });
}
