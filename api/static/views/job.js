/** One job: its progress, its log and the diagram that it traces. */

import { eventsOf, get, getText } from "../api.js";
import { followBoundary } from "../boundary.js";
import { definitions, element } from "../dom.js";
import { dateAndTime, duration, words } from "../format.js";
import { againButtons, cancelButton, isUnfinished, progressOf, resultLink, stateOf } from "../job.js";
import { kindNamed } from "../kinds.js";
import { alertAbout, messageOf } from "../problems.js";

/** @typedef {import("../job.js").Job} Job */

/** @param {import("../router.js").Place} place */
export async function showJob({ content, parameters, signal }) {
  const address = `/jobs/${parameters.id}`;
  const head = element("div", {});
  const result = element("div", { class: "result" });
  const log = element("details", { class: "log" }, element("summary", {}, "Log"));
  const lines = log.appendChild(element("pre", { tabindex: 0 }));
  content.replaceChildren(head, result, log);

  const readLog = async () => {
    try {
      lines.textContent = (await getText(`${address}/log`, signal)) || "The log is still empty.";
    } catch (error) {
      lines.textContent = messageOf(error);
    }
  };
  log.addEventListener("toggle", () => log.open && void readLog());

  /** @param {Job} job */
  const show = (job) => {
    document.title = `${words(job.name)} – Vesicle ensemble`;
    head.replaceChildren(...heading(job));
    if (log.open) {
      void readLog();
    }
    showResult(result, job, signal);
  };

  /** @type {Job} */
  const job = await get(address, signal);
  show(job);
  if (isUnfinished(job)) {
    for await (const event of eventsOf(`${address}/events`, (latest) => !isUnfinished(latest), signal)) {
      show(event);
    }
  }
}

/** @param {Job} job */
function heading(job) {
  const state = stateOf(job);
  const seconds =
    job.started && job.finished ? (Date.parse(job.finished) - Date.parse(job.started)) / 1000 : null;
  return [
    element(
      "div",
      { class: "heading" },
      element("h1", {}, words(job.name)),
      element("div", { class: "actions" }, cancelButton(job), againButtons(job)),
      element("p", {}, kindNamed(job.kind).title, ": ", element("code", {}, job.name)),
    ),
    element(
      "div",
      { class: "job-status", role: "status" },
      state,
      progressOf(job),
    ),
    job.message && job.message !== state.textContent ? element("p", { class: job.status === "failed" ? "alert" : "note" }, job.message) : "",
    definitions([
      ["Submitted", dateAndTime(job.created)],
      ["Took", seconds === null ? null : duration(seconds)],
      ["Ranks", String(job.ranks)],
      ["Result", resultLink(job)],
    ]),
  ];
}

/**
 * Show the diagram as soon as the job has started.
 *
 * @param {HTMLElement} place
 * @param {Job} job
 * @param {AbortSignal} signal
 */
function showResult(place, job, signal) {
  const isDrawn = kindNamed(job.kind).collection === "boundaries";
  if (!isDrawn || job.status === "accepted" || place.dataset.followed) {
    return;
  }
  place.dataset.followed = "true";
  const show = async () => {
    // Asked for in a list, which is empty until the boundary exists, at an event of the job soon.
    const { items } = await get(`/boundaries?where=study_key=${job.key}`, signal);
    if (items.length > 0) {
      await followBoundary(place, job.key, signal);
    } else {
      delete place.dataset.followed;
    }
  };
  show().catch((error) => signal.aborted || place.replaceChildren(alertAbout(error)));
}
