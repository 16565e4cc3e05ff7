/** A boundary: its phase diagram, its points, its runs, and values read from it. */

import { changesOf, get, getAll } from "./api.js";
import { otherChanges, phaseDiagram, placeOf, sweepsOf } from "./diagram.js";
import { DiagramKeys } from "./diagram_keys.js";
import { definitions, element, table } from "./dom.js";
import { downloads } from "./downloads.js";
import { ends, interval, number } from "./format.js";
import { outcomeLabel } from "./outcomes.js";
import { Plot } from "./plot.js";
import { alertAbout } from "./problems.js";
import { goTo, runLink } from "./router.js";
import { surfaceCurves, surfaceMap } from "./surface.js";
import { describe, quantity, valueAt } from "./symbols.js";
import { Units } from "./units.js";

/**
 * @typedef {import("./diagram.js").Boundary} Boundary
 * @typedef {import("./diagram.js").Point} Point
 * @typedef {import("./diagram.js").Mark} Mark
 */

const SECONDS_BETWEEN_REQUESTS = 0.5;
const RUNS_AT_ONCE = 1000;
const OPEN = ["searching", "confirming", "certifying"]; // more runs are needed
const CONVERGED = "converged";

/**
 * Show a boundary, and update the view when it changes.
 *
 * @param {HTMLElement} place
 * @param {string} key
 * @param {AbortSignal} signal
 * @param {Boundary | null} [compared] - Another boundary that is drawn with it.
 * @returns {Promise<void>} Resolved when another view is shown.
 */
export async function followBoundary(place, key, signal, compared = null) {
  const marks = new Marks(key, signal);
  /** @type {BoundaryView | null} */
  let view = null;
  for await (const boundary of changesOf(`/boundaries/${key}`, SECONDS_BETWEEN_REQUESTS, signal)) {
    marks.units ??= await Units.of(`/boundaries/${key}`, boundary.study.scene, signal);
    const runs = await marks.of(boundary);
    view ??= new BoundaryView(place, signal, compared, marks.units);
    view.show(boundary, runs);
  }
}

/** The runs of a boundary. A run never changes, so they are requested only when there are new ones. */
class Marks {
  /** @type {Map<string, any>} */
  #summaries = new Map();

  /**
   * @param {string} boundary - Its key.
   * @param {AbortSignal} signal
   */
  constructor(boundary, signal) {
    this.boundary = boundary;
    this.signal = signal;
    /** @type {Units | null} */
    this.units = null;
  }

