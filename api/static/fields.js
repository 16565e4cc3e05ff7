/** The fields of a document as a form offers them, by the dotted paths of the command line's `--set`. */

import { sceneIn } from "./kinds.js";
import { quantity } from "./symbols.js";

/** @typedef {import("./kinds.js").Kind} Kind */

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
const VARIED = /(?:^|\.)parameter$/;
const LABELS = /** @type {Record<string, string>} */ ({
  horizon: "time to simulate",
  "numerics.points": "points on each vesicle",
  "numerics.tolerance": "tolerance in time",
  "arrangement.count": "number of vesicles",
  "arrangement.area_fraction": "area fraction",
  "arrangement.reduced_area": "reduced area ΔA",
  "arrangement.seed": "seed of the places",
  "search.limits": "limits of the search",
  "search.scan": "values scanned in a decade",
  "search.tolerance": "relative width of a bracket",
  "search.certify": "certify the brackets",
});

/**
 * @param {any} document - In full.
 * @param {Kind} kind - Which kind of question it asks.
 * @returns {Field[]} The principal ones first, in the order in which people think of them.
 */
export function fieldsOf(document, kind) {
  const all = leaves(document);
  const prefix = kind.scene_path ? `${kind.scene_path}.` : "";
  // A field called `parameter` names the field of the scene that the question itself varies.
  const varied = all.filter(([path]) => VARIED.test(path)).map(([, name]) => `${prefix}${name}`);
  const ofScene = OF_SCENE.map((path) => prefix + path);
  const principal = [...kind.principal_fields, ...ofScene].filter((path) => !varied.includes(path));
  const rank = (/** @type {Field} */ { path }) =>
    principal.includes(path) ? principal.indexOf(path) : principal.length;

  return all
    .filter(([path]) => !varied.includes(path))
    .map(([path, value]) => ({
      path,
      value,
      label: label(path, prefix, new Map(all), sceneIn(document, kind)),
      isPrincipal: principal.includes(path),
    }))
    .sort((first, second) => rank(first) - rank(second));
}

/**
 * @param {string} path
 * @param {string} prefix - Of the paths in the scene.
 * @param {Map<string, unknown>} values - All of the document, by path.
 * @param {any} scene
 */
function label(path, prefix, values, scene) {
  const varied = path.endsWith("values") ? values.get(path.replace(/values$/, "parameter")) : undefined;
  if (typeof varied === "string") {
    return `values of the ${quantity(varied, scene).name}`;
  }
  const inScene = path.startsWith(prefix) ? path.slice(prefix.length) : path;
  const { name, symbol } = quantity(inScene, scene);
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
