// @ts-check
/** Dark or light admin pages: what was chosen in this browser. */

const KEY = "hatlab-admin-theme";

/** @returns {boolean} */
function isDark() {
  try {
    return localStorage.getItem(KEY) === "dark";
  } catch {
    return false; // storage is blocked: light it is
  }
}

/** @param {boolean} dark */
function apply(dark) {
  if (dark) document.documentElement.dataset.theme = "dark";
  else delete document.documentElement.dataset.theme;
}

apply(isDark());

const button = document.querySelector("[data-theme-switch]");
if (button instanceof HTMLButtonElement) {
  const label = () => {
    button.textContent = isDark() ? "Light theme" : "Dark theme";
  };
  label();
  button.hidden = false;
  button.addEventListener("click", () => {
    const dark = !isDark();
    try {
      localStorage.setItem(KEY, dark ? "dark" : "light");
    } catch {
      // shown on this page only
    }
    apply(dark);
    label();
  });
}
