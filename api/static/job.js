/** Parts of the page that show where a job stands. */

import { remove } from "./api.js";
import { element } from "./dom.js";
import { alertAbout } from "./problems.js";

/**
 * @typedef {object} Job
 * @property {string} id
 * @property {"study" | "scene"} kind
 * @property {string} name
 * @property {string} key - Of the boundary or the run that comes of it.
 * @property {number} ranks
 * @property {"accepted" | "running" | "succeeded" | "failed" | "dismissed"} status
 * @property {number} progress - Percent.
 * @property {string} message
 * @property {string} created
 * @property {string | null} started
 * @property {string | null} finished
 */

/**
 * @param {Job} job
 * @returns {boolean}
 */
export function isUnfinished({ status }) {
  return status === "accepted" || status === "running";
}

/** @param {Job} job */
export function progressOf({ progress }) {
  return element(
    "div",
    { class: "progress" },
    element("progress", { max: 100, value: progress, "aria-label": "Progress" }),
    element("span", {}, `${progress} %`),
  );
}

/**
 * A link to what the job makes: the diagram of a study is there while it is traced, a run when it is finished.
 *
 * @param {Job} job
 */
export function resultLink({ kind, key, status }) {
  if (kind === "study") {
    return status === "accepted" ? null : element("a", { href: `#/boundaries/${key}` }, "Diagram");
  }
  return status === "succeeded" ? element("a", { href: `#/runs/${key}` }, "Run") : null;
}

/** @param {Job} job */
export function cancelButton(job) {
  if (!isUnfinished(job)) {
    return null;
  }
  const button = element(
    "button",
    { class: "quiet", id: `cancel-${job.id}`, "aria-label": `Cancel ${job.name}` },
    "Cancel",
  );
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      await remove(`/jobs/${job.id}`);
    } catch (error) {
      button.replaceWith(alertAbout(error));
    }
  });
  return button;
}
