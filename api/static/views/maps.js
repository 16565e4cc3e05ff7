/** The maps of the store, and one of them in detail: the selected one or the newest. */

import { get, getAll } from "../api.js";
import { title } from "../diagram.js";
import { element, table } from "../dom.js";
import { downloads } from "../downloads.js";
import { dateAndTime, number, words } from "../format.js";
import { MARKS } from "../outcomes.js";
import { Plot, axis } from "../plot.js";
import { goTo } from "../router.js";
import { describe, quantity } from "../symbols.js";
import { color } from "../theme.js";
import { Units, inUnits } from "../units.js";

/**
 * @typedef {object} OutcomeMap
 * @property {string} key
 * @property {string} name
 * @property {any} map - The question.
 * @property {string[]} labels
 * @property {number[][]} cells - Numbers of labels, by the first axis and then by the second one.
 * @property {{cell: [number, number], run: string}[]} runs
 * @property {[number[], number[]]} edges
 * @property {[number[], number[]]} values
 * @property {string} updated
 */

/**
 * @typedef {object} ListedMap
 * @property {string} key
 * @property {string} name
 * @property {number} runs
 * @property {string} updated
 */

const OTHER_COLORS = ["bound", "undecided", "end-to-end", "steady", "equilibrium", "separated"];

/** @param {import("../router.js").Place} place */
export async function showMaps({ content, parameters, signal }) {
  /** @type {ListedMap[]} */
  const maps = await getAll("/maps", signal);
  maps.sort((first, second) => second.updated.localeCompare(first.updated));
  const key = parameters.key ?? maps[0]?.key;
  if (key === undefined) {
    const link = element("a", { href: "#/new?preset=shear-hamaker-map" }, "Draw the first one");
    content.replaceChildren(
      element("h1", {}, "Maps"),
      element("p", {}, "No map is stored yet. A map shows what becomes of a scene all over two of its parameters. ", link),
    );
    return;
  }
  /** @type {OutcomeMap} */
  const shown = await get(`/maps/${key}`, signal);
  const units = await Units.of(`/maps/${key}`, shown.map.scene, signal);
  document.title = `${words(shown.name)} – Vesicle ensemble`;
  const figure = element("div", { class: "plot diagram", role: "application", "aria-label": titleOf(shown) });
  const plot = new Plot(figure, signal);
  plot.on("plotly_click", ({ points: [point] }) => point.customdata && goTo(`/runs/${point.customdata}`));
  content.replaceChildren(
    element("h1", {}, titleOf(shown)),
    element("p", {}, element("code", {}, shown.name), `: ${describe(shown.map.scene, pathsOf(shown), units)}`),
    figure,
    element("p", { class: "note" }, "Each dot is a run, and a click opens it. Cells without one have the label around them, or no scene."),
    downloads(`/maps/${key}/file`, `map-${key.slice(0, 8)}`, [["svg", "figure"]]),
    shares(shown),
    ...others(maps, key),
  );
  await plot.draw(() => mapFigure(shown, units));
}

/** @param {OutcomeMap} shown */
function pathsOf({ map }) {
  return map.axes.map((/** @type {{parameter: string}} */ { parameter }) => parameter);
}

/** @param {OutcomeMap} shown */
function titleOf(shown) {
  const [first, second] = pathsOf(shown).map((/** @type {string} */ path) => quantity(path, shown.map.scene).name);
  return `${words(shown.map.label)} over ${first} and ${second}`;
}

/** @param {OutcomeMap} shown */
function shares({ labels, cells, runs }) {
  const all = cells.flat();
  const rows = labels.map((label, index) => [
    label,
    `${number((100 * all.filter((each) => each === index).length) / all.length, 3)} %`,
    String(runs.filter(({ cell: [i, j] }) => cells[i][j] === index).length),
  ]);
  return table("Shares of the map", ["Label", "Share", "Runs"], rows);
}

/**
 * @param {ListedMap[]} maps
 * @param {string} shown - Key.
 */
function others(maps, shown) {
  if (maps.length < 2) {
    return [];
  }
  const links = maps.map(({ key, name, runs, updated }) =>
    element(
      "li",
      {},
      element(
        "a",
        { href: `#/maps/${key}`, "aria-current": key === shown ? "true" : null },
        element("strong", {}, words(name)),
        element("span", {}, `${runs} runs, ${dateAndTime(updated)}`),
      ),
    ),
  );
  return [element("section", { class: "shelf" }, element("h2", {}, "All maps"), element("ul", {}, ...links))];
}

/**
 * @param {OutcomeMap} shown
 * @param {Units} units
 */
function mapFigure(shown, units) {
  const { labels, cells, runs, edges, values, map } = shown;
  const colors = labels.map((label, index) => color(MARKS[label]?.color ?? OTHER_COLORS[index % OTHER_COLORS.length]));
  const paths = pathsOf(shown);
  const [x, y] = paths.map((/** @type {string} */ path) => units.label(title(quantity(path, map.scene)), path));
  const [horizontal, vertical] = map.axes.map((/** @type {{spacing: string}} */ { spacing }) =>
    spacing === "linear" ? "linear" : "log",
  );
  const steps = colors.flatMap((name, index) => [
    [index / colors.length, name],
    [(index + 1) / colors.length, name],
  ]);
  const figure = {
    data: [
      {
        type: "heatmap",
        x: edges[0],
        y: edges[1],
        z: values[1].map((_, row) => values[0].map((__, column) => cells[column][row])),
        colorscale: steps,
        zmin: -0.5,
        zmax: labels.length - 0.5,
        opacity: 0.4,
        showscale: false,
        hoverinfo: "skip",
      },
      ...labels.map((label, index) => {
        const made = runs.filter(({ cell: [i, j] }) => cells[i][j] === index);
        return {
          type: "scatter",
          mode: "markers",
          name: label,
          x: made.map(({ cell: [i] }) => values[0][i]),
          y: made.map(({ cell: [, j] }) => values[1][j]),
          customdata: made.map(({ run }) => run),
          marker: { color: colors[index], size: 5 },
          hovertemplate: `${label}<br>%{x:.4g}, %{y:.4g}<extra></extra>`,
        };
      }),
    ],
    layout: {
      height: 520,
      margin: { l: 64, r: 16, t: 12, b: 56 },
      xaxis: axis({ title: { text: x, standoff: 12 }, type: horizontal }),
      yaxis: axis({ title: { text: y, standoff: 12 }, type: vertical }),
      showlegend: true,
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12, color: color("muted") } },
      hovermode: "closest",
    },
  };
  return inUnits(figure, { x: units.size(paths[0]), y: units.size(paths[1]) });
}
