/** The imposed flow of a run, from its velocities on a grid as the service gives them. */

import { get } from "./api.js";

/**
 * @typedef {object} FlowField
 * @property {number[]} x - Equally spaced, ascending; as y.
 * @property {number[]} y
 * @property {[number[][], number[][]]} velocity - Both components, row by row.
 */

/**
 * How strong a flow is during a run.
 *
 * @typedef {object} Strengths
 * @property {number[]} times - Ascending.
 * @property {number[]} factors - Of the velocities on the grid; the largest one is 1 or -1.
 */

/** Interpolates linearly between the positions of the grid, and goes on linearly beyond its edges. */
export class ImposedFlow {
  /**
   * @param {FlowField} field
   * @param {Strengths | null} strengths - Null for a constant rate.
   */
  constructor({ x, y, velocity }, strengths = null) {
    this.x = x;
    this.y = y;
    this.velocity = velocity;
    this.strengths = strengths;
  }

  /**
   * The flow with the rates that a run has recorded.
   *
   * @param {Record<string, (number | null)[]>} series - Of the run.
   * @param {number} rate - For which the velocities are.
   */
  during({ time, flow_rate: rates }, rate) {
    if (!rates) {
      return this;
    }
    const factors = rates.map((each) => Number(each) / rate);
    const largest = Math.max(...factors.map(Math.abs)) || 1;
    return new ImposedFlow(this, { times: time.map(Number), factors: factors.map((each) => each / largest) });
  }

  /**
   * How strong the flow is at a time; negative while it is reversed.
   *
   * @param {number} time
   */
  strength(time) {
    if (this.strengths === null) {
      return 1;
    }
    const { times, factors } = this.strengths;
    const after = times.findIndex((each) => each > time);
    if (after <= 0) {
      return factors[after === 0 ? 0 : factors.length - 1];
    }
    const share = (time - times[after - 1]) / (times[after] - times[after - 1]);
    return factors[after - 1] + share * (factors[after] - factors[after - 1]);
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
