/** Elements that show the state of a job. */

import { get, post, remove } from "./api.js";
import { element } from "./dom.js";
import { kindNamed } from "./kinds.js";
import { alertAbout } from "./problems.js";
import { goTo } from "./router.js";

/**
 * @typedef {object} Job
 * @property {string} id
 * @property {string} kind
 * @property {string} name
 * @property {string} key - Key of the answer.
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

/**
 * The state of a job in the words of the page, which cancels what the standard of the service dismisses.
 *
 * @param {Job} job
 */
export function stateOf({ status }) {
  return element("span", { class: `state ${status}` }, status === "dismissed" ? "canceled" : status);
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
 * Make a link to the answer, if there is one already and the page can show it.
 *
 * @param {Job} job
 */
export function resultLink({ kind, key, status, progress }) {
  const { collection, answer_title: title, answer_grows: grows } = kindNamed(kind);
  const exists = status === "succeeded" || (grows && status === "running" && progress > 0);
  return collection && exists
    ? element("a", { href: `#/${collection}/${key}` }, title.charAt(0).toUpperCase() + title.slice(1))
    : null;
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

/**
 * Make the ways to ask again what a job asked that has finished: the same once more, unless it has been answered, or
 * with changes.
 *
 * @param {Job} job
 */
export function againButtons(job) {
  if (isUnfinished(job)) {
    return null;
  }
  const changed = element("a", { class: "button", href: `#/new?job=${job.id}` }, "Submit with changes");
  if (job.status === "succeeded") {
    return [changed];
  }
  const submission = () => get(`/jobs/${job.id}/submission`, new AbortController().signal);
  return [submitButton("Submit again", submission), changed];
}

/**
 * Make a button that submits a job and shows it.
 *
 * @param {string} text
 * @param {() => Promise<any>} submission - Gives what is submitted.
 */
export function submitButton(text, submission) {
  const button = element("button", { class: "primary" }, text);
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      goTo(`/jobs/${(await post("/jobs", await submission())).id}`);
    } catch (error) {
      button.replaceWith(alertAbout(error));
    }
  });
  return button;
}
