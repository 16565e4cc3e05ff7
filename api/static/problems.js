/** Errors, and how the page shows them. */

import { element } from "./dom.js";

/** An error that the service answered with (RFC 9457). */
export class Problem extends Error {
  /**
   * @param {number} status
   * @param {string} detail
   */
  constructor(status, detail) {
    super(detail);
    this.name = "Problem";
    this.status = status;
  }

  /**
   * @param {Response} response - A response with a status of failure.
   * @returns {Promise<Problem>}
   */
  static async of(response) {
    const isDocument = response.headers.get("Content-Type")?.includes("json");
    const detail = isDocument ? (await response.json()).detail : response.statusText;
    return new Problem(response.status, detail || `status ${response.status}`);
  }
}

/**
 * Make an element that shows an error.
 *
 * @param {unknown} error
 * @returns {HTMLElement}
 */
export function alertAbout(error) {
  return element("p", { role: "alert", class: "alert" }, messageOf(error));
}

/**
 * @param {unknown} error
 * @returns {string}
 */
export function messageOf(error) {
  if (error instanceof TypeError) {
    console.error(error);
    return "The service cannot be reached.";
  }
  return error instanceof Error ? error.message : String(error);
}
