// A probe: ten seconds of a scene as an ordinary small job, judged by several rules, and deleted afterwards.

import { get, send, upload } from "../shared/api.js";
import { OneJob } from "../shared/job_request.js";
import { ENDED } from "../shared/job_summary.js";
import { complain } from "../shared/notices.js";
import { sleep } from "../shared/polling.js";

/** @typedef {{ name: string } & Record<string, string | number>} AskedRule */
/**
 * Where a rule is likely to end the job: spp, and seconds at the probe's pace; null if the probe does not tell.
 * @typedef {{ spp: number, seconds: number } | null} Expected
 */

export const PROBE_S = 10;
/** What a probe's spec has in place of the form's: short slices, so that there is a curve. */
const SPEC = {
  time_limit_s: PROBE_S, time_limit_from: "first_slice", slice_spp: 4, step: 16, max_spp: 1600, min_spp: null,
  keep_slices: true, watch: [], batch: null, notice: {}, aovs: [],
};
/** How long it may wait for a worker and render, and how often it is looked at. */
const PATIENCE_MS = 120_000;
const LOOK_MS = 300;

/**
 * Renders a scene for ten seconds, and resolves to where each of the rules would end it.
 * @param {(spec: object) => FormData} form - the form that submits the scene with a spec
 * @param {object} spec - of the job that is meant
 * @param {AskedRule[]} rules - the last one is the strictest
 * @param {AbortSignal} signal
 * @returns {Promise<Expected[]>}
 */
export async function probe(form, spec, rules, signal) {
  /** @type {Api.JobView[]} */
  const jobs = [];
  const patience = AbortSignal.any([signal, AbortSignal.timeout(PATIENCE_MS)]);
  try {
    const [strictest, ...others] = rules.toReversed();
    const asked = form({ ...spec, ...SPEC, name: "Probe", rule: strictest });
    // The answer is waited for in any case, so that no probe is left behind.
    const { signal: never } = new AbortController();
    const first = await new OneJob().make((headers) => upload("/v1/jobs", asked, { signal: never, headers }));
    jobs.push(first);
    const done = await ended(first, patience);
    if (done.state === "failed") throw new Error(done.reason ?? "the probe has failed");
    if (!done.spp) throw new Error(`The probe rendered nothing in ${PROBE_S} s.`);
    for (const rule of others) jobs.push(await send("POST", first.links.again, { rule, max_spp: done.committed_spp }));
    const pace = secondsForEach(done, await curveOf(done, patience));
    const found = await Promise.all(jobs.map(async (job) => {
      const judged = await ended(job, patience);
      const spp = judged.state === "converged" ? judged.spp : (await curveOf(judged, patience)).at(-1)?.expected_spp;
      return spp == null ? null : { spp, seconds: spp * pace };
    }));
    return found.toReversed();
  } catch (error) {
    if (patience.aborted && !signal.aborted) throw new Error(`No worker has finished the probe within ${PATIENCE_MS / 1000} s.`);
    throw error;
  } finally {
    // Newest first: those that judge again have its slices.
    for (const { links } of jobs.reverse()) await removed(links).catch(complain);
  }
}

/**
 * Cancels a job unless it has ended, and deletes it.
 * @param {Api.JobView["links"]} links
 */
async function removed(links) {
  const { state } = await get(links.self);
  if (!ENDED.has(state)) await send("POST", links.cancel);
  await send("DELETE", links.self);
}

/**
 * The job, once its results are written.
 * @param {Api.JobView} job
 * @param {AbortSignal} signal
 * @returns {Promise<Api.JobView>}
 */
async function ended({ links }, signal) {
  for (;;) {
    const job = await get(links.self, signal);
    if (job.finished_at) return job;
    await sleep(LOOK_MS, signal);
  }
}

/**
 * @param {Api.JobView} job
 * @param {AbortSignal} signal
 * @returns {Promise<Api.CurvePoint[]>}
 */
async function curveOf({ links }, signal) {
  return (await get(links.curve, signal)).points;
}

/**
 * The seconds that a sample of each pixel takes: between points, without the time to load the scene.
 * @param {Api.JobView} job
 * @param {Api.CurvePoint[]} points
 */
function secondsForEach(job, points) {
  const [first, last] = [points[0], points[points.length - 1]];
  const at = (/** @type {string | null} */ time) => Date.parse(time ?? "") / 1000;
  if (first && last.spp > first.spp) return (at(last.at) - at(first.at)) / (last.spp - first.spp);
  return (at(job.ended_at) - at(job.started_at)) / job.spp;
}
