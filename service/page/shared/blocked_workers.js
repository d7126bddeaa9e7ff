// Workers and machines that must not render a job: blocked, and let render it again.

import { send } from "./api.js";
import { confirmed } from "./dialogs.js";
import { attempt } from "./notices.js";

/**
 * Blocks a worker for a job once the user confirms it.
 * @param {Api.JobView} job
 * @param {string} worker - its id, or the host of its machine
 * @param {() => unknown} refresh
 */
export async function block(job, worker, refresh) {
  if (await confirmed(`Block ${worker} for ${job.name}?`,
    "It finishes the slice that it has and renders no other of this job. Other workers do, and it serves other jobs.", "Block it", "Let it render")) {
    await attempt(() => send("PUT", pathOf(job, worker)), `${worker} is blocked for ${job.name}`, refresh);
  }
}

/**
 * @param {Api.JobView} job
 * @param {string} worker
 * @param {() => unknown} refresh
 */
export function unblock(job, worker, refresh) {
  return attempt(() => send("DELETE", pathOf(job, worker)), `${worker} may render ${job.name} again`, refresh);
}

/**
 * @param {Api.JobView} job
 * @param {string} worker
 */
function pathOf(job, worker) {
  return `${job.links.self}/blocked/${encodeURIComponent(worker)}`;
}
