/** The list of jobs with their progress. */

import { changesOf, get } from "../api.js";
import { element, tableRow } from "../dom.js";
import { dateAndTime, words } from "../format.js";
import { cancelButton, progressOf, resultLink, stateOf } from "../job.js";
import { alertAbout } from "../problems.js";

/** @typedef {import("../job.js").Job} Job */

const COLUMNS = ["Job", "Status", "Progress", "Submitted", "Result", "Action"];
const SECONDS_BETWEEN_REQUESTS = 1;

/** @param {import("../router.js").Place} place */
export async function showJobs({ content, signal }) {
  document.title = "Jobs – Vesicle ensemble";
  const newest = element("tbody", {});
  const older = element("tbody", {});
  const more = element("button", { hidden: true }, "Older jobs");
  const empty = element("p", { hidden: true }, "There are no jobs yet.");
  content.replaceChildren(
    element(
      "div",
      { class: "heading" },
      element("h1", {}, "Jobs"),
      element("a", { class: "button primary", href: "#/new" }, "New job"),
    ),
    element(
      "table",
      { class: "stacked jobs" },
      element("caption", { class: "hidden" }, "Jobs, the latest first"),
      element(
        "thead",
        {},
        element("tr", {}, ...COLUMNS.map((name) => element("th", { scope: "col" }, name))),
      ),
      newest,
      older,
    ),
    empty,
    more,
  );

  /** @type {string | null} */
  let next = null;
  const loadOlder = async () => {
    const page = await get(/** @type {string} */ (next), signal);
    older.append(...page.items.map(row));
    next = page.next;
    more.hidden = next === null;
  };
  more.addEventListener("click", () => loadOlder().catch((error) => more.replaceWith(alertAbout(error))));
  for await (const page of changesOf("/jobs?limit=20", SECONDS_BETWEEN_REQUESTS, signal)) {
    showPage(newest, page.items);
    empty.hidden = page.items.length > 0;
    if (!older.hasChildNodes()) {
      next = page.next;
      more.hidden = next === null;
    }
  }
}

/**
 * Replace the rows and keep the keyboard focus.
 *
 * @param {HTMLTableSectionElement} body
 * @param {Job[]} jobs
 */
function showPage(body, jobs) {
  const focused = document.activeElement?.id;
  body.replaceChildren(...jobs.map(row));
  if (focused) {
    document.getElementById(focused)?.focus();
  }
}

/** @param {Job} job */
function row(job) {
  return tableRow(COLUMNS, [
    element("a", { id: `job-${job.id}`, href: `#/jobs/${job.id}` }, words(job.name)),
    stateOf(job),
    progressOf(job),
    dateAndTime(job.created),
    resultLink(job),
    cancelButton(job),
  ]);
}
