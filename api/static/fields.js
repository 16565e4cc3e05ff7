/** The fields of a document as a form offers them, by the dotted paths of the command line's `--set`. */

import { sceneIn } from "./kinds.js";
import { quantity } from "./symbols.js";

/** @typedef {import("./kinds.js").Kind} Kind */
/** @typedef {import("./schema.js").Schema} Schema */

/**
 * @typedef {object} Field
 * @property {string} path
 * @property {unknown} value
 * @property {string} label
 * @property {string} help - What it is, in the words of the model.
 * @property {string} unit
 * @property {string[] | null} choices - All values of a text that has a few.
 * @property {boolean} isPrincipal - One of those that people change most.
 *
 * @typedef {object} Union - A table that is one of several kinds, such as the flow.
 * @property {string} path
 * @property {any} value - The table, null if there is none.
 * @property {string} label
 * @property {string} help
 * @property {string[]} kinds
 * @property {boolean} isOptional
 */

const OF_SCENE = [
  "vesicles.reduced_area",
  "arrangement.count",
  "arrangement.area_fraction",
  "arrangement.reduced_area",
  "arrangement.seed",
  "horizon",
  "numerics.points",
  "numerics.tolerance",
  "numerics.integrator",
];
const NAME = "name";
const VARIED = /(?:^|\.)parameter$/;
const LABELS = /** @type {Record<string, string>} */ ({
  flow: "imposed flow",
  adhesion: "adhesion potential",
  protocol: "change of the rate with time",
  horizon: "latest end",
  "numerics.points": "points on each vesicle",
  "numerics.tolerance": "tolerance in time",
  "units.radius": "radius R that is the unit of length",
  "units.length": "length 2πR instead of the radius",
  "units.bending_modulus": "bending modulus κ that is the unit of bending moduli",
  "units.viscosity": "viscosity μ of the fluid outside",
  "start.deformation.amplitude": "amplitude of a random deformation",
  "start.deformation.seed": "seed of the deformation",
  "start.deformation.waves": "waves of the deformation",
  "arrangement.count": "number of vesicles",
  "arrangement.area_fraction": "area fraction",
  "arrangement.reduced_area": "reduced area ΔA",
  "arrangement.seed": "seed of the places",
  "search.limits": "limits of the search",
  "search.scan": "values scanned in a decade",
  "search.tolerance": "relative width of a bracket",
  "search.certify": "certify the brackets",
  "errors.rate": "error of the critical rate",
  "errors.reduced_area": "error of the reduced area",
  "errors.distance": "error of the adhesion distance",
  "errors.radius": "error of the radius",
  "errors.bending_modulus": "error of the bending modulus",
  "errors.viscosity": "error of the viscosity",
});

/** The document of a form, and what the service says about its fields. */
export class FormDocument {
  /**
   * @param {any} document - In full.
   * @param {Kind} kind - Which kind of question it asks.
   * @param {Schema} schema
   */
  constructor(document, kind, schema) {
    this.document = schema.completed(document);
    this.kind = kind;
    this.schema = schema;
    this.prefix = kind.scene_path ? `${kind.scene_path}.` : "";
  }

  /** The scene in the document. */
  get scene() {
    return sceneIn(this.document, this.kind);
  }

  /** Tables that are one of several kinds. @returns {Union[]} */
  get unions() {
    // Vesicles replace an arrangement, so its kind is not a choice of its own.
    const isArrangement = (/** @type {string} */ path) => path === `${this.prefix}arrangement`;
    return this.schema
      .unions(this.prefix, this.document)
      .filter(({ path }) => !isArrangement(path))
      .map((union) => ({
        ...union,
        value: valueOf(this.document, union.path) ?? null,
        label: this.#label(union.path),
        help: this.schema.describe(union.path, this.document).help,
      }));
  }

  /** All other fields, the principal ones first, in the order in which people think of them. @returns {Field[]} */
  get fields() {
    const unions = this.unions.map(({ path }) => path);
    const isInside = (/** @type {string} */ path) =>
      unions.some((union) => path === union || path.startsWith(`${union}.`));
    const ofScene = OF_SCENE.map((path) => this.prefix + path);
    const principal = [NAME, ...this.kind.principal_fields, ...ofScene];
    const place = (/** @type {string} */ path) => principal.indexOf(path.replaceAll(/\.\d+/g, ""));
    const rank = (/** @type {Field} */ { path }) => (place(path) < 0 ? principal.length : place(path));
    return leaves(this.document)
      .filter(([path]) => !isInside(path) && !this.#varied.includes(path))
      .map(([path, value]) => this.#field(path, value, place(path) >= 0))
      .sort((first, second) => rank(first) - rank(second));
  }

  /**
   * The fields of a table that is one of several kinds.
   *
   * @param {string} path
   * @param {any} table
   * @returns {Field[]}
   */
  fieldsOf(path, table) {
    return leaves(table, path)
      .filter(([inside]) => !inside.endsWith(".kind") && !this.#varied.includes(inside))
      .map(([inside, value]) => this.#field(inside, value, true, table));
  }

  /** Fields of the scene that the question itself varies: a field called `parameter` names each. */
  get #varied() {
    return leaves(this.document)
      .filter(([path]) => VARIED.test(path))
      .map(([, name]) => `${this.prefix}${name}`);
  }

  /**
   * @param {string} path
   * @param {unknown} value
   * @param {boolean} isPrincipal
   * @param {any} [table] - The table of a union that the field is in.
   * @returns {Field}
   */
  #field(path, value, isPrincipal, table) {
    const union = path.slice(0, path.lastIndexOf("."));
    const document = table ? replaced(this.document, union, table) : this.document;
    return {
      path,
      value,
      label: this.#label(path, document),
      isPrincipal,
      ...this.schema.describe(path, document),
    };
  }

  /**
   * @param {string} path
   * @param {any} [document]
   */
  #label(path, document = this.document) {
    const values = new Map(leaves(document));
    const varied = path.endsWith("values") ? values.get(path.replace(/values$/, "parameter")) : undefined;
    const scene = sceneIn(document, this.kind);
    if (typeof varied === "string") {
      return `values of the ${quantity(varied, scene).name}`;
    }
    const inScene = path.startsWith(this.prefix) ? path.slice(this.prefix.length) : path;
    const { name, symbol } = quantity(inScene, scene);
    return LABELS[inScene] ?? (name === symbol ? inWords(path) : `${name} ${symbol}`);
  }
}

/**
 * The name of a field in words; of one of several tables, with the table.
 *
 * @param {string} path
 */
function inWords(path) {
  const names = path.split(".");
  const name = names[names.length - 1].replaceAll("_", " ");
  return /^\d+$/.test(names[names.length - 2] ?? "") ? `${name}, ${names.slice(-3, -1).join(" ")}` : name;
}

/**
 * @param {any} document
 * @param {string} path - Of tables only.
 */
function valueOf(document, path) {
  return path.split(".").reduce((table, name) => table?.[name], document);
}

/**
 * Return a document with another table at a path.
 *
 * @param {any} document
 * @param {string} path
 * @param {any} table
 * @returns {any}
 */
function replaced(document, path, table) {
  const [name, ...rest] = path.split(".");
  return { ...document, [name]: rest.length > 0 ? replaced(document[name], rest.join("."), table) : table };
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
