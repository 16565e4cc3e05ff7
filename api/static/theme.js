/** Light and dark colors: those of the system unless the user chooses others. */

const KEY = "theme";
const system = window.matchMedia("(prefers-color-scheme: dark)");

/** Event of `window` after the colors have changed. */
export const THEME_CHANGED = "themechanged";

/** Apply the choice of colors in the masthead, now and when it changes. */
export function startTheme() {
  const choice = /** @type {HTMLSelectElement} */ (document.getElementById("theme"));
  choice.value = window.localStorage.getItem(KEY) ?? "auto";
  apply(choice.value);
  choice.addEventListener("change", () => {
    window.localStorage.setItem(KEY, choice.value);
    apply(choice.value);
    announce();
  });
  system.addEventListener("change", announce);
}

/** @param {string} theme */
function apply(theme) {
  document.documentElement.dataset.theme = theme;
}

function announce() {
  window.dispatchEvent(new Event(THEME_CHANGED));
}

/** @returns {boolean} Whether the page is dark now. */
export function isDark() {
  const { theme } = document.documentElement.dataset;
  return theme === "dark" || (theme !== "light" && system.matches);
}

/**
 * Return the present value of a color of `theme.css`, for drawings that style sheets do not reach.
 *
 * @param {string} name - For example `ink`.
 * @returns {string}
 */
export function color(name) {
  // The custom property holds both the light and the dark color; a computed color is one of them.
  const probe = document.createElement("span");
  probe.style.color = `var(--${name})`;
  document.body.append(probe);
  const value = window.getComputedStyle(probe).color;
  probe.remove();
  return value;
}
