// Ended jobs are archived, deleted and restored, one or many, and that can be undone.

import { send } from "./api.js";
import { h } from "./dom.js";
import { ago, several } from "./figures.js";
import { ENDED } from "./job_summary.js";
import { complain, messageOf, offerUndo, say } from "./notices.js";
import { maySteer } from "./permissions.js";

/** @typedef {"archive" | "delete" | "restore"} Filing */

/** @type {Record<Filing, { label: string, done: string }>} */
const WORDS = {
  archive: { label: "Archive", done: "archived" },
  delete: { label: "Delete", done: "deleted" },
  restore: { label: "Restore", done: "restored" },
};
/** How many requests are made at once. */
const AT_ONCE = 4;

/**
 * What can be done with a job: nothing until it has ended.
 * @param {Api.JobView} job
 * @returns {Filing[]}
 */
export function filings(job) {
  if (!ENDED.has(job.state) || !maySteer(job)) return [];
  if (job.deleted_at) return ["restore"];
  return job.archived_at ? ["restore", "delete"] : ["archive", "delete"];
}

/**
 * Since when a job is archived or deleted, in words; "" if it is listed.
 * @param {Api.JobView} job
 */
export function filedSince({ archived_at: archived, deleted_at: deleted }) {
  if (deleted) return `deleted ${ago(deleted)}`;
  return archived ? `archived ${ago(archived)}` : "";
}

/**
 * A button for each of these filings.
 * @param {Filing[]} possible
 * @param {(what: Filing) => unknown} act
 */
export function filingButtons(possible, act) {
  return possible.map((what) =>
    h("button", { class: what === "delete" ? "danger" : "", onclick: () => act(what) }, WORDS[what].label));
}

/**
 * Files jobs, and offers to undo that.
 * @param {Api.JobView[]} jobs
 * @param {Filing} what
 * @param {(ids: string[]) => unknown} after - called with the ids of the filed jobs
 */
export async function file(jobs, what, after) {
  const done = await each(jobs, (job) => request(job, what));
  if (done.length) {
    offerUndo(said(done, WORDS[what].done), async () => {
      const undone = await each(done, (job) => request(job, before(job)));
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
 * @param {Filing} what
 */
function request({ links }, what) {
  return what === "delete" ? send("DELETE", links.self) : send("POST", links[what]);
}

/**
 * Puts the jobs of a batch back to where they were.
 * @param {Api.SteeredJob[]} filed
 */
export async function putBack(filed) {
  const back = { listed: "restore", archived: "archive", deleted: "delete" };
  await fewAtOnce(filed, async ({ job, before }) => {
    const self = `/v1/jobs/${job}`;
    const links = { self, archive: `${self}/archive`, restore: `${self}/restore` };
    if (before) await request({ links }, /** @type {Filing} */ (back[before]));
  });
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
 * The filing that puts a job where it was.
 * @param {Api.JobView} job
 * @returns {Filing}
 */
function before(job) {
  return job.deleted_at ? "delete" : job.archived_at ? "archive" : "restore";
}

/**
 * @param {Api.JobView[]} jobs
 * @param {string} done
 */
function said(jobs, done) {
  return jobs.length === 1 ? `${jobs[0].name} is ${done}` : `${several(jobs.length, "job")} are ${done}`;
}
