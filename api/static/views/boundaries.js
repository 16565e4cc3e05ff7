/** The boundaries of the store, and one of them in detail: the selected one or the one that changed last. */

import { getAll } from "../api.js";
import { followBoundary } from "../boundary.js";
import { element } from "../dom.js";
import { dateAndTime, words } from "../format.js";

/** @typedef {import("../diagram.js").Boundary} Boundary */

/** Presets to begin with: a question, and what is computed. */
const BEGINNINGS = [
  ["critical-hamaker", "How much adhesion holds a doublet in shear?", "The critical Hamaker constant, shear rate by shear rate"],
  ["critical-extension-rate", "How strong a trap tears it apart?", "The critical extension rate against reduced area"],
  ["critical-viscosity-contrast", "When does treading give way to tumbling?", "The critical viscosity contrast of one vesicle"],
  ["doublet-shear", "Watch a doublet turn", "One run in shear, to look at"],
  ["suspension-shear", "Watch a suspension", "Two dozen adhering vesicles in shear"],
];

/** @param {import("../router.js").Place} place */
export async function showBoundaries({ content, parameters, signal }) {
  /** @type {Boundary[]} */
  const boundaries = await getAll("/boundaries", signal);
  boundaries.sort((first, second) => second.updated.localeCompare(first.updated));
  const key = parameters.key ?? boundaries[0]?.study_key;
  if (key === undefined) {
    content.replaceChildren(...invitation());
    return;
  }
  document.title = `${words(boundaries.find(({ study_key }) => study_key === key)?.name ?? key)} – Vesicle ensemble`;
  const shown = element("div", {});
  content.replaceChildren(shown);
  if (boundaries.length > 1) {
    content.append(others(boundaries, key));
  }
  await followBoundary(shown, key, signal);
}

function invitation() {
  const ways = BEGINNINGS.map(([preset, question, answer]) =>
    element(
      "li",
      {},
      element("a", { href: `#/new?preset=${preset}` }, element("strong", {}, question), element("span", {}, answer)),
    ),
  );
  return [
    element("h1", {}, "When do two vesicles stay together in a flow?"),
    element(
      "p",
      { class: "lead" },
      "No boundary has been traced in this store yet. A study finds, for each value of one parameter, the " +
        "critical value of another, and keeps every simulation behind it.",
    ),
    element("nav", { class: "shelf", "aria-label": "Examples to begin with" }, element("ul", {}, ...ways)),
  ];
}

/**
 * @param {Boundary[]} boundaries
 * @param {string} current
 */
function others(boundaries, current) {
  const links = boundaries.map(({ study_key, name, points, updated }) =>
    element(
      "li",
      {},
      element(
        "a",
        { href: `#/boundaries/${study_key}`, "aria-current": study_key === current ? "true" : null },
        element("strong", {}, words(name)),
        element(
          "span",
          {},
          `${points.length} ${points.length === 1 ? "point" : "points"}, ${dateAndTime(updated)}`,
        ),
      ),
    ),
  );
  return element(
    "section",
    { class: "shelf" },
    element("h2", {}, "All boundaries"),
    element("ul", {}, ...links),
  );
}
