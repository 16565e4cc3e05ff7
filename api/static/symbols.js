/** Established names and symbols of a scene's parameters. */

import { getAll } from "./api.js";
import { number } from "./format.js";
import { Units } from "./units.js";

/**
 * @typedef {object} Quantity
 * @property {string} name
 * @property {string} symbol - Plain text.
 */

/** @type {Record<string, Quantity>} */
const BY_PATH = {
  "adhesion.hamaker": { name: "Hamaker constant", symbol: "H" },
  "adhesion.distance": { name: "separation distance", symbol: "δ" },
  "vesicles.reduced_area": { name: "reduced area", symbol: "ΔA" },
  "vesicles.length": { name: "vesicle length", symbol: "L" },
  "vesicles.bending_modulus": { name: "bending modulus", symbol: "κ" },
  "vesicles.viscosity_contrast": { name: "viscosity contrast", symbol: "λ" },
  "adhesion.cutoff": { name: "cutoff", symbol: "cutoff" },
};

const MOST_NUMBERS = 3; // that are listed; of more, only the range

const OF_THE_FLOW = "flow.";

/**
 * Imposed flows by kind, as the service describes them.
 *
 * @type {Map<string, {title: string, parameters: Record<string, Quantity>}>}
 */
const flows = new Map();

/**
 * Ask for the imposed flows, once; `quantity` and `describe` need them.
 *
 * @param {AbortSignal} signal
 */
export async function loadFlows(signal) {
  if (flows.size === 0) {
    for (const flow of await getAll("/flows", signal)) {
      flows.set(flow.kind, flow);
    }
  }
}

/**
 * Return the quantity at a dotted path of a scene. A path without an established symbol is its own name.
 *
 * @param {string} path
 * @param {any} scene
 * @returns {Quantity}
 */
export function quantity(path, scene) {
  const ofFlow = path.startsWith(OF_THE_FLOW)
    ? flows.get(scene.flow?.kind)?.parameters[path.slice(OF_THE_FLOW.length)]
    : undefined;
  return ofFlow ?? BY_PATH[path] ?? { name: path, symbol: path };
}

/**
 * Describe a scene in one line: its vesicles, its flow and its parameters.
 *
 * @param {any} scene
 * @param {string[]} [without] - Dotted paths to omit, for example those of the axes.
 * @param {Units} [units] - If they are given, numbers are written with them, too.
 * @returns {string}
 */
export function describe(scene, without = [], units = new Units()) {
  const of = (/** @type {string} */ field) =>
    [...new Set(scene.vesicles.map((/** @type {any} */ vesicle) => vesicle[field] ?? 1))].sort((a, b) => a - b);
  const contrasts = of("viscosity_contrast");
  const cutoff = scene.adhesion?.cutoff ?? null;
  const flow = flows.get(scene.flow?.kind);
  /** @type {[string, unknown[]][]} */
  const values = [
    ...Object.keys(flow?.parameters ?? {}).map(
      (field) => /** @type {[string, unknown[]]} */ ([OF_THE_FLOW + field, [scene.flow[field]]]),
    ),
    ["vesicles.reduced_area", of("reduced_area")],
    ["vesicles.viscosity_contrast", contrasts.every((contrast) => contrast === 1) ? [] : contrasts],
    ["adhesion.hamaker", scene.adhesion ? [scene.adhesion.hamaker] : []],
    ["adhesion.distance", scene.adhesion ? [scene.adhesion.distance] : []],
    ["adhesion.cutoff", cutoff === null ? [] : [cutoff]],
  ];
  const shown = values
    .filter(([path, numbers]) => numbers.length > 0 && !without.includes(path))
    .map(
      ([path, numbers]) =>
        `${quantity(path, scene).symbol} = ${listed(path, /** @type {number[]} */ (numbers), units)}`,
    );
  const count = scene.vesicles.length;
  const vesicles = count === 1 ? "1 vesicle" : `${count} vesicles`;
  const changing = scene.protocol ? [`rate by a protocol (${scene.protocol.kind})`] : [];
  return [`${vesicles} in ${flow?.title ?? "quiescent fluid"}`, ...changing, ...shown].join(", ");
}

/**
 * List a few numbers; of many, write the range.
 *
 * @param {string} path
 * @param {number[]} values - Ascending.
 * @param {Units} units
 */
function listed(path, values, units) {
  return values.length > MOST_NUMBERS
    ? `${number(values[0], 3)} to ${number(values[values.length - 1], 3)}`
    : values.map((value) => units.both(path, value)).join(" and ");
}

/**
 * Return the value at a dotted path of a document. In a list, the path continues in the first element.
 *
 * @param {any} document
 * @param {string} path
 * @returns {any}
 */
export function valueAt(document, path) {
  return path.split(".").reduce((value, name) => {
    const inside = Array.isArray(value) && !/^\d+$/.test(name) ? value[0] : value;
    return inside?.[name];
  }, document);
}
