/** Starts the page: the routes, the colors, and nothing else. */

import { loadKinds } from "./kinds.js";
import { startRouter } from "./router.js";
import { loadFlows } from "./symbols.js";
import { startTheme } from "./theme.js";
import { showBoundaries } from "./views/boundaries.js";
import { showJob } from "./views/job.js";
import { showJobs } from "./views/jobs.js";
import { showMaps } from "./views/maps.js";
import { showReport, showReports } from "./views/reports.js";
import { showRun } from "./views/run.js";
import { showRuns } from "./views/runs.js";
import { showSubmission } from "./views/submission.js";

/**
 * A view that needs what some functions load.
 *
 * @param {(place: import("./router.js").Place) => Promise<void>} show
 * @param {((signal: AbortSignal) => Promise<void>)[]} loading
 */
const after = (show, ...loading) => async (/** @type {import("./router.js").Place} */ place) => {
  await Promise.all(loading.map((load) => load(place.signal)));
  await show(place);
};

startTheme();
startRouter([
  { path: /^\/(?:boundaries)?$/, section: "boundaries", show: after(showBoundaries, loadFlows) },
  { path: /^\/boundaries\/(?<key>[0-9a-f]{16})$/, section: "boundaries", show: after(showBoundaries, loadFlows) },
  { path: /^\/maps(?:\/(?<key>[0-9a-f]{16}))?$/, section: "maps", show: after(showMaps, loadFlows) },
  { path: /^\/runs$/, section: "runs", show: after(showRuns, loadFlows) },
  { path: /^\/runs\/(?<key>[0-9a-f]{32})$/, section: "runs", show: after(showRun, loadFlows) },
  { path: /^\/jobs$/, section: "jobs", show: after(showJobs, loadKinds) },
  { path: /^\/jobs\/(?<id>[0-9a-z-]+)$/, section: "jobs", show: after(showJob, loadFlows, loadKinds) },
  { path: /^\/reports$/, section: "reports", show: showReports },
  { path: /^\/reports\/(?<name>work-precision|stability|scaling|paper)$/, section: "reports", show: showReport },
  { path: /^\/new$/, section: "new", show: after(showSubmission, loadFlows, loadKinds) },
]);
