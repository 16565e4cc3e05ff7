/** The fields of a study or a scene as a form offers them, by the dotted paths of the command line's `--set`. */

import { quantity } from "./symbols.js";

/**
 * @typedef {object} Field
 * @property {string} path
 * @property {unknown} value
 * @property {string} label
 * @property {boolean} isPrincipal - One of those that people change most.
 */

const OF_SCENE = [
  "flow.rate",
  "adhesion.hamaker",
  "adhesion.distance",
  "vesicles.reduced_area",
  "arrangement.count",
  "arrangement.area_fraction",
  "arrangement.reduced_area",
  "arrangement.seed",
  "horizon",
  "numerics.points",
  "numerics.tolerance",
];
const OF_STUDY = ["sweep.values", "search.limits", "search.tolerance", "search.certify"];
const LABELS = /** @type {Record<string, string>} */ ({
  horizon: "time to simulate",
  "numerics.points": "points on each vesicle",
  "numerics.tolerance": "tolerance in time",
  "arrangement.count": "number of vesicles",
  "arrangement.area_fraction": "area fraction",
  "arrangement.reduced_area": "reduced area ΔA",
  "arrangement.seed": "seed of the places",
  "search.limits": "limits of the search",
  "search.tolerance": "relative width of a bracket",
  "search.certify": "certify the brackets",
});

/**
 * @param {any} document - A study or a scene in full.
 * @returns {Field[]} The principal ones first, in the order in which people think of them.
 */
export function fieldsOf(document) {
  const isStudy = "search" in document;
  const searched = isStudy ? [document.sweep.parameter, document.search.parameter] : [];
  const prefix = isStudy ? "scene." : "";
  const ofScene = OF_SCENE.filter((path) => !searched.includes(path)).map((path) => prefix + path);
  const principal = isStudy ? [...OF_STUDY, ...ofScene] : ofScene;
  const hidden = searched.map((path) => prefix + path); // the study itself varies these
  const rank = (/** @type {Field} */ { path }) =>
    principal.includes(path) ? principal.indexOf(path) : principal.length;

  return leaves(document)
    .filter(([path]) => !hidden.includes(path))
    .map(([path, value]) => ({
      path,
      value,
      label: label(path, prefix, document),
      isPrincipal: principal.includes(path),
    }))
    .sort((first, second) => rank(first) - rank(second));
}

/**
 * @param {string} path
 * @param {string} prefix
 * @param {any} document
 */
function label(path, prefix, document) {
  const inScene = path.startsWith(prefix) ? path.slice(prefix.length) : path;
  if (path === "sweep.values") {
    return `values of the ${quantity(document.sweep.parameter, document.scene).name}`;
  }
  const { name, symbol } = quantity(inScene, prefix ? document.scene : document);
  return LABELS[inScene] ?? (name === symbol ? path : `${name} ${symbol}`);
}

/**
 * The values of a document by dotted path.  Of a list of tables (the vesicles), what is the same in each is one value.
 *
 * @param {any} value
 * @param {string} [path]
 * @returns {[string, unknown][]}
 */
function leaves(value, path = "") {
  if (Array.isArray(value) && value.length > 0 && value.every(isTable)) {
    return mergedLeaves(value, path);
  }
  if (!isTable(value)) {
    return [[path, value]];
  }
  return Object.entries(value).flatMap(([name, inside]) => leaves(inside, path ? `${path}.${name}` : name));
}

/**
 * @param {any[]} tables
 * @param {string} path
 * @returns {[string, unknown][]}
 */
function mergedLeaves(tables, path) {
  return Object.keys(tables[0]).flatMap((name) => {
    const values = tables.map((table) => table[name]);
    const isShared = values.every((value) => isSame(value, values[0]));
    return isShared
      ? leaves(values[0], `${path}.${name}`)
      : values.flatMap((value, index) => leaves(value, `${path}.${index}.${name}`));
  });
}

/** @param {unknown} value */
function isTable(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/**
 * @param {unknown} first
 * @param {unknown} second
 * @returns {boolean}
 */
export function isSame(first, second) {
  return JSON.stringify(first) === JSON.stringify(second);
}
