// @ts-check
/** Buttons that copy a participant link. Without scripts they are not shown, and the link can be marked by hand. */

/** @param {ParentNode} root */
export function offerCopies(root) {
  const told = root.querySelector("[data-copied]");
  for (const button of root.querySelectorAll("[data-copy]")) {
    if (!(button instanceof HTMLButtonElement)) continue;
    const input = document.getElementById(button.dataset.copy ?? "");
    if (!(input instanceof HTMLInputElement)) continue;
    button.hidden = false;
    button.addEventListener("click", async () => {
      await copy(input);
      button.textContent = "Copied";
      if (told) told.textContent = "The link is in the clipboard.";
      setTimeout(() => {
        button.textContent = "Copy";
        if (told) told.textContent = "";
      }, 2000);
    });
  }
}

/** @param {HTMLInputElement} input */
async function copy(input) {
  try {
    await navigator.clipboard.writeText(input.value);
  } catch {
    input.select(); // no clipboard without https: the old way
    document.execCommand("copy");
  }
}
