/** Links that save a run or a boundary as a file. */

import { getBlob } from "./api.js";
import { element } from "./dom.js";
import { alertAbout } from "./problems.js";

/**
 * Make a menu of files.
 *
 * They are requested with the token of the page, which the address of a link could not have.
 *
 * @param {string} path - Of the route that gives the files.
 * @param {string} name - Of the file, without its suffix.
 * @param {[string, string][]} formats - Suffix and title of each.
 */
export function downloads(path, name, formats) {
  const status = element("span", { role: "status", class: "note" });
  const buttons = formats.map(([suffix, title]) =>
    element("button", { class: "quiet", onclick: () => save(suffix, title) }, title),
  );

  /**
   * @param {string} suffix
   * @param {string} title
   */
  async function save(suffix, title) {
    status.textContent = `Making the ${title}…`;
    buttons.forEach((button) => (button.disabled = true));
    try {
      const address = URL.createObjectURL(await getBlob(`${path}?format=${suffix}`));
      element("a", { href: address, download: `${name}.${suffix}` }).click();
      setTimeout(() => URL.revokeObjectURL(address), 60_000); // the browser may still be reading
      status.textContent = "";
    } catch (error) {
      status.replaceChildren(alertAbout(error));
    }
    buttons.forEach((button) => (button.disabled = false));
  }

  return element("div", { class: "downloads", role: "group", "aria-label": "Download" }, ...buttons, status);
}
