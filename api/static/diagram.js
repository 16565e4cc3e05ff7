/**
 * The phase diagram of a study: all runs, the brackets of the boundary and a straight line through them. Perhaps with
 * another boundary, of the same parameters.
 *
 * A pure function from documents of the service to a figure, which `Plot` draws.
 */

import { number } from "./format.js";
import { MARKS } from "./outcomes.js";
import { axis } from "./plot.js";
import { quantity } from "./symbols.js";
import { color } from "./theme.js";
import { inUnits } from "./units.js";

/**
 * @typedef {import("./plot.js").Figure} Figure
 * @typedef {import("./units.js").Size} Size
 * @typedef {import("./units.js").Units} Units
 */

/**
 * @typedef {object} Point - Of a boundary.
 * @property {Record<string, number>} parameters
 * @property {[number | null, number | null]} bracket
 * @property {number | null} critical_value
 * @property {[string | null, string | null]} outcomes
 * @property {string} status
 * @property {{bracket: [number, number], outcomes: [string, string]}[]} changes - All that were found.
 * @property {{values: number, looked_at: number[], widest_unseen: number} | null} scanned
 * @property {{value: number, outcome: string, finer_outcome: string}[]} confirmed - Sensitive ends, run again.
 * @property {boolean} certified
 * @property {string[]} runs
 *
 * @typedef {object} Boundary
 * @property {string} study_key
 * @property {any} study
 * @property {string} name
 * @property {Point[]} points
 * @property {string} updated
 * @property {{intercept: number, slope: number} | null} fit
 *
 * @typedef {object} Mark - A run in the plane of the two parameters.
 * @property {string} key
 * @property {number[]} at - Values of the swept parameters.
 * @property {number} x - The first of them.
 * @property {number} y
 * @property {string} outcome
 * @property {string[]} text - What is said of it: outcome, place, results and errors.
 */

const LONGEST_NAME = 44; // characters in the legend, which fit on a narrow screen
const LAST_IN_LEGEND = 2000; // the default of Plotly is 1000

/**
 * @param {Boundary} boundary
 * @param {Mark[]} marks
 * @param {Boundary | null} compared
 * @param {Units} units
 * @returns {Figure}
 */
export function phaseDiagram(boundary, marks, compared, units) {
  const { scene, search } = boundary.study;
  const [across, up] = [sweepsOf(boundary.study)[0].parameter, search.parameter];
  const [x, y] = [quantity(across, scene), quantity(up, scene)];
  const sizes = { x: units.size(across), y: units.size(up) };
  const points = bracketed(boundary);
  const figure = {
    data: [
      ...fitLine(boundary, points, x.symbol, y.symbol, sizes),
      ...(compared ? comparedBoundary(compared) : []),
      ...runs(marks),
      ...brackets(boundary, points),
      ...otherBrackets(boundary),
    ],
    layout: {
      height: 480,
      margin: { l: 64, r: 16, t: 12, b: 56 },
      xaxis: axis({ title: { text: units.label(title(x), across), standoff: 12 }, range: range(boundary, marks, compared) }),
      yaxis: axis({ title: { text: units.label(title(y), up), standoff: 12 }, rangemode: "normal" }),
      legend: {
        orientation: "h",
        x: 0,
        y: 1.02,
        yanchor: "bottom",
        font: { size: 12, color: color("muted") },
      },
      hovermode: "closest",
    },
  };
  return inUnits(figure, sizes);
}

/**
 * The sweeps of a study: a table if there is one.
 *
 * @param {any} study
 * @returns {{parameter: string, values: number[]}[]}
 */
export function sweepsOf({ sweep }) {
  return Array.isArray(sweep) ? sweep : [sweep];
}

/**
 * The values of the swept parameters at a point.
 *
 * @param {Point} point
 * @param {Boundary} boundary
 */
export function placeOf(point, boundary) {
  return sweepsOf(boundary.study).map(({ parameter }) => point.parameters[parameter]);
}

/**
 * The points of a boundary that have a bracket, along the first sweep.
 *
 * @param {Boundary} boundary
 */
export function bracketed(boundary) {
  return boundary.points
    .filter((point) => point.bracket.every((end) => end !== null))
    .sort((first, second) => at(first, boundary) - at(second, boundary));
}

/** @param {{name: string, symbol: string}} quantity */
export function title({ name, symbol }) {
  return name === symbol ? name : `${name} ${symbol}`;
}

/**
 * @param {Point} point
 * @param {Boundary} boundary
 */
function at(point, boundary) {
  return placeOf(point, boundary)[0];
}

/**
 * The range of the whole sweep, so that the axis does not move when points are added.
 *
 * @param {Boundary} boundary
 * @param {Mark[]} marks
 * @param {Boundary | null} compared
 */
