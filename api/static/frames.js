/** The recorded states of a run, and interpolated states between them. */

import { getNumbers } from "./api.js";

/**
 * @typedef {object} Membrane
 * @property {Float32Array} x
 * @property {Float32Array} y
 * @property {Float32Array} tension
 *
 * @typedef {object} State
 * @property {number} time
 * @property {Membrane[]} membranes
 */

const ROWS = /** @type {const} */ (["x", "y", "tension"]);
const NUMBERS_AT_ONCE = 500_000; // in one answer; half of the default limit of the service

/** Recorded states in order of time, without states that are not finite, which a failed run may end with. */
export class Frames {
  /** @type {State[]} */
  states = [];

  /**
   * @param {number} vesicles
   * @param {number} points - On each vesicle.
   */
  constructor(vesicles, points) {
    this.vesicles = vesicles;
    this.points = points;
  }

  /** Number of values in a frame. */
  get size() {
    return 1 + 3 * this.vesicles * this.points;
  }

  /** @param {Float32Array} numbers - For each frame its time, then for each vesicle x, y and tension of all points. */
  add(numbers) {
    for (let start = 0; start < numbers.length; start += this.size) {
      const frame = numbers.subarray(start, start + this.size);
      if (frame.every(Number.isFinite)) {
        this.states.push(stateOf(frame, this.vesicles, this.points));
      }
    }
  }

  /**
   * Get all frames of a run in several requests.
   *
   * @param {any} run - The summary of the run.
   * @param {AbortSignal} signal
   * @param {number} [numbersAtOnce]
   */
  static async of({ key, scene, work }, signal, numbersAtOnce = NUMBERS_AT_ONCE) {
    const frames = new Frames(scene.vesicles.length, work.points);
    const framesAtOnce = Math.max(Math.floor(numbersAtOnce / frames.size), 1);
    for (let start = 0, isLast = false; !isLast; start += framesAtOnce) {
      const range = new URLSearchParams({ start: String(start), stop: String(start + framesAtOnce) });
      const numbers = await getNumbers(`/runs/${key}/frames?${range}`, signal);
      frames.add(numbers);
      isLast = numbers.length < framesAtOnce * frames.size;
    }
    return frames;
  }

  /** Time of the last frame. */
  get end() {
    return this.states[this.states.length - 1].time;
  }

  /**
   * Index of the last frame at or before a time.
   *
   * @param {number} time
   */
  indexAt(time) {
    const after = this.states.findIndex((state) => state.time > time);
    return after < 0 ? this.states.length - 1 : Math.max(after - 1, 0);
  }

  /**
   * Return the state at a time: a recorded one, or a cubic Hermite interpolation between two.
   *
   * @param {number} time
   * @returns {State}
   */
  at(time) {
    const index = this.indexAt(time);
    const [left, right] = [this.states[index], this.states[index + 1]];
    if (right === undefined || time <= left.time) {
      return left;
    }
    const neighbors = [this.states[index - 1] ?? left, left, right, this.states[index + 2] ?? right];
    const weights = hermiteWeights(
      neighbors.map((state) => state.time),
      time,
    );
    return {
      time,
      membranes: left.membranes.map((_, vesicle) =>
        combine(
          neighbors.map((state) => state.membranes[vesicle]),
          weights,
        ),
      ),
    };
  }
}

/**
 * @param {Float32Array} frame
 * @param {number} vesicles
 * @param {number} points
 * @returns {State}
 */
function stateOf(frame, vesicles, points) {
  const membranes = Array.from({ length: vesicles }, (_, vesicle) => {
    const rows = ROWS.map((name, row) => {
      const start = 1 + (3 * vesicle + row) * points;
      return [name, frame.subarray(start, start + points)];
    });
    return /** @type {Membrane} */ (Object.fromEntries(rows));
  });
  return { time: frame[0], membranes };
}

/**
 * Return the weights of four values in the cubic Hermite interpolation between the two inner ones.
 *
 * Slopes are central differences. At the ends of a run the inner value replaces the missing outer one, which makes
 * the slope one-sided.
 *
 * @param {number[]} times
 * @param {number} time
 * @returns {number[]}
 */
export function hermiteWeights([before, left, right, after], time) {
  const length = right - left;
  const s = (time - left) / length;
  const [valueLeft, valueRight] = [(1 + 2 * s) * (1 - s) ** 2, s ** 2 * (3 - 2 * s)];
  const slopeLeft = (s * (1 - s) ** 2 * length) / (right - before);
  const slopeRight = (s ** 2 * (s - 1) * length) / (after - left);
  return [-slopeLeft, valueLeft - slopeRight, valueRight + slopeLeft, slopeRight];
}

/**
 * @param {Membrane[]} membranes
 * @param {number[]} weights
 * @returns {Membrane}
 */
function combine(membranes, weights) {
  const rows = ROWS.map((name) => {
    const sum = membranes[0][name].map((_, point) =>
      weights.reduce((total, weight, index) => total + weight * membranes[index][name][point], 0),
    );
    return [name, sum];
  });
  return /** @type {Membrane} */ (Object.fromEntries(rows));
}
