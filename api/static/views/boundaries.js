/** The boundaries of the store, and one of them in detail: the selected one or the one that changed last. */

import { get, getAll } from "../api.js";
import { followBoundary } from "../boundary.js";
import { sweepsOf } from "../diagram.js";
import { element } from "../dom.js";
import { dateAndTime, words } from "../format.js";
import { submitButton } from "../job.js";
import { goTo } from "../router.js";

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
export async function showBoundaries({ content, parameters, query, signal }) {
  /** @type {Boundary[]} */
  const boundaries = await getAll("/boundaries", signal);
  boundaries.sort((first, second) => second.updated.localeCompare(first.updated));
  const key = parameters.key ?? boundaries[0]?.study_key;
  if (key === undefined) {
    const { items } = await get("/runs?limit=1&reports=true", signal);
    content.replaceChildren(...invitation(items.length > 0));
    return;
  }
  const shownBoundary = boundaries.find(({ study_key }) => study_key === key) ?? (await get(`/boundaries/${key}`, signal));
  const compared = boundaries.find(({ study_key }) => study_key === query.get("with")) ?? null;
  document.title = `${words(shownBoundary.name)} – Vesicle ensemble`;
  const shown = element("div", {});
  content.replaceChildren(shown, ...comparison(boundaries, shownBoundary, compared));
  if (boundaries.length > 1) {
    content.append(others(boundaries, key));
  }
  await followBoundary(shown, key, signal, compared);
}

/** @param {boolean} hasRuns */
function invitation(hasRuns) {
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
      `${hasRuns ? "No boundary has been traced in this store yet." : "Nothing is stored yet."} A study finds, for ` +
        "each value of one parameter, the critical value of another, and keeps every simulation behind it.",
    ),
    element("p", {}, submitButton("Trace the first boundary", async () => ({ preset: BEGINNINGS[0][0] }))),
    element("nav", { class: "shelf", "aria-label": "Examples to begin with" }, element("ul", {}, ...ways)),
  ];
}

/**
 * A menu of the boundaries in the same two parameters, one of which can be drawn with the present one.
 *
 * @param {Boundary[]} boundaries
 * @param {Boundary} current
 * @param {Boundary | null} compared
 */
function comparison(boundaries, current, compared) {
  const parameters = (/** @type {Boundary} */ { study }) =>
    [...sweepsOf(study), study.search].map(({ parameter }) => parameter).join(" ");
  const alike = boundaries.filter(
    (each) => each.study_key !== current.study_key && parameters(each) === parameters(current),
  );
  if (alike.length === 0 || sweepsOf(current.study).length > 1) {
    return [];
  }
  const menu = element(
    "select",
    {
      id: "compared",
      onchange: () => goTo(`/boundaries/${current.study_key}${menu.value ? `?with=${menu.value}` : ""}`),
    },
    element("option", { value: "" }, "no other boundary"),
    ...alike.map(({ study_key, name }) =>
      element("option", { value: study_key, selected: study_key === compared?.study_key }, name),
    ),
  );
  const label = element("label", { for: "compared" }, "Draw with");
  return [element("form", { class: "inline comparison" }, label, menu)];
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
