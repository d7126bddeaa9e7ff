// Which of the jobs are listed, by a search, and in which order.

import { durationSeconds, title } from "../shared/job_summary.js";

/** @typedef {(a: Api.JobView, b: Api.JobView) => number} Order */

/**
 * The orders by their name in the address, with their words; of equals, the newest comes first.
 * @type {Map<string, { words: string, order: Order }>}
 */
export const ORDERS = new Map([
  ["oldest", { words: "oldest first", order: (a, b) => Date.parse(a.created_at) - Date.parse(b.created_at) }],
  ["name", { words: "by name", order: (a, b) => title(a).localeCompare(title(b), undefined, { numeric: true }) }],
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

/**
 * The jobs in which every word of the search occurs: in the name, the id, the scene, the batch, the
 * owner or the tags that a worker must have.
 * @template {Api.JobView} Job
 * @param {Job[]} jobs
 * @param {string} search
 */
export function found(jobs, search) {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  return jobs.filter((job) => {
    const { id, name, owner_name: owner, spec } = job;
    const text = [title(job), id, name, spec.batch, owner, ...spec.requires].join("\n").toLowerCase();
    return words.every((word) => text.includes(word));
  });
}
