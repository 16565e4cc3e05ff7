/** Plots of the diagnostics of a run against time, one below the other. */

import { axis } from "./plot.js";
import { color } from "./theme.js";

/**
 * @typedef {import("./plot.js").Figure} Figure
 * @typedef {import("./units.js").Units} Units
 * @typedef {Record<string, (number | null)[]>} Series
 *
 * @typedef {object} Curve
 * @property {string} series
 * @property {string} name
 * @property {string} color - Of `theme.css`.
 *
 * @typedef {object} Panel
 * @property {string} title
 * @property {Curve[]} curves
 * @property {(value: number) => number} [convert]
 * @property {(values: (number | null)[]) => object} [ticks] - Options of the axis, computed from the stored series.
 */

const ANGLE_STEPS = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720]; // degrees between ticks
const MOST_TICKS = 5;
const LEAST_ANGLE_RANGE = 2; // degrees, so that rounding errors of a steady angle do not fill the plot

/** @param {number} radians */
function degrees(radians) {
  return (radians * 180) / Math.PI;
}

/** @param {(number | null)[]} angles - Radians. */
function angleTicks(angles) {
  const known = angles.filter((angle) => angle !== null);
  const [low, high] = [degrees(Math.min(...known)), degrees(Math.max(...known))];
  const range = high - low;
  const middle = (low + high) / 2;
  return {
    dtick: ANGLE_STEPS.find((step) => range <= MOST_TICKS * step) ?? ANGLE_STEPS[ANGLE_STEPS.length - 1],
    ...(range < LEAST_ANGLE_RANGE && {
      range: [middle - LEAST_ANGLE_RANGE / 2, middle + LEAST_ANGLE_RANGE / 2],
    }),
  };
}

const ANGLE = { convert: degrees, ticks: angleTicks };

/** Curves and panels for which a run has no series are omitted. @type {Panel[]} */
const PANELS = [
  { title: "rate of the flow", curves: [{ series: "flow_rate", name: "rate", color: "ink" }] },
  { title: "gap", curves: [{ series: "gap", name: "gap", color: "ink" }] },
  {
    title: "center angle (deg)",
    curves: [{ series: "center_angle", name: "center angle", color: "ink" }],
    ...ANGLE,
  },
  {
    title: "inclination (deg)",
    curves: [{ series: "inclination_angle", name: "inclination", color: "ink" }],
    ...ANGLE,
  },
  {
    title: "energy",
    curves: [
      { series: "bending_energy", name: "bending", color: "bound" },
      { series: "adhesion_energy", name: "adhesion", color: "separated" },
    ],
  },
  {
    title: "viscosity [μ]",
    curves: [
      { series: "viscosity_bending_tension", name: "bending + tension", color: "bound" },
      { series: "viscosity_adhesion", name: "adhesion", color: "separated" },
      { series: "viscosity_contrast", name: "viscosity contrast", color: "end-to-end" },
    ],
  },
];

/** Pixels around the axes, independent of their labels. */
export const MARGIN = { l: 56, r: 12, t: 22, b: 44 };
const PANEL_HEIGHT = 132; // pixels
const GAP = 0.42; // between panels, as a fraction of the height of one

/**
 * @param {Series} series
 * @param {any} scene
 * @param {Units} units
 * @returns {Figure}
 */
export function histories(series, scene, units) {
  const panels = PANELS.map((panel) => ({
    ...panel,
    curves: panel.curves.filter((curve) => curve.series in series),
  })).filter((panel) => panel.curves.length > 0);
  const unit = 1 / (panels.length + (panels.length - 1) * GAP);
  const axes = panels.map((panel, index) => {
    const top = 1 - index * unit * (1 + GAP);
    const domain = [Math.max(top - unit, 0), top];
    return [
      axisName("yaxis", index),
      axis({ domain, nticks: 4, automargin: false, ...panel.ticks?.(series[panel.curves[0].series]) }),
    ];
  });
  return {
    data: panels.flatMap((panel, index) => panel.curves.map((curve) => trace(series, panel, curve, index, units))),
    layout: {
      ...Object.fromEntries(axes),
      height: PANEL_HEIGHT * (panels.length * (1 + GAP)) + 30,
      margin: MARGIN,
      xaxis: axis({
        title: { text: units.label("time t", "time"), standoff: 8 },
        anchor: axisName("y", panels.length - 1),
        automargin: false,
      }),
      annotations: panels.map((panel, index) => heading(panel, axes[index][1].domain[1], units)),
      shapes: panels.flatMap((panel, index) => adhesionDistance(panel, scene, index, units)),
      hovermode: "x",
    },
  };
}

/**
 * Return the name of an axis; Plotly numbers them `y`, `y2`, `y3`.
 *
 * @param {string} name
 * @param {number} index
 */
function axisName(name, index) {
  return index === 0 ? name : `${name}${index + 1}`;
}

/**
 * The title of a panel, and below it the names of its curves if there are several.
 *
 * @param {Panel} panel
 * @param {number} top
 * @param {Units} units
 */
function heading({ title: bare, curves }, top, units) {
  const title = units.label(bare, curves[0].series);
  const names = curves.map(
    ({ name, color: of }) =>
      `<span style="color:${color(of)}">━</span> <span style="color:${color("muted")}">${name}</span>`,
  );
  return {
    text: curves.length > 1 ? `${title}<br><span style="font-size:11px">${names.join("  ")}</span>` : title,
    align: "left",
    xref: "paper",
    yref: "paper",
    x: 0,
    y: top,
    xanchor: "left",
    yanchor: "bottom",
    showarrow: false,
  };
}

/**
 * A line at the adhesion distance, across the gap, which tends to it.
 *
 * @param {Panel} panel
 * @param {any} scene
 * @param {number} index
 * @param {Units} units
 */
function adhesionDistance({ title }, scene, index, units) {
  const distance = scene.adhesion?.distance;
  if (title !== "gap" || distance === undefined) {
    return [];
  }
  const height = distance * units.size("gap").value;
  const label = { text: `δ = ${units.both("gap", distance)}`, textposition: "end", yanchor: "bottom", font: { size: 11 } };
  return [
    {
      type: "line",
      xref: "paper",
      x0: 0,
      x1: 1,
      yref: axisName("y", index),
      y0: height,
      y1: height,
      line: { color: color("muted"), width: 1, dash: "dot" },
      label: { ...label, font: { ...label.font, color: color("muted") } },
    },
  ];
}

/**
 * @param {Series} series
 * @param {Panel} panel
 * @param {Curve} curve
 * @param {number} index
 * @param {Units} units
 */
function trace(series, panel, curve, index, units) {
  const [time, size] = [units.size("time"), units.size(curve.series)];
  const convert = panel.convert ?? ((/** @type {number} */ value) => value * size.value);
  return {
    type: "scatter",
    mode: "lines",
    name: curve.name,
    x: series.time.map((value) => value === null ? null : value * time.value),
    y: series[curve.series].map((value) => (value === null ? null : convert(value))),
    yaxis: axisName("y", index),
    showlegend: false,
    line: { color: color(curve.color), width: 1.5 },
    hovertemplate: `%{y:.4g}${size.unit && ` ${size.unit}`}`,
  };
}
