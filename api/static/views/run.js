/** One run: a player, its diagnostics, its results and its scene; as far as it is, if it is not done. */

import { get } from "../api.js";
import { Cursor } from "../cursor.js";
import { definitions, element } from "../dom.js";
import { downloads } from "../downloads.js";
import { ImposedFlow } from "../flow.js";
import { dateAndTime, duration, number } from "../format.js";
import { Frames } from "../frames.js";
import { MARGIN, histories } from "../history.js";
import { outcomeLabel } from "../outcomes.js";
import { Player } from "../player.js";
import { Plot } from "../plot.js";
import { Problem } from "../problems.js";
import { keepInAddress } from "../router.js";
import { seriesOf } from "../series.js";
import { describe } from "../symbols.js";
import { Units } from "../units.js";
import { watchRun } from "./unfinished_run.js";

/** @param {import("../router.js").Place} place */
export async function showRun(place) {
  try {
    await showFinishedRun(place);
  } catch (problem) {
    if (!(problem instanceof Problem) || problem.status !== 404) {
      throw problem;
    }
    if (!(await watchRun(place))) {
      throw new Problem(404, `${problem.message}; one in progress is shown from its first checkpoint on`);
    }
    await showRun(place); // it is done
  }
}

/** @param {import("../router.js").Place} place */
async function showFinishedRun({ content, parameters, query, signal }) {
  const { key } = parameters;
  const run = await get(`/runs/${key}`, signal);
  const units = await Units.of(`/runs/${key}`, run.scene, signal);
  document.title = `Run ${key.slice(0, 8)}: ${run.outcome} – Vesicle ensemble`;
  const stage = element("div", { class: "stage" });
  const plots = element("div", { class: "plot" });
  content.replaceChildren(
    heading(run, units),
    element(
      "div",
      { class: "columns run" },
      stage,
      element("div", { class: "histories" }, plots),
      results(run, units),
    ),
    sceneOf(run),
  );

  const loading = stage.appendChild(element("p", { class: "note", role: "status" }, "Loading the states…"));
  const [frames, flow, series] = await Promise.all([
    Frames.of(run, signal),
    ImposedFlow.of(key, signal),
    seriesOf(`/runs/${key}`, signal),
  ]);
  loading.remove();
  const plot = new Plot(plots, signal);
  const drawn = plot.draw(() => histories(series, run.scene, units));
  if (frames.states.length === 0) {
    stage.append(element("p", { class: "alert" }, "This run has no recorded state that can be drawn."));
    return drawn;
  }
  const player = new Player(frames, flow && flow.during(series, run.scene.flow.rate), run.scene, units, signal);
  stage.append(player.element);
  player.canvas.setAttribute("aria-label", `${describe(run.scene)}: membranes colored by tension`);
  keepTime(player, query);
  await link(player, plot, drawn, units.size("time").value);
}

/**
 * Let the line in the plots follow the player, and a click in the plots set the time of the player.
 *
 * @param {Player} player
 * @param {Plot} plot
 * @param {Promise<void>} drawn - Resolved when the plots are drawn.
 * @param {number} one - What the axis of time says for a time of one.
 */
async function link(player, plot, drawn, one) {
  const cursor = new Cursor(plot.place, MARGIN);
  plot.place.after(cursor.line);
  plot.on("plotly_click", ({ points: [point] }) => player.rest(point.x / one));
  plot.on("plotly_afterplot", () => cursor.show(player.time * one)); // after zooming, resizing or changing colors
  await drawn;
  player.onTime((time) => cursor.show(time * one));
}

/**
 * Keep the time at which the player stops in the address.
 *
 * @param {Player} player
 * @param {URLSearchParams} query
 */
function keepTime(player, query) {
  if (query.has("time")) {
    player.seek(Number(query.get("time")) || 0);
  }
  player.onRest((time) => keepInAddress("time", time.toFixed(2)));
}

/**
 * @param {any} run
 * @param {Units} units
 */
function heading({ key, outcome, time, scene, failure }, units) {
  const verb = ["completed", "undecided", "failed"].includes(outcome) ? "ended" : "decided";
  return element(
    "div",
    { class: "heading" },
    element("h1", {}, outcomeLabel(outcome)),
    element("a", { class: "button", href: `#/new?run=${key}` }, "Run again with changes"),
    element("p", {}, `${describe(scene, [], units)}; ${verb} at t = ${units.both("time", time)}`),
    downloads(`/runs/${key}/file`, `run-${key.slice(0, 8)}`, [
      ["gif", "movie"],
      ["svg", "figure"],
      ["h5", "HDF5"],
      ["vtkhdf", "ParaView"],
    ]),
    failure ? element("p", { class: "alert" }, failure) : null,
  );
}

/**
 * @param {any} run
 * @param {Units} units
 */
function results({ configuration, period, gap, inclination_angle, viscosity, energy, arrangement, error, work }, units) {
  /** @type {(value: any, error: any, name?: string) => string | null} */
  const withError = (value, error, name = "") => {
    if (value === null || value === undefined) return null;
    const hasError = error !== null && error !== undefined;
    // With a unit the error takes the same factor as the value.
    const write = (/** @type {number} */ shown) =>
      hasError ? `${number(shown)} ± ${number(value ? (error * shown) / value : error, 1)}` : number(shown);
    return units.both(name, value, write);
  };
  const orNull = (/** @type {any} */ value, name = "") => withError(value, null, name);
  return element(
    "section",
    { class: "results" },
    element("h2", {}, "Results"),
    definitions([
      ["Configuration", configuration ?? null],
      ["Period", withError(period, error.period, "period")],
      ["Slides open by a factor", orNull(arrangement?.opening)],
      ["Own turns in a turn", arrangement?.own_turns?.map((/** @type {number} */ own) => number(own)).join(", ") ?? null],
      ["Bow of the contact", orNull(arrangement?.bow)],
      ["Twist of the contact", orNull(arrangement?.twist)],
      ["Gap", orNull(gap, "gap")],
      ["Inclination", inclination_angle === null ? null : `${withError(inclination_angle, error.inclination_angle)}°`],
      ["Viscosity [μ]", withError(viscosity?.total, error.viscosity)],
      ["– bending + tension", orNull(viscosity?.bending_tension)],
      ["– adhesion", orNull(viscosity?.adhesion)],
      ["– viscosity contrast", orNull(viscosity?.contrast)],
      ["Bending energy", orNull(energy.bending, "bending_energy")],
      ["Adhesion energy", orNull(energy.adhesion, "adhesion_energy")],
      ["Binding energy", orNull(energy.binding, "adhesion_energy")],
      ["Position error", orNull(error.global, "x")],
      ["Area error", number(error.area, 2)],
      ["Closure error", number(error.closure, 2)],
      ["Local errors, summed", number(error.temporal, 2)],
      ["Spatial error", number(error.spatial, 2)],
      ["Steps", `${work.steps} (${work.rejected_steps} rejected)`],
      ["Computed in", duration(work.wall_seconds)],
    ]),
  );
}

/** @param {any} run */
function sceneOf({ key, created, versions, scene }) {
  return element(
    "details",
    { class: "scene" },
    element("summary", {}, "Scene and provenance"),
    definitions([
      ["Key", element("code", {}, key)],
      ["Made", dateAndTime(created)],
      [
        "With",
        Object.entries(versions)
          .map(([name, version]) => `${name} ${version}`)
          .join(", "),
      ],
    ]),
    element("pre", { tabindex: 0 }, JSON.stringify(scene, null, 2)),
  );
}
