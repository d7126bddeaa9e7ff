// Ended jobs are deleted and restored, one or many, and that can be undone.

import { send } from "./api.js";
import { h } from "./dom.js";
import { ago, several } from "./figures.js";
import { ENDED } from "./job_summary.js";
import { complain, messageOf, offerUndo, say } from "./notices.js";
import { maySteer } from "./permissions.js";

/** @typedef {"delete" | "restore"} Deletion */

const WORDS = {
  delete: { label: "Delete", done: "deleted" },
  restore: { label: "Restore", done: "restored" },
};
/** How many requests are made at once. */
const AT_ONCE = 4;

/**
 * What can be done with a job: nothing until it has ended.
 * @param {Api.JobView} job
 * @returns {Deletion[]}
 */
export function deletions(job) {
  if (!ENDED.has(job.state) || !maySteer(job)) return [];
  return job.deleted_at ? ["restore"] : ["delete"];
}

/**
 * Since when a job is deleted, in words; "" if it is not.
 * @param {Api.JobView} job
 */
export function deletedSince({ deleted_at: at }) {
  return at ? `deleted ${ago(at)}` : "";
}

/**
 * A button for each of these.
 * @param {Deletion[]} possible
 * @param {(what: Deletion) => unknown} act
 */
export function deletionButtons(possible, act) {
  return possible.map((what) =>
    h("button", { class: what === "delete" ? "danger" : "", onclick: () => act(what) }, WORDS[what].label));
}

/**
 * Deletes or restores jobs, and offers to undo that.
 * @param {Api.JobView[]} jobs
 * @param {Deletion} what
 * @param {(ids: string[]) => unknown} after - called with the ids of the changed jobs
 */
export async function deleteOrRestore(jobs, what, after) {
  const done = await each(jobs, (job) => request(job, what));
  if (done.length) {
    offerUndo(said(done, WORDS[what].done), async () => {
      const undone = await each(done, (job) => request(job, what === "delete" ? "restore" : "delete"));
      say(said(undone, "put back"));
      await after([]);
    });
  }
  await after(done.map(({ id }) => id));
}

/**
 * Sends a request for each of the jobs; resolves to those for which it was done, and shows why others
 * were refused.
 * @param {Api.JobView[]} jobs
 * @param {(job: Api.JobView) => Promise<unknown>} request
 */
export async function each(jobs, request) {
  /** @type {Set<Api.JobView>} */
  const done = new Set();
  /** @type {string[]} */
  const refused = [];
  await fewAtOnce(jobs, (job) => request(job).then(() => done.add(job), (error) => refused.push(`${job.name}: ${messageOf(error)}`)));
  complain(refused.length ? `Refused for ${refused.length} of ${several(jobs.length, "job")}. ${refused[0]}` : "", true);
  return jobs.filter((job) => done.has(job));
}

/**
 * @param {{ links: Record<string, string> }} job
 * @param {Deletion} what
 */
function request({ links }, what) {
  return what === "delete" ? send("DELETE", links.self) : send("POST", links.restore);
}

/**
 * Restores jobs.
 * @param {string[]} ids
 */
export async function restore(ids) {
  await fewAtOnce(ids, (id) => send("POST", `/v1/jobs/${id}/restore`));
}

/**
 * Does something for each of these, a few at a time.
 * @template One
 * @param {One[]} all
 * @param {(one: One) => Promise<unknown>} act
 */
async function fewAtOnce(all, act) {
  const queue = all.values();
  await Promise.all(Array.from({ length: AT_ONCE }, async () => {
    for (const one of queue) await act(one);
  }));
}

/**
 * @param {Api.JobView[]} jobs
 * @param {string} done
 */
function said(jobs, done) {
  return jobs.length === 1 ? `${jobs[0].name} is ${done}` : `${several(jobs.length, "job")} are ${done}`;
}
