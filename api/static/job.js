/** Elements that show the state of a job. */

import { remove } from "./api.js";
import { element } from "./dom.js";
import { alertAbout } from "./problems.js";

/**
 * @typedef {object} Job
 * @property {string} id
 * @property {"study" | "scene"} kind
 * @property {string} name
 * @property {string} key - Key of the resulting boundary or run.
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
 * Make a link to the result. The diagram of a study exists while it is traced, a run when it has finished.
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
