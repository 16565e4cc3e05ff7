/** Starts the page: the routes, the colors, and nothing else. */

import { startRouter } from "./router.js";
import { loadFlows } from "./symbols.js";
import { startTheme } from "./theme.js";
import { showBoundaries } from "./views/boundaries.js";
import { showJob } from "./views/job.js";
import { showJobs } from "./views/jobs.js";
import { showRun } from "./views/run.js";
import { showRuns } from "./views/runs.js";
import { showSubmission } from "./views/submission.js";

/**
 * A view that names the parameters of scenes.
 *
 * @param {(place: import("./router.js").Place) => Promise<void>} show
 */
const naming = (show) => async (/** @type {import("./router.js").Place} */ place) => {
  await loadFlows(place.signal);
  await show(place);
};

startTheme();
startRouter([
  { path: /^\/(?:boundaries)?$/, section: "boundaries", show: naming(showBoundaries) },
  { path: /^\/boundaries\/(?<key>[0-9a-f]{16})$/, section: "boundaries", show: naming(showBoundaries) },
  { path: /^\/runs$/, section: "runs", show: naming(showRuns) },
  { path: /^\/runs\/(?<key>[0-9a-f]{32})$/, section: "runs", show: naming(showRun) },
  { path: /^\/jobs$/, section: "jobs", show: showJobs },
  { path: /^\/jobs\/(?<id>[0-9a-z-]+)$/, section: "jobs", show: showJob },
  { path: /^\/new$/, section: "new", show: naming(showSubmission) },
]);
