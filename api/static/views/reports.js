/** The reports that have been made into the store, and one of them in detail. */

import { get, getText } from "../api.js";
import { element } from "../dom.js";
import { dateAndTime } from "../format.js";

/**
 * What each report is about.
 *
 * @type {Record<string, string>}
 */
const TITLES = {
  "work-precision": "Error against run time, for every integrator",
  stability: "Stiff and extreme scenes, and the symmetry of bound pairs",
  scaling: "Time and memory against vesicles and ranks",
  paper: "The paper, recomputed",
};

/** @param {import("../router.js").Place} place */
export async function showReports({ content, signal }) {
  document.title = "Reports – Vesicle ensemble";
  const { items } = await get("/reports", signal);
  const made = new Map(items.map(({ name, updated }) => [name, updated]));
  const links = [...made].map(([name, updated]) =>
    element(
      "li",
      {},
      element(
        "a",
        { href: `#/reports/${name}` },
        element("strong", {}, TITLES[name]),
        element("span", {}, `made ${dateAndTime(updated)}`),
      ),
    ),
  );
  const missing = Object.keys(TITLES).filter((name) => !made.has(name));
  content.replaceChildren(
    element("h1", {}, "Reports"),
    element("section", { class: "shelf" }, element("ul", {}, ...links)),
    missing.length > 0
      ? element("p", {}, "Not made yet: ", missing.map((name) => [element("code", {}, `ensemble report ${name}`), " "]))
      : "",
  );
}

/** @param {import("../router.js").Place} place */
export async function showReport({ content, parameters, signal }) {
  const title = TITLES[parameters.name];
  document.title = `${title} – Vesicle ensemble`;
  // Requested with the token of the page, which the address of a frame could not have.
  const page = await getText(`/reports/${parameters.name}`, signal);
  const address = URL.createObjectURL(new Blob([page], { type: "text/html" }));
  signal.addEventListener("abort", () => URL.revokeObjectURL(address));
  content.replaceChildren(
    element("div", { class: "heading" }, element("h1", {}, title)),
    element("iframe", { class: "report", title, sandbox: "allow-same-origin", src: address }),
  );
}
