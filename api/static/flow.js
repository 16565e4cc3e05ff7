/** The imposed flow of a run, from its velocities on a grid as the service gives them. */

import { get } from "./api.js";

/**
 * @typedef {object} FlowField
 * @property {number[]} x - Equally spaced, ascending; as y.
 * @property {number[]} y
 * @property {[number[][], number[][]]} velocity - Both components, row by row.
 */

/** Interpolates linearly between the positions of the grid, and goes on linearly beyond its edges. */
export class ImposedFlow {
  /** @param {FlowField} field */
  constructor({ x, y, velocity }) {
    this.x = x;
    this.y = y;
    this.velocity = velocity;
  }

  /**
   * Ask for the flow of a run.
   *
   * @param {string} key
   * @param {AbortSignal} signal
   * @returns {Promise<ImposedFlow | null>} Null in a fluid at rest.
   */
  static async of(key, signal) {
    const field = await get(`/runs/${key}/flow`, signal);
    return field && new ImposedFlow(field);
  }

  /**
   * The velocity at a place.
   *
   * @param {number} x
   * @param {number} y
   * @returns {[number, number]}
   */
  at(x, y) {
    const [column, right] = cell(this.x, x);
    const [row, up] = cell(this.y, y);
    const between = (/** @type {number[][]} */ values) => {
      const along = (/** @type {number[]} */ line) =>
        line[column] + right * (line[column + 1] - line[column]);
      const [below, above] = [along(values[row]), along(values[row + 1])];
      return below + up * (above - below);
    };
    return [between(this.velocity[0]), between(this.velocity[1])];
  }
}

/**
 * The interval of a grid that holds a position, or the nearest one, and where in it the position is.
 *
 * @param {number[]} positions
 * @param {number} position
 * @returns {[number, number]} Index of its start, and the distance from there in lengths of the interval.
 */
function cell(positions, position) {
  const last = positions.length - 2;
  const distance = ((position - positions[0]) / (positions[last + 1] - positions[0])) * (last + 1);
  const index = Math.min(Math.max(Math.floor(distance), 0), last);
  return [index, distance - index];
}