  /**
   * @param {Boundary} boundary
   * @returns {Promise<Mark[]>}
   */
  async of(boundary) {
    const paths = pathsOf(boundary);
    const keys = boundary.points.flatMap((point) => point.runs);
    if (!keys.every((key) => this.#summaries.has(key))) {
      for (const run of await getAll(`/boundaries/${this.boundary}/runs?limit=${RUNS_AT_ONCE}`, this.signal)) {
        this.#summaries.set(run.key, run);
      }
    }
    const runs = keys.flatMap((key) => this.#summaries.get(key) ?? []);
    return runs.map((run) => {
      const values = paths.map((path) => valueAt(run.scene, path));
      const at = values.slice(0, -1);
      const text = textOf(run, values, paths, boundary, this.units ?? new Units());
      return { key: run.key, outcome: run.outcome, at, x: at[0], y: values[at.length], text };
    });
  }
}

/**
 * The paths of the swept parameters and of the searched one.
 *
 * @param {Boundary} boundary
 */
function pathsOf({ study }) {
  return [...sweepsOf(study).map(({ parameter }) => parameter), study.search.parameter];
}

/** @param {Boundary} boundary */
function symbolsOf(boundary) {
  return pathsOf(boundary).map((path) => quantity(path, boundary.study.scene).symbol);
}

/**
 * Say in a few lines what became of a run, and how far to trust it.
 *
 * @param {any} run
 * @param {number[]} values
 * @param {string[]} paths - Of the values.
 * @param {Boundary} boundary
 * @param {Units} units
 */
function textOf({ outcome, failure, period, gap, error, work }, values, paths, boundary, units) {
  const known = (/** @type {string} */ name, /** @type {any} */ value, /** @type {any} */ uncertainty) =>
    typeof value === "number"
      ? [`${name} ${units.both(name, value, (shown) => withUncertainty(shown, (uncertainty * shown) / value))}`]
      : [];
  return [
    `${outcome}${failure ? `: ${failure.replaceAll("<", "‹")}` : ""}`,
    symbolsOf(boundary)
      .map((symbol, index) => `${symbol} = ${units.both(paths[index], values[index])}`)
      .join(", "),
    ...known("period", period, error.period),
    ...known("gap", gap, null),
    ...known("position error", error.global, null),
    `area error ${number(error.area, 2)}, spatial error ${number(error.spatial, 2)}`,
    `${work.points} points on each vesicle`,
  ];
}

/**
 * @param {number} value
 * @param {number} uncertainty - NaN if it is not known.
 */
function withUncertainty(value, uncertainty) {
  return uncertainty > 0 ? `${number(value)} ± ${number(uncertainty, 1)}` : number(value);
}

class BoundaryView {
  /**
   * @param {HTMLElement} place
   * @param {AbortSignal} signal
   * @param {Boundary | null} compared
   * @param {Units} units
   */
  constructor(place, signal, compared, units) {
    this.signal = signal;
    this.units = units;
    this.compared = compared;
    this.heading = element("div", { class: "heading" });
    this.figure = element("div", { class: "plot diagram", role: "application", tabindex: 0 });
    this.status = element("p", { class: "note", role: "status" });
    this.map = element("div", { class: "plot" });
    this.points = element("section", { "aria-label": "Points of the boundary" });
    this.runs = element("details", { class: "runs" });
    this.reading = element("section", {});
    this.files = element("div", {});
    this.plot = new Plot(this.figure, signal);
    /** @type {DiagramKeys | null} */
    this.keys = null;
    this.mapPlot = new Plot(this.map, signal);
    this.plot.on(
      "plotly_click",
      ({ points: [point] }) => point.customdata && goTo(`/runs/${point.customdata}`),
    );
    place.replaceChildren(
      this.heading,
      element(
        "div",
        { class: "columns" },
        element("div", {}, this.figure, this.status, this.map, this.files, this.runs),
        element("div", {}, this.points, this.reading),
      ),
    );
  }

  /**
   * @param {Boundary} boundary
   * @param {Mark[]} marks
   */
  show(boundary, marks) {
    const state = stateOfAll(boundary.points);
    this.heading.replaceChildren(
      element("h1", {}, titleOf(boundary)),
      element("span", { class: `state ${state.name}`, role: "status" }, state.text),
      element("a", { class: "button", href: `#/new?boundary=${boundary.study_key}` }, "Trace again with changes"),
      element(
        "p",
        {},
        element("code", {}, boundary.name),
        `: ${describe(boundary.study.scene, pathsOf(boundary), this.units)}`,
      ),
    );
    this.figure.setAttribute("aria-label", summary(boundary, marks));
    this.#draw(boundary, marks);
    this.points.replaceChildren(pointsTable(boundary, marks, this.units));
    if (!this.files.hasChildNodes()) {
      const key = boundary.study_key;
      const formats = /** @type {[string, string][]} */ ([
        ["svg", "figure"],
        ["csv", "CSV"],
      ]);
      this.files.append(downloads(`/boundaries/${key}/file`, `boundary-${key.slice(0, 8)}`, formats));
    }
    this.#showRuns(boundary, marks);
    this.#addReadingForm(boundary);
  }

  /**
   * @param {Boundary} boundary
   * @param {Mark[]} marks
   */
  #draw(boundary, marks) {
    const [, ...others] = sweepsOf(boundary.study);
    if (others.length === 0) {
      void this.plot.draw(() => phaseDiagram(boundary, marks, this.compared, this.units));
      this.keys ??= new DiagramKeys(this.plot, this.status);
      this.keys.follow(marks);
      return;
    }
    void this.plot.draw(() => surfaceCurves(boundary, this.units));
    if (others.length === 1) {
      this.map.setAttribute("role", "application");
      this.map.setAttribute("aria-label", `Map. ${titleOf(boundary)}`);
      void this.mapPlot.draw(() => surfaceMap(boundary, this.units));
    }
  }

  /**
   * @param {Boundary} boundary
   * @param {Mark[]} marks
   */
  #showRuns(boundary, marks) {
    const paths = pathsOf(boundary);
    const rows = marks.map(({ key, at, y, outcome }) => [
      ...[...at, y].map((value, index) => this.units.both(paths[index], value)),
      outcomeLabel(outcome),
      runLink(key),
    ]);
    this.runs.replaceChildren(
      element("summary", {}, `All ${marks.length} runs`),
      table("Runs", [...symbolsOf(boundary), "Outcome", "Run"], rows),
    );
  }

  /** @param {Boundary} boundary */
  #addReadingForm(boundary) {
    const converged = boundary.points.filter((point) => point.status === CONVERGED);
    if (this.reading.hasChildNodes() || converged.length < 2) {
      return;
    }
    this.reading.append(...readingForm(boundary, this.units, this.signal));
  }
}

/** @param {Boundary} boundary */
function titleOf({ study }) {
  const [searched, ...swept] = [study.search, ...sweepsOf(study)].map(
    ({ parameter }) => quantity(parameter, study.scene).name,
  );
  return `Critical ${searched} against ${swept.join(" and ")}`;
}

/**
 * Describe the diagram in words.
 *
 * @param {Boundary} boundary
 * @param {Mark[]} marks
 */
function summary(boundary, marks) {
  return `Phase diagram. ${titleOf(boundary)}: ${marks.length} runs, ${boundary.points.length} points of the boundary`;
}