function range(boundary, marks, compared) {
  const swept = [boundary, compared].flatMap((each) => (each ? sweepsOf(each.study)[0].values : []));
  const all = [...swept, ...marks.map((mark) => mark.x)];
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const margin = 0.07 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

/** @param {Mark[]} marks */
function runs(marks) {
  return Object.entries(MARKS).flatMap(([outcome, { color: name, symbol }]) => {
    const chosen = marks.filter((mark) => mark.outcome === outcome);
    if (chosen.length === 0) {
      return [];
    }
    const isOpen = symbol.endsWith("-open");
    return {
      type: "scatter",
      mode: "markers",
      name: outcome,
      x: chosen.map((mark) => mark.x),
      y: chosen.map((mark) => mark.y),
      customdata: chosen.map((mark) => mark.key),
      marker: {
        symbol,
        size: 9,
        color: color(name),
        line: { width: isOpen ? 1.6 : 0.8, color: color(isOpen ? name : "page") },
      },
      text: chosen.map((mark) => mark.text.join("<br>")),
      hovertemplate: "%{text}<extra></extra>",
    };
  });
}

/** Brackets that are certified have thick and wide bars. */
const BARS = { certified: { thickness: 2.6, width: 11 }, usual: { thickness: 1.2, width: 7 } };

/**
 * @param {Boundary} boundary
 * @param {Point[]} points
 */
function brackets(boundary, points) {
  return [true, false].flatMap((certified) => {
    const chosen = points.filter((point) => point.certified === certified);
    return chosen.length > 0 ? bracketsWithLegend(boundary, chosen, certified) : [];
  });
}

/**
 * @param {Boundary} boundary
 * @param {Point[]} points
 * @param {boolean} certified
 */
function bracketsWithLegend(boundary, points, certified) {
  const bar = certified ? BARS.certified : BARS.usual;
  const ends = points.map((point) => /** @type {[number, number]} */ (point.bracket));
  const inLegend = {
    type: "scatter",
    mode: "markers",
    name: certified ? "certified bracket" : "bracket",
    x: [null],
    y: [null],
    marker: { symbol: "line-ns-open", size: 12, line: { width: bar.thickness }, color: color("ink") },
  };
  return [
    barsOf(
      points.map((point) => at(point, boundary)),
      ends,
      "ink",
      bar,
    ),
    inLegend,
  ];
}

/**
 * Another boundary: its brackets, with a line through their middles.
 *
 * @param {Boundary} boundary
 */
function comparedBoundary(boundary) {
  const points = bracketed(boundary);
  const ends = points.map((point) => /** @type {[number, number]} */ (point.bracket));
  const bars = barsOf(
    points.map((point) => at(point, boundary)),
    ends,
    "compared",
    BARS.usual,
  );
  const short = boundary.name.length > LONGEST_NAME ? `${boundary.name.slice(0, LONGEST_NAME)}…` : boundary.name;
  const name = short.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
  const legendrank = LAST_IN_LEGEND + 1;
  return [{ ...bars, name, legendrank, showlegend: true, line: { color: color("compared"), width: 1.8, dash: "2px,3px" } }];
}

/**
 * @param {number[]} x
 * @param {[number, number][]} ends
 * @param {string} name - Of a color.
 * @param {{thickness: number, width: number}} bar
 */
function barsOf(x, ends, name, bar = BARS.usual) {
  return {
    type: "scatter",
    mode: "lines",
    x,
    y: ends.map(([low, high]) => (low + high) / 2),
    line: { width: 0 },
    error_y: {
      type: "data",
      array: ends.map(([low, high]) => (high - low) / 2),
      color: color(name),
      ...bar,
    },
    hoverinfo: "skip",
    showlegend: false,
  };
}

/**
 * The changes of the outcome at a point that are not within its bracket.
 *
 * @param {Point} point
 */
export function otherChanges({ bracket: [low, high], changes }) {
  return changes.filter(
    ({ bracket: [from, to] }) => (low !== null && from < low) || (high !== null && to > high),
  );
}

/** @param {Boundary} boundary */
function otherBrackets(boundary) {
  const places = boundary.points.flatMap((point) =>
    otherChanges(point).map(({ bracket }) => ({ x: at(point, boundary), bracket })),
  );
  if (places.length === 0) {
    return [];
  }
  const bars = barsOf(
    places.map(({ x }) => x),
    places.map(({ bracket }) => bracket),
    "separated",
  );
  return [{ ...bars, name: "another change of the outcome", showlegend: true }];
}

/**
 * @param {Boundary} boundary
 * @param {Point[]} points
 * @param {string} x
 * @param {string} y
 * @param {{x: Size, y: Size}} sizes - Of the units in which the line is written.
 */
function fitLine(boundary, points, x, y, sizes) {
  const { fit } = boundary;
  if (fit === null || points.length === 0) {
    return [];
  }
  const ends = [points[0], points[points.length - 1]].map((point) => at(point, boundary));
  const sign = fit.intercept < 0 ? "−" : "+";
  const [slope, intercept] = [(fit.slope * sizes.y.value) / sizes.x.value, Math.abs(fit.intercept) * sizes.y.value];
  const line = `critical ${y} = ${number(slope, 3)} ${x} ${sign} ${number(intercept, 2)}`;
  return [
    {
      type: "scatter",
      mode: "lines",
      name: line,
      legendrank: LAST_IN_LEGEND, // it is still drawn first, below the runs
      x: ends,
      y: ends.map((end) => fit.intercept + fit.slope * end),
      line: { color: color("muted"), width: 1.3, dash: "6px,4px" },
      hoverinfo: "skip",
    },
  ];
}
