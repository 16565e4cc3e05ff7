/**
 * The boundary of a study that sweeps several parameters: curves of the first one, and a filled map of two.
 *
 * Pure functions from documents of the service to figures, which `Plot` draws.
 */

import { bracketed, placeOf, sweepsOf, title } from "./diagram.js";
import { axis } from "./plot.js";
import { quantity } from "./symbols.js";
import { color } from "./theme.js";
import { inUnits } from "./units.js";

/**
 * @typedef {import("./diagram.js").Boundary} Boundary
 * @typedef {import("./diagram.js").Point} Point
 * @typedef {import("./plot.js").Figure} Figure
 * @typedef {import("./units.js").Units} Units
 */

// Viridis without its pale end, which would vanish on a light page.
const FIRST_TO_LAST = ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39"];
const COLORSCALE = FIRST_TO_LAST.map((name, index) => [index / (FIRST_TO_LAST.length - 1), name]);

const LAYOUT = { height: 420, margin: { l: 64, r: 16, t: 12, b: 56 }, hovermode: "closest" };

/**
 * Draw a curve of the first parameter, with brackets, for each value of the others.
 *
 * @param {Boundary} boundary
 * @param {Units} units
 * @returns {Figure}
 */
export function surfaceCurves(boundary, units) {
  const { scene, search } = boundary.study;
  const [across, ...paths] = sweepsOf(boundary.study).map(({ parameter }) => parameter);
  const first = quantity(across, scene);
  const name = (/** @type {Point[]} */ points) =>
    paths
      .map((path, index) => `${quantity(path, scene).symbol} = ${units.both(path, placeOf(points[0], boundary)[index + 1])}`)
      .join(", ");
  const searched = quantity(search.parameter, scene);
  const curves = curvesOf(boundary);
  const figure = {
    data: curves.map((points, index) =>
      curve(boundary, points, name(points), colorAt(curves.length > 1 ? index / (curves.length - 1) : 0)),
    ),
    layout: {
      ...LAYOUT,
      xaxis: axis({ title: { text: units.label(title(first), across), standoff: 12 } }),
      yaxis: axis({ title: { text: units.label(`critical ${title(searched)}`, search.parameter), standoff: 12 }, rangemode: "normal" }),
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12, color: color("muted") } },
    },
  };
  return inUnits(figure, { x: units.size(across), y: units.size(search.parameter) });
}

/**
 * The points that have a bracket, in groups that differ in the first parameter only.
 *
 * @param {Boundary} boundary
 */
function curvesOf(boundary) {
  /** @type {Map<string, Point[]>} */
  const curves = new Map();
  for (const point of bracketed(boundary)) {
    const others = placeOf(point, boundary).slice(1).join();
    curves.set(others, [...(curves.get(others) ?? []), point]);
  }
  return [...curves.values()];
}

/**
 * @param {Boundary} boundary
 * @param {Point[]} points - Of the curve.
 * @param {string} name - The parameters that do not change along it.
 * @param {string} stroke
 */
function curve(boundary, points, name, stroke) {
  const places = points.map((point) => placeOf(point, boundary));
  const critical = points.map((point) => point.critical_value ?? NaN);
  return {
    type: "scatter",
    mode: "lines+markers",
    name,
    showlegend: true,
    x: places.map(([x]) => x),
    y: critical,
    line: { color: stroke, width: 1.8 },
    marker: { color: stroke, size: 4 },
    error_y: {
      type: "data",
      symmetric: false,
      array: points.map(({ bracket: [, high] }, index) => (high ?? NaN) - critical[index]),
      arrayminus: points.map(({ bracket: [low] }, index) => critical[index] - (low ?? NaN)),
      color: stroke,
      thickness: 1.2,
      width: 3,
    },
  };
}

/** @param {number} share - From 0 to 1. */
function colorAt(share) {
  return FIRST_TO_LAST[Math.round(share * (FIRST_TO_LAST.length - 1))];
}

/**
 * Draw the critical values over two parameters as a filled map.
 *
 * @param {Boundary} boundary
 * @param {Units} units
 * @returns {Figure}
 */
export function surfaceMap(boundary, units) {
  const { scene, search } = boundary.study;
  const [first, second] = sweepsOf(boundary.study);
  const [x, y] = [first, second].map(({ values }) => [...values].sort((one, other) => one - other));
  const known = new Map(
    boundary.points.map((point) => [placeOf(point, boundary).join(), point.critical_value]),
  );
  const label = (/** @type {string} */ path) => units.label(title(quantity(path, scene)), path);
  const critical = units.label(`critical ${quantity(search.parameter, scene).symbol}`, search.parameter);
  const [across, up] = [first, second].map(({ parameter }) => label(parameter));
  const figure = {
    data: [
      {
        type: "contour",
        x,
        y,
        z: y.map((other) => x.map((at) => known.get([at, other].join()) ?? null)),
        colorscale: COLORSCALE,
        colorbar: { title: { text: critical }, thickness: 14 },
        contours: { coloring: "fill" },
        line: { width: 0 },
        hovertemplate: "%{x}, %{y}: %{z:.4g}<extra></extra>",
      },
    ],
    layout: {
      ...LAYOUT,
      xaxis: axis({ title: { text: across, standoff: 12 } }),
      yaxis: axis({ title: { text: up, standoff: 12 } }),
    },
  };
  const [x_size, y_size, z] = [first.parameter, second.parameter, search.parameter].map((path) => units.size(path));
  return inUnits(figure, { x: x_size, y: y_size, z });
}
