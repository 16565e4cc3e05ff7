/** Draws states on a canvas: membranes colored by tension, arrows of the flow, a color bar and a scale. */

import { tensionColor, tensionRange } from "./colormap.js";
import { number } from "./format.js";
import { color, isDark } from "./theme.js";
import { refined } from "./trigonometric.js";

/**
 * @typedef {import("./frames.js").Frames} Frames
 * @typedef {import("./frames.js").State} State
 * @typedef {import("./frames.js").Membrane} Membrane
 */

const THICKEST_MEMBRANE = 4.5; // pixels, like the following lengths
const THINNEST_MEMBRANE = 1.2;
const ARROWS_APART = 56;
const LONGEST_ARROW = 34;
const MARGIN = 28;
const FOOT = 48; // below the drawing, for the color bar and the scale
const MEMBRANE_THICKNESS = 0.1; // in units of length, within these bounds
const SHADES = 64; // different colors of the color map
const SMOOTH = 3; // pixels between points of a curve, at most
const MOST_REFINED = 8; // times the points
const BAR = { width: 180, height: 8 };

/** A canvas that follows the mean of the vesicles' centers, with one scale for the whole run. */
export class MembraneCanvas {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Frames} frames
   * @param {import("./flow.js").ImposedFlow | null} flow - Null in a fluid at rest.
   * @param {any} scene - Of the run.
   * @param {import("./units.js").Units} units - Of the scene.
   */
  constructor(canvas, frames, flow, scene, units) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.flow = flow;
    this.units = units;
    this.distance = scene.adhesion?.distance ?? null;
    this.longest = Math.max(...scene.vesicles.map((/** @type {any} */ { length }) => length));
    this.range = tensionRange(frames.states);
    this.reach = reachOf(frames.states);
    this.style = pageStyle();
  }

  /** Use the present colors of the page. */
  takeColors() {
    this.style = pageStyle();
  }

  /** @param {State} state */
  draw(state) {
    const { context } = this;
    const { width, height } = this.#fit();
    const [halfWidth, halfHeight] = [width / 2 - MARGIN, (height - FOOT) / 2 - MARGIN];
    const scale = Math.min(halfWidth / this.reach.x, halfHeight / this.reach.y);
    const thickness = Math.max(THINNEST_MEMBRANE, Math.min(THICKEST_MEMBRANE, MEMBRANE_THICKNESS * scale));
    const [x, y] = meanCenter(state);
    const [left, top] = [width / 2, (height - FOOT) / 2];
    context.clearRect(0, 0, width, height);
    this.#drawFlow(width, height - FOOT, scale, [x, y], state.time);
    const factor = this.#refinement(state, scale);
    const outlines = state.membranes.map((membrane) => ({
      x: refined(membrane.x, factor).map((value) => left + scale * (value - x)),
      y: refined(membrane.y, factor).map((value) => top - scale * (value - y)),
      tension: refined(membrane.tension, factor),
    }));
    this.#fill(outlines);
    this.#stroke(outlines, thickness);
    this.#drawColorBar(width, height);
    this.#drawScale(height, scale);
  }

  /**
   * How many times the computed points a curve needs to look smooth at a scale.
   *
   * @param {State} state
   * @param {number} scale
   */
  #refinement({ membranes: [{ x: points }] }, scale) {
    const spacing = (scale * this.longest) / points.length;
    return Math.min(Math.max(Math.ceil(spacing / SMOOTH), 1), MOST_REFINED);
  }

  /** Give the canvas the resolution of the screen, with coordinates in pixels of the page. */
  #fit() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = window.devicePixelRatio;
    const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== columns || this.canvas.height !== rows) {
      this.canvas.width = columns;
      this.canvas.height = rows;
    }
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { width, height };
  }

  /** @param {Membrane[]} outlines - In pixels. */
  #fill(outlines) {
    const { context } = this;
    context.fillStyle = this.style.surface; // hides the arrows of the imposed flow inside
    for (const { x, y } of outlines) {
      context.beginPath();
      x.forEach((value, point) => context.lineTo(value, y[point]));
      context.fill();
    }
  }

  /**
   * Draw a quadratic curve around each point, between the midpoints to its neighbors.
   *
   * Curves of one color are drawn together, which is much faster if there are many vesicles.
   *
   * @param {Membrane[]} outlines - In pixels.
   * @param {number} lineWidth - Thin where vesicles are many and small.
   */
  #stroke(outlines, lineWidth) {
    const { context } = this;
    const [low, high] = this.range;
    const pieces = Array.from({ length: SHADES }, () => new Path2D());
    for (const { x, y, tension } of outlines) {
      const count = x.length;
      for (let point = 0; point < count; point += 1) {
        const before = point === 0 ? count - 1 : point - 1;
        const after = point === count - 1 ? 0 : point + 1;
        const share = Math.min(Math.max((tension[point] - low) / (high - low), 0), 1);
        const path = pieces[Math.round(share * (SHADES - 1))];
        path.moveTo((x[before] + x[point]) / 2, (y[before] + y[point]) / 2);
        path.quadraticCurveTo(x[point], y[point], (x[point] + x[after]) / 2, (y[point] + y[after]) / 2);
      }
    }
    context.lineWidth = lineWidth;
    context.lineCap = "round";
    pieces.forEach((path, shade) => {
      context.strokeStyle = tensionColor(shade / (SHADES - 1), this.style.isDark);
      context.stroke(path);
    });
  }

  /**
   * Draw arrows of the flow relative to the center of the view, scaled to the fastest flow in view during the run.
   *
   * @param {number} width
   * @param {number} height
   * @param {number} scale - Pixels in the unit of length.
   * @param {[number, number]} middle - The place that is shown in the middle.
   * @param {number} time
   */
  #drawFlow(width, height, scale, [middleX, middleY], time) {
    const { flow } = this;
    if (flow === null) {
      return;
    }
    const [columns, rows] = [Math.floor(width / ARROWS_APART), Math.floor(height / ARROWS_APART)];
    const [u, v] = flow.at(middleX, middleY);
    const relative = (/** @type {number} */ x, /** @type {number} */ y) => {
      const [there, upThere] = flow.at(middleX + x / scale, middleY + y / scale);
      return [there - u, upThere - v];
    };
    const corners = [-1, 1].flatMap((side) =>
      [-1, 1].map((end) => Math.hypot(...relative((side * width) / 2, (end * height) / 2))),
    );
    const stretch = (LONGEST_ARROW * flow.strength(time)) / Math.max(...corners);
    this.context.strokeStyle = this.style.arrows;
    this.context.lineWidth = 1.2;
    for (let row = 0; row < rows; row += 1) {
      for (let column = 0; column < columns; column += 1) {
        const x = (column - (columns - 1) / 2) * ARROWS_APART;
        const y = ((rows - 1) / 2 - row) * ARROWS_APART;
        const [dx, dy] = relative(x, y).map((speed) => stretch * speed);
        this.#drawArrow(width / 2 + x - dx / 2, height / 2 - y + dy / 2, dx, -dy);
      }
    }
  }

  /**
   * @param {number} x
   * @param {number} y
   * @param {number} dx
   * @param {number} dy
   */
  #drawArrow(x, y, dx, dy) {
    const { context } = this;
    const length = Math.hypot(dx, dy);
    if (length < 2) {
      return;
    }
    const head = Math.min(4, length / 2) / length;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + dx, y + dy);
    context.moveTo(x + dx - head * (dx - 0.7 * dy), y + dy - head * (dy + 0.7 * dx));
    context.lineTo(x + dx, y + dy);
    context.lineTo(x + dx - head * (dx + 0.7 * dy), y + dy - head * (dy - 0.7 * dx));
    context.stroke();
  }

  /**
   * @param {number} width
   * @param {number} height
   */
  #drawColorBar(width, height) {
    const { context } = this;
    const barWidth = Math.min(BAR.width, width * 0.45);
    const [left, top] = [width - MARGIN - barWidth, height - FOOT + 22];
    const fill = context.createLinearGradient(left, 0, left + barWidth, 0);
    for (let stop = 0; stop <= 16; stop += 1) {
      fill.addColorStop(stop / 16, tensionColor(stop / 16, this.style.isDark));
    }
    context.fillStyle = fill;
    context.fillRect(left, top, barWidth, BAR.height);
    context.fillStyle = this.style.muted;
    context.font = this.style.font;
    context.textBaseline = "bottom";
    context.textAlign = "left";
    const [low, high] = this.range.map((end) => number(end * this.units.size("tension").value, 2));
    context.fillText(low, left, top - 3);
    context.textAlign = "right";
    context.fillText(high, left + barWidth, top - 3);
    context.textAlign = "center";
    context.fillText(this.units.label(barWidth < BAR.width ? "σ" : "tension σ", "tension"), left + barWidth / 2, top - 3);
  }

  /**
   * A line as long as the unit of length, and one as long as the adhesion distance.
   *
   * @param {number} height
   * @param {number} scale
   */
  #drawScale(height, scale) {
    const { context } = this;
    const y = height - FOOT + 26;
    context.strokeStyle = this.style.muted;
    context.lineWidth = 1.2;
    context.textAlign = "left";
    const line = (/** @type {number} */ start, /** @type {number} */ length, /** @type {string} */ text) => {
      context.beginPath();
      context.moveTo(start, y);
      context.lineTo(start + length, y);
      context.stroke();
      context.fillText(text, start, y - 6);
      return start + Math.max(length, context.measureText(text).width) + 18;
    };
    const { value, unit } = this.units.size("x");
    const next = line(MARGIN, scale, unit ? `${number(value)} ${unit}` : "length 1");
    if (this.distance !== null) {
      line(next, scale * this.distance, `δ = ${number(this.distance * value)} ${unit}`.trim());
    }
  }
}

function pageStyle() {
  return {
    isDark: isDark(),
    muted: color("muted"),
    arrows: color("arrows"),
    surface: color("surface"),
    font: `12px ${window.getComputedStyle(document.body).fontFamily}`,
  };
}

/**
 * @param {State} state
 * @returns {[number, number]}
 */
function meanCenter({ membranes }) {
  const mean = (/** @type {"x" | "y"} */ axis) =>
    membranes.reduce(
      (sum, membrane) =>
        sum + membrane[axis].reduce((total, value) => total + value, 0) / membrane[axis].length,
      0,
    ) / membranes.length;
  return [mean("x"), mean("y")];
}

/**
 * Return the largest distance of the membranes from their mean center, over the whole run.
 *
 * @param {State[]} states
 */
function reachOf(states) {
  const reach = { x: 0, y: 0 };
  for (const state of states) {
    const center = meanCenter(state);
    for (const membrane of state.membranes) {
      for (const [index, axis] of /** @type {const} */ (["x", "y"]).entries()) {
        for (const value of membrane[axis]) {
          reach[axis] = Math.max(reach[axis], Math.abs(value - center[index]));
        }
      }
    }
  }
  return reach;
}
