/** A boundary: its phase diagram, its points, its runs, and values read from it. */

import { changesOf, get } from "./api.js";
import { otherChanges, phaseDiagram } from "./diagram.js";
import { definitions, element, table } from "./dom.js";
import { interval, number, words } from "./format.js";
import { outcomeLabel } from "./outcomes.js";
import { Plot } from "./plot.js";
import { alertAbout } from "./problems.js";
import { goTo } from "./router.js";
import { describe, quantity, valueAt } from "./symbols.js";

/**
 * @typedef {import("./diagram.js").Boundary} Boundary
 * @typedef {import("./diagram.js").Point} Point
 * @typedef {import("./diagram.js").Mark} Mark
 */

const SECONDS_BETWEEN_REQUESTS = 0.5;
const OPEN = ["searching", "confirming", "certifying"]; // more runs are needed
const CONVERGED = "converged";

/**
 * Show a boundary, and update the view when it changes.
 *
 * @param {HTMLElement} place
 * @param {string} key
 * @param {AbortSignal} signal
 * @returns {Promise<void>} Resolved when another view is shown.
 */
export async function followBoundary(place, key, signal) {
  const marks = new Marks(signal);
  let view = null;
  for await (const boundary of changesOf(`/boundaries/${key}`, SECONDS_BETWEEN_REQUESTS, signal)) {
    const runs = await marks.of(boundary);
    view ??= new BoundaryView(place, signal);
    view.show(boundary, runs);
  }
}

/** The runs of a boundary. A run never changes, so each is requested once. */
class Marks {
  /** @type {Map<string, Promise<any>>} */
  #summaries = new Map();

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.signal = signal;
  }

  /**
   * @param {Boundary} boundary
   * @returns {Promise<Mark[]>}
   */
  async of(boundary) {
    const { sweep, search } = boundary.study;
    const keys = boundary.points.flatMap((point) => point.runs);
    const summaries = await Promise.all(keys.map((key) => this.#summary(key)));
    return summaries.map(({ key, scene, outcome }) => ({
      key,
      outcome,
      x: valueAt(scene, sweep.parameter),
      y: valueAt(scene, search.parameter),
    }));
  }

  /** @param {string} key */
  #summary(key) {
    const summary = this.#summaries.get(key) ?? get(`/runs/${key}`, this.signal);
    this.#summaries.set(key, summary);
    return summary;
  }
}

class BoundaryView {
  /**
   * @param {HTMLElement} place
   * @param {AbortSignal} signal
   */
  constructor(place, signal) {
    this.signal = signal;
    this.heading = element("div", { class: "heading" });
    this.figure = element("div", { class: "plot diagram", role: "img" });
    this.points = element("section", { "aria-label": "Points of the boundary" });
    this.runs = element("details", { class: "runs" });
    this.reading = element("section", {});
    this.plot = new Plot(this.figure, signal);
    this.plot.on(
      "plotly_click",
      ({ points: [point] }) => point.customdata && goTo(`/runs/${point.customdata}`),
    );
    place.replaceChildren(
      this.heading,
      element(
        "div",
        { class: "columns" },
        element("div", {}, this.figure, this.runs),
        element("div", {}, this.points, this.reading),
      ),
    );
  }

  /**
   * @param {Boundary} boundary
   * @param {Mark[]} marks
   */
  show(boundary, marks) {
    const { scene, sweep, search } = boundary.study;
    const state = stateOfAll(boundary.points);
    this.heading.replaceChildren(
      element("h1", {}, titleOf(boundary)),
      element("span", { class: `state ${state.name}`, role: "status" }, state.text),
      element("a", { class: "button", href: `#/new?boundary=${boundary.study_key}` }, "Trace again with changes"),
      element(
        "p",
        {},
        element("code", {}, boundary.name),
        `: ${describe(scene, [sweep.parameter, search.parameter])}`,
      ),
    );
    this.figure.setAttribute("aria-label", summary(boundary, marks));
    void this.plot.draw(() => phaseDiagram(boundary, marks));
    this.points.replaceChildren(pointsTable(boundary));
    this.#showRuns(boundary, marks);
    this.#addReadingForm(boundary);
  }

  /**
   * @param {Boundary} boundary
   * @param {Mark[]} marks
   */
  #showRuns(boundary, marks) {
    const { scene, sweep, search } = boundary.study;
    const symbols = [sweep.parameter, search.parameter].map((path) => quantity(path, scene).symbol);
    const rows = marks.map(({ key, x, y, outcome }) => [
      number(x),
      number(y),
      outcomeLabel(outcome),
      element("a", { href: `#/runs/${key}` }, "Play"),
    ]);
    this.runs.replaceChildren(
      element("summary", {}, `All ${marks.length} runs`),
      table("Runs", [...symbols, "Outcome", "Run"], rows),
    );
  }

  /** @param {Boundary} boundary */
  #addReadingForm(boundary) {
    const converged = boundary.points.filter((point) => point.status === CONVERGED);
    if (this.reading.hasChildNodes() || converged.length < 2) {
      return;
    }
    this.reading.append(...readingForm(boundary, this.signal));
  }
}

/** @param {Boundary} boundary */
function titleOf({ study: { scene, sweep, search } }) {
  return `Critical ${quantity(search.parameter, scene).name} against ${quantity(sweep.parameter, scene).name}`;
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

/** @param {Boundary} boundary */
function pointsTable(boundary) {
  const { scene, sweep, search } = boundary.study;
  const rows = boundary.points.map((point) => [
    number(point.parameters[sweep.parameter]),
    [point, ...otherChanges(point)].map(({ bracket }) => interval(bracket)).join("; also "),
    element("span", { class: `state ${stateOf(point)}` }, point.certified ? "certified" : point.status),
    scannedText(point),
  ]);
  return table(
    "Points of the boundary",
    [
      quantity(sweep.parameter, scene).symbol,
      `Critical ${quantity(search.parameter, scene).symbol}`,
      "Status",
      "Scanned",
    ],
    rows,
  );
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
function stateOf({ status }) {
  if (OPEN.includes(status)) {
    return "live";
  }
  return status === CONVERGED ? "done" : "bad";
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
 * Make a form that reads a critical value at a value of the swept parameter.
 *
 * @param {Boundary} boundary
 * @param {AbortSignal} signal
 */
function readingForm(boundary, signal) {
  const { scene, sweep, search } = boundary.study;
  const [swept, searched] = [sweep.parameter, search.parameter].map((path) => quantity(path, scene));
  const input = element("input", { id: "reading-at", type: "number", step: "any", required: true });
  const answer = element("div", { "aria-live": "polite" });

  /** @param {SubmitEvent} event */
  async function read(event) {
    event.preventDefault();
    try {
      const query = new URLSearchParams({ [sweep.parameter]: input.value });
      const { critical_value, uncertainty, method } = await get(
        `/boundaries/${boundary.study_key}/at?${query}`,
        signal,
      );
      answer.replaceChildren(
        definitions([
          [`Critical ${searched.symbol}`, number(critical_value)],
          ["Between", interval(uncertainty)],
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
      element("label", { for: "reading-at" }, `At ${swept.name} ${swept.symbol}`),
      input,
      element("button", {}, "Read"),
    ),
    answer,
  ];
}
