// The orders of the list.

import { durationSeconds } from "../shared/job_summary.js";

/** @typedef {(a: Api.JobView, b: Api.JobView) => number} Order */

/**
 * The orders by their name in the address, with their words; of equals, the newest comes first.
 * @type {Map<string, { words: string, order: Order }>}
 */
export const ORDERS = new Map([
  ["oldest", { words: "oldest first", order: (a, b) => Date.parse(a.created_at) - Date.parse(b.created_at) }],
  ["name", { words: "by name", order: (a, b) => a.name.localeCompare(b.name, undefined, { numeric: true }) }],
  ["priority", { words: "highest priority first", order: falling((job) => job.spec.priority) }],
  ["noise", { words: "most noise left first", order: falling((job) => job.estimate_fraction ?? -1) }],
  ["spp", { words: "most spp first", order: falling((job) => job.spp) }],
  ["time", { words: "longest time first", order: falling(durationSeconds) }],
]);

/**
 * @param {(job: Api.JobView) => number} value
 * @returns {Order}
 */
function falling(value) {
  return (a, b) => value(b) - value(a);
}
