/** Light and dark: as the system has it unless somebody chooses otherwise. */

const KEY = "theme";
const system = window.matchMedia("(prefers-color-scheme: dark)");

/** Dispatched on `window` when the colors have changed. */
export const THEME_CHANGED = "themechanged";

/** Follow the choice of colors in the masthead. */
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
 * The present value of a color of `theme.css`, for what is drawn without style sheets.
 *
 * @param {string} name - Such as `ink`.
 * @returns {string}
 */
export function color(name) {
  // The custom property itself still holds both colors; the element's own color is the one that applies.
  const probe = document.createElement("span");
  probe.style.color = `var(--${name})`;
  document.body.append(probe);
  const value = window.getComputedStyle(probe).color;
  probe.remove();
  return value;
}
