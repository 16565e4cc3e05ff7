/** Numbers with their units. The service says how much one is, so the page has no units of its own. */

import { get } from "./api.js";
import { number } from "./format.js";

/**
 * @typedef {object} Size - How much one is.
 * @property {number} value
 * @property {string} unit - Empty if it is the number itself.
 */

/** @type {Size} */
const ONE = { value: 1, unit: "" };

/** The units of a scene, by the dotted path of a field, or the name of a result or a diagnostic. */
export class Units {
  /** @param {Record<string, Size>} sizes */
  constructor(sizes = {}) {
    this.sizes = sizes;
  }

  /**
   * @param {string} address - Of a run, a boundary or a map.
   * @param {any} scene - Its scene.
   * @param {AbortSignal} signal
   */
  static async of(address, scene, signal) {
    return new Units(scene.units ? (await get(`${address}/units`, signal)).sizes : {});
  }

  /**
   * @param {string} name
   * @returns {Size}
   */
  size(name) {
    return this.sizes[name] ?? ONE;
  }

  /**
   * Write a number and, if its unit is known, the same with its unit.
   *
   * @param {string} name
   * @param {number} value
   * @param {(value: number) => string} [write]
   */
  both(name, value, write = number) {
    const { value: one, unit } = this.size(name);
    return unit ? `${write(value)} (${write(value * one)} ${unit})` : write(value);
  }

  /**
   * Write the label of an axis, whose numbers are multiplied by the size of their unit.
   *
   * @param {string} label
   * @param {string} name
   */
  label(label, name) {
    const { unit } = this.size(name);
    return unit ? `${label} (${unit})` : label;
  }
}

/**
 * Multiply the coordinates of a figure with one pair of axes.
 *
 * @param {import("./plot.js").Figure} figure
 * @param {{x: Size, y: Size, z?: Size}} sizes
 * @returns {import("./plot.js").Figure}
 */
export function inUnits({ data, layout }, { x, y, z = ONE }) {
  const times = (/** @type {any} */ values, /** @type {Size} */ { value }) =>
    Array.isArray(values) ? values.map((each) => times(each, { value, unit: "" })) : values === null ? null : values * value;
  const sizes = /** @type {[string, Size][]} */ ([["x", x], ["y", y], ["z", z]]);
  const scaled = data.map((trace) => ({
    ...trace,
    ...Object.fromEntries(sizes.filter(([name]) => name in trace).map(([name, size]) => [name, times(trace[name], size)])),
    ...(trace.error_y && {
      error_y: {
        ...trace.error_y,
        array: times(trace.error_y.array, y),
        ...(trace.error_y.arrayminus && { arrayminus: times(trace.error_y.arrayminus, y) }),
      },
    }),
  }));
  const xaxis = layout.xaxis.range ? { ...layout.xaxis, range: times(layout.xaxis.range, x) } : layout.xaxis;
  return { data: scaled, layout: { ...layout, xaxis } };
}
