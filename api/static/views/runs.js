/** The runs of the store that meet conditions on their scenes and results. */

import { get } from "../api.js";
import { element, tableRow } from "../dom.js";
import { dateAndTime, number } from "../format.js";
import { submitButton } from "../job.js";
import { MARKS, outcomeLabel } from "../outcomes.js";
import { alertAbout } from "../problems.js";
import { goTo, runLink } from "../router.js";
import { describe } from "../symbols.js";

const COLUMNS = ["Outcome", "Scene", "Integrator", "Points", "Time", "Made", "Run"];

/** @param {import("../router.js").Place} place */
export async function showRuns({ content, query, signal }) {
  document.title = "Runs – Vesicle ensemble";
  const rows = element("tbody", {});
  const count = element("p", { class: "note", role: "status" });
  const more = element("button", { hidden: true }, "Older runs");
  content.replaceChildren(
    element("div", { class: "heading" }, element("h1", {}, "Runs")),
    filters(query),
    element(
      "table",
      { class: "stacked" },
      element("caption", { class: "hidden" }, "Runs, the latest first"),
      element(
        "thead",
        {},
        element("tr", {}, ...COLUMNS.map((name) => element("th", { scope: "col" }, name))),
      ),
      rows,
    ),
    count,
    more,
  );

  const where = query.getAll("where").map((condition) => ["where", condition]);
  const reports = query.has("reports") ? [["reports", "true"]] : [];
  let next = `/runs?${new URLSearchParams([...where, ...reports, ["limit", "50"]])}`;
  const load = async () => {
    const page = await get(next, signal);
    rows.append(...page.items.map(row));
    next = page.next;
    more.hidden = next === null;
    const isAll = where.length + reports.length === 0;
    if (rows.rows.length === 0 && isAll && (await get("/runs?limit=1&reports=true", signal)).items.length === 0) {
      const start = submitButton("Simulate a doublet in shear", async () => ({ preset: "doublet-shear" }));
      count.replaceWith(element("p", { class: "lead" }, "Nothing is stored yet."), element("p", {}, start));
    } else {
      count.textContent = rows.rows.length === 0 ? "No run meets these conditions." : "";
    }
  };
  more.addEventListener("click", () => load().catch((error) => more.replaceWith(alertAbout(error))));
  await load();
}

/** @param {any} run */
function row({ key, outcome, configuration, scene, time, created, work, report }) {
  return tableRow(COLUMNS, [
    configuration
      ? [outcomeLabel(outcome), element("span", { class: "note" }, `, ${configuration}`)]
      : outcomeLabel(outcome),
    report ? [describe(scene), element("span", { class: "note" }, `, for the report ${report}`)] : describe(scene),
    scene.numerics.integrator,
    number(work.points),
    number(time),
    dateAndTime(created),
    runLink(key),
  ]);
}

/**
 * Make the form of conditions. They are part of the address, so that a selection has a link.
 *
 * @param {URLSearchParams} query
 */
function filters(query) {
  const given = query.getAll("where");
  const chosen = given.find((condition) => condition.startsWith("outcome="))?.slice("outcome=".length);
  const outcome = element(
    "select",
    { id: "outcome" },
    element("option", { value: "" }, "any"),
    ...Object.keys(MARKS).map((name) => element("option", { selected: name === chosen }, name)),
  );
  const conditions = element("input", {
    id: "conditions",
    value: given.filter((condition) => !condition.startsWith("outcome=")).join(", "),
    placeholder: "flow.rate>=0.5, adhesion.hamaker<1",
    autocapitalize: "off",
    spellcheck: "false",
  });

  const reports = element("input", { id: "reports", type: "checkbox", checked: query.has("reports") });

  /** @param {SubmitEvent} event */
  const apply = (event) => {
    event.preventDefault();
    const wanted = conditions.value
      .split(",")
      .map((condition) => condition.trim())
      .filter(Boolean);
    if (outcome.value) {
      wanted.push(`outcome=${outcome.value}`);
    }
    const where = wanted.map((condition) => ["where", condition]);
    goTo(`/runs?${new URLSearchParams([...where, ...(reports.checked ? [["reports", ""]] : [])])}`);
  };
  return element(
    "form",
    { class: "inline", onsubmit: apply },
    element("label", { for: "outcome" }, "Outcome"),
    outcome,
    element("label", { for: "conditions" }, "Conditions"),
    conditions,
    element("label", { for: "reports" }, reports, " also those of reports"),
    element("button", {}, "Filter"),
  );
}
