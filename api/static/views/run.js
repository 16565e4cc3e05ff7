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
  document.title = `Run ${key.slice(0, 8)}: ${run.outcome} – Vesicle ensemble`;
  const stage = element("div", { class: "stage" });
  const plots = element("div", { class: "plot" });
  content.replaceChildren(
    heading(run),
    element(
      "div",
      { class: "columns run" },
      stage,
      element("div", { class: "histories" }, plots),
      results(run),
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
  const drawn = plot.draw(() => histories(series, run.scene));
  if (frames.states.length === 0) {
    stage.append(element("p", { class: "alert" }, "This run has no recorded state that can be drawn."));
    return drawn;
  }
  const player = new Player(frames, flow, run.scene, signal);
  stage.append(player.element);
  player.canvas.setAttribute("aria-label", `${describe(run.scene)}: membranes colored by tension`);
  keepTime(player, query);
  await link(player, plot, drawn);
}

/**
 * Let the line in the plots follow the player, and a click in the plots set the time of the player.
 *
 * @param {Player} player
 * @param {Plot} plot
 * @param {Promise<void>} drawn - Resolved when the plots are drawn.
 */
async function link(player, plot, drawn) {
  const cursor = new Cursor(plot.place, MARGIN);
  plot.place.after(cursor.line);
  plot.on("plotly_click", ({ points: [point] }) => player.rest(point.x));
  plot.on("plotly_afterplot", () => cursor.show(player.time)); // after zooming, resizing or changing colors
  await drawn;
  player.onTime((time) => cursor.show(time));
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

/** @param {any} run */
function heading({ key, outcome, time, scene, failure }) {
  const verb = ["completed", "undecided", "failed"].includes(outcome) ? "ended" : "decided";
  return element(
    "div",
    { class: "heading" },
    element("h1", {}, outcomeLabel(outcome)),
    element("a", { class: "button", href: `#/new?run=${key}` }, "Run again with changes"),
    element("p", {}, `${describe(scene)}; ${verb} at t = ${number(time)}`),
    downloads(`/runs/${key}/file`, `run-${key.slice(0, 8)}`, [
      ["gif", "movie"],
      ["svg", "figure"],
      ["h5", "HDF5"],
      ["vtkhdf", "ParaView"],
    ]),
    failure ? element("p", { class: "alert" }, failure) : null,
  );
}

/** @param {any} run */
function results({ configuration, period, gap, inclination_angle, viscosity, energy, arrangement, error, work }) {
  /** @type {(value: any, error: any) => string | null} */
  const withError = (value, error) => {
    if (value === null || value === undefined) return null;
    return error === null || error === undefined ? number(value) : `${number(value)} ± ${number(error, 1)}`;
  };
  const orNull = (/** @type {any} */ value) => (value === null || value === undefined ? null : number(value));
  return element(
    "section",
    { class: "results" },
    element("h2", {}, "Results"),
    definitions([
      ["Configuration", configuration ?? null],
      ["Period", withError(period, error.period)],
      ["Slides open by a factor", orNull(arrangement?.opening)],
      ["Own turns in a turn", arrangement?.own_turns?.map((/** @type {number} */ own) => number(own)).join(", ") ?? null],
      ["Bow of the contact", orNull(arrangement?.bow)],
      ["Twist of the contact", orNull(arrangement?.twist)],
      ["Gap", orNull(gap)],
      ["Inclination", inclination_angle === null ? null : `${withError(inclination_angle, error.inclination_angle)}°`],
      ["Viscosity [μ]", withError(viscosity?.total, error.viscosity)],
      ["– bending + tension", orNull(viscosity?.bending_tension)],
      ["– adhesion", orNull(viscosity?.adhesion)],
      ["– viscosity contrast", orNull(viscosity?.contrast)],
      ["Bending energy", orNull(energy.bending)],
      ["Adhesion energy", orNull(energy.adhesion)],
      ["Binding energy", orNull(energy.binding)],
      ["Position error", orNull(error.global)],
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
