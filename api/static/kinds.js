/** Kinds of question that the service answers, as it describes them. */

import { getAll } from "./api.js";

/**
 * @typedef {object} Kind
 * @property {string} kind - Its name in jobs, presets and submissions.
 * @property {string} title - What a job of this kind does, in the imperative.
 * @property {string | null} collection - The view that shows answers by their keys.
 * @property {string} answer_title
 * @property {boolean} answer_grows - Whether there is an answer while the job runs.
 * @property {boolean} has_many_runs
 * @property {string} scene_path - Dotted path of the scene in a document; empty if the document is a scene.
 * @property {string[]} principal_fields
 */

/** @type {Map<string, Kind>} */
const byName = new Map();

/**
 * Ask for the kinds of question, once; `kinds` and `kindNamed` need them.
 *
 * @param {AbortSignal} signal
 */
export async function loadKinds(signal) {
  if (byName.size === 0) {
    for (const kind of await getAll("/kinds", signal)) {
      byName.set(kind.kind, kind);
    }
  }
}

/** @returns {Kind[]} */
export function kinds() {
  return [...byName.values()];
}

/**
 * @param {string} name
 * @returns {Kind}
 */
export function kindNamed(name) {
  const kind = byName.get(name);
  if (!kind) {
    throw new Error(`The service answers no questions of the kind ${name}.`);
  }
  return kind;
}

/**
 * Return the scene in a document.
 *
 * @param {any} document
 * @param {Kind} kind
 * @returns {any}
 */
export function sceneIn(document, { scene_path }) {
  return scene_path ? scene_path.split(".").reduce((table, name) => table[name], document) : document;
}