/**
 * @param {Boundary} boundary
 * @param {Mark[]} marks
 * @param {Units} units
 */
function pointsTable(boundary, marks, units) {
  const [symbols, paths] = [symbolsOf(boundary), pathsOf(boundary)];
  const size = units.size(paths[paths.length - 1]);
  const rows = boundary.points.map((point) => [
    ...placeOf(point, boundary).map((value, index) => units.both(paths[index], value)),
    [point, ...otherChanges(point)].flatMap(({ bracket }, index) => [
      index > 0 ? "; also " : "",
      bracketLinks(bracket, placeOf(point, boundary), marks),
      measuredInterval(bracket, size),
    ]),
    element("span", { class: `state ${stateOf(point)}` }, point.certified ? "certified" : point.status),
    scannedText(point),
  ]);
  return table(
    "Points of the boundary",
    [...symbols.slice(0, -1), `Critical ${symbols[symbols.length - 1]}`, "Status", "Scanned"],
    rows,
  );
}

/**
 * Write a bracket whose ends lead to their runs.
 *
 * @param {[number | null, number | null]} bracket
 * @param {number[]} place - Values of the swept parameters.
 * @param {Mark[]} marks
 * @returns {import("./dom.js").Child}
 */
function bracketLinks(bracket, place, marks) {
  const [low, high] = bracket;
  if (low === null || high === null) {
    return interval(bracket);
  }
  const links = ends([low, high]).map((text, index) => {
    const mark = marks.find(({ at, y }) => y === bracket[index] && at.join() === place.join());
    return mark ? element("a", { href: `#/runs/${mark.key}`, title: mark.outcome }, text) : text;
  });
  return [links[0], " – ", links[1]];
}

/**
 * Write what follows a bracket: in brackets the same with its unit, if it has one that is known.
 *
 * @param {[number | null, number | null]} bracket
 * @param {import("./units.js").Size} size
 */
function measuredInterval(bracket, { value, unit }) {
  const [low, high] = bracket.map((end) => (end === null ? null : end * value));
  const isKnown = unit && (low !== null || high !== null);
  return isKnown ? ` (${interval([low, high])} ${unit})` : "";
}

/**
 * Say how many values were looked at beside the brackets, and how wide an unseen window may be.
 *
 * @param {Point} point
 */
function scannedText({ scanned }) {
  return scanned === null
    ? "–"
    : `${scanned.values} values, unseen ≤ ×${number(scanned.widest_unseen, 3)}`;
}

/** @param {Point} point */
function stateOf({ status, certified }) {
  if (OPEN.includes(status)) {
    return "live";
  }
  return status === CONVERGED ? `done ${certified ? "certified" : ""}` : "bad";
}

/** @param {Point[]} points */
function stateOfAll(points) {
  const open = points.filter(({ status }) => OPEN.includes(status)).length;
  const converged = points.filter(({ status }) => status === CONVERGED).length;
  if (open > 0) {
    return { name: "live", text: `tracing, ${open} of ${points.length} open` };
  }
  return converged === points.length
    ? { name: "done", text: "complete" }
    : { name: "bad", text: `${converged} of ${points.length} converged` };
}

/**
 * Make a form that reads a critical value at values of the swept parameters.
 *
 * @param {Boundary} boundary
 * @param {Units} units
 * @param {AbortSignal} signal
 */
function readingForm(boundary, units, signal) {
  const { scene, search } = boundary.study;
  const [searched, size] = [quantity(search.parameter, scene), units.size(search.parameter)];
  const inputs = sweepsOf(boundary.study).map(({ parameter }, index) => {
    const { name, symbol } = quantity(parameter, scene);
    const id = `reading-at-${index}`;
    const input = element("input", { id, name: parameter, type: "number", step: "any", required: true });
    const { value, unit } = units.size(parameter);
    const label = `${index > 0 ? "and" : "At"} ${name} ${symbol}${unit && ` in ${number(value)} ${unit}`}`;
    return { input, label: element("label", { for: id }, label) };
  });
  const answer = element("div", { "aria-live": "polite" });

  /** @param {SubmitEvent} event */
  async function read(event) {
    event.preventDefault();
    try {
      const query = new URLSearchParams(inputs.map(({ input }) => [input.name, input.value]));
      const { critical_value, uncertainty, method } = await get(
        `/boundaries/${boundary.study_key}/at?${query}`,
        signal,
      );
      answer.replaceChildren(
        definitions([
          [`Critical ${searched.symbol}`, units.both(search.parameter, critical_value)],
          ["Between", interval(uncertainty) + measuredInterval(uncertainty, size)],
          ["Method", method],
        ]),
      );
    } catch (error) {
      answer.replaceChildren(alertAbout(error));
    }
  }

  return [
    element("h2", {}, "Read a critical value"),
    element(
      "form",
      { class: "inline", onsubmit: read },
      ...inputs.flatMap(({ input, label }) => [label, input]),
      element("button", {}, "Read"),
    ),
    answer,
  ];
}
