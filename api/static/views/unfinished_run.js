/** A run that is not done: how far it is, and its diagnostics so far. */

import { get } from "../api.js";
import { definitions, element } from "../dom.js";
import { dateAndTime, duration } from "../format.js";
import { histories } from "../history.js";
import { Plot } from "../plot.js";
import { Problem } from "../problems.js";
import { seriesOf } from "../series.js";
import { describe } from "../symbols.js";
import { Units } from "../units.js";

const GONE = [404, 409]; // the record of a run that is being finished cannot be read
const SECONDS_BETWEEN_LOOKS = 5; // checkpoints come once a minute or so

/**
 * Show a run until it is no longer among the unfinished ones.
 *
 * @param {import("../router.js").Place} place
 * @returns {Promise<boolean>} Whether there was one.
 */
export async function watchRun({ content, parameters, signal }) {
  const address = `/unfinished-runs/${parameters.key}`;
  const [head, plots] = [element("div", {}), element("div", { class: "plot" })];
  const plot = new Plot(plots, signal);
  let [written, units] = [null, new Units()];
  for (;;) {
    const run = await unlessMissing(get(address, signal));
    if (run === null) {
      return written !== null;
    }
    if (run.written !== written) {
      units = written === null ? ((await unlessMissing(Units.of(address, run.scene, signal))) ?? units) : units;
      const series = run.samples > 0 ? await unlessMissing(seriesOf(address, signal)) : null;
      head.replaceChildren(...heading(run, units));
      if (written === null) {
        document.title = `Run ${parameters.key.slice(0, 8)} – Vesicle ensemble`;
        content.replaceChildren(head, element("div", { class: "histories" }, plots));
      }
      if (series) {
        await plot.draw(() => histories(series, run.scene, units));
      }
      written = run.written;
    }
    await pause(signal);
  }
}

/**
 * @param {any} run
 * @param {Units} units
 */
function heading({ status, written, time, horizon, wall_seconds: seconds, samples, frames, scene }, units) {
  return [
    element(
      "div",
      { class: "heading" },
      element("h1", {}, status === "in progress" ? "In progress" : "Interrupted"),
      element("p", {}, describe(scene, [], units)),
    ),
    element(
      "div",
      { class: "progress", role: "status" },
      element("progress", { max: horizon, value: time ?? 0, "aria-label": "Time reached" }),
      element(
        "span",
        {},
        time === null ? "the start relaxes" : `t = ${units.both("time", time)} of ${units.both("time", horizon)} at the latest`,
      ),
    ),
    definitions([
      ["As of", dateAndTime(written)],
      ["Computed in", duration(seconds)],
      ["Recorded", `${samples} diagnostics, ${frames} states`],
    ]),
  ];
}

/**
 * @param {Promise<any>} answer
 * @returns {Promise<any>} Null if there is no such thing, or no longer.
 */
async function unlessMissing(answer) {
  try {
    return await answer;
  } catch (problem) {
    if (problem instanceof Problem && GONE.includes(problem.status)) {
      return null;
    }
    throw problem;
  }
}

/** @param {AbortSignal} signal */
function pause(signal) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(resolve, 1000 * SECONDS_BETWEEN_LOOKS);
    signal.addEventListener("abort", () => (clearTimeout(timer), reject(signal.reason)), { once: true });
  });
}
