// Values derived from a job's JSON: its rules, duration and savings.

import { ago, duration } from "./figures.js";
import { ruleNamed, valueIn } from "./rules.js";

/** @import { Rule } from "./rules.js" */

/** @type {Set<Api.JobState>} */
export const ENDED = new Set(["converged", "exhausted", "cancelled", "failed"]);

/**
 * A state in words.
 * @param {Api.JobState} state
 * @param {number} [count] - of jobs
 */
export function inWords(state, count = 1) {
  return state === "exhausted" ? `reached ${count === 1 ? "its" : "their"} limit` : state;
}

/**
 * What a job was asked for, in a few words each: what tells it from others of its scene.
 * @param {Api.JobView} job
 * @param {{ withParameters: boolean }} options
 */
export function asked({ spec, width, height }, { withParameters }) {
  // The size of the image is said already.
  const given = Object.entries(spec.parameters).filter(([name, value]) =>
    !(name === "width" && Number(value) === width) && !(name === "height" && Number(value) === height));
  return [
    width && `${width} × ${height}`,
    ...(withParameters ? given.map(([name, value]) => `${name} ${value}`) : []),
    spec.sensor && `sensor ${spec.sensor}`,
    !ruleNamed(spec.rule.name)?.default && `rule ${spec.rule.name}`,
    spec.allocation.name === "zones" && "by zones",
    spec.denoise.name !== "none" && "denoised",
  ].filter(Boolean);
}

/** The parameter of the form's address that names the job whose spec it has. */
export const AGAIN = "again";

/** The parameter of a job's address that names the job with which it is compared. */
export const WITH = "with";

/**
 * The address at which two jobs are compared; null if their images differ in size, or one has none.
 * @param {Api.JobView} job
 * @param {Api.JobView} other
 */
export function comparisonOf(job, other) {
  const isAlike = job.width === other.width && job.height === other.height && job.image_spp && other.image_spp;
  return isAlike ? `/jobs/${job.id}?${WITH}=${other.id}` : null;
}

/**
 * The number of pixels of the image; 0 before its size is known.
 * @param {Api.JobView} job
 */
export function imagePixels(job) {
  return (job.width ?? 0) * (job.height ?? 0);
}

/**
 * The slope at which a rule stops, in changed pixels per spp of this job's image; null if it has none.
 * @param {Api.JobView} job
 * @param {Rule} rule
 */
export function stopSlope(job, rule) {
  const slope = valueIn("slope", rule);
  return slope == null || !imagePixels(job) ? null : (slope * imagePixels(job)) / (512 * 512);
}

/**
 * The job's first rule with a parameter in this role; undefined if none has one.
 * @param {Api.ParameterRole} role
 * @param {Api.JobView} job
 */
export function ruleWith(role, job) {
  return rulesOf(job).find((rule) => valueIn(role, rule) != null);
}

/**
 * The side of the zones by which the job's samples are allocated, in pixels; null if they are not.
 * @param {Api.JobView} job
 */
export function zoneSize({ spec: { allocation } }) {
  return allocation.name === "zones" ? allocation.size : null;
}

/**
 * The rules of the job; the first is the one that ends it.
 * @param {Api.JobView} job
 */
export function rulesOf(job) {
  return [job.spec.rule, ...job.spec.watch];
}

/**
 * Whether a rule of the job goes by the quality by ColorVideoVDP.
 * @param {Api.JobView} job
 */
export function isByQuality(job) {
  return rulesOf(job).some(({ name }) => ruleNamed(name)?.by_quality);
}

/**
 * Seconds from a job's submission to its end, or until now: waits and pauses count.
 * @param {Api.JobView} job
 */
export function durationSeconds(job) {
  return Math.max(0, ((job.ended_at ? Date.parse(job.ended_at) : Date.now()) - Date.parse(job.created_at)) / 1000);
}

/**
 * How long an ended job took, in words.
 * @param {Api.JobView} job
 */
export function took(job) {
  return `took ${duration(durationSeconds(job))}`;
}

/**
 * Since when a job is deleted, in words; "" if it is not.
 * @param {Api.JobView} job
 */
export function deletedSince({ deleted_at: at }) {
  return at ? `deleted ${ago(at)}` : "";
}

/**
 * The beginning of a job's id, which every command takes for the whole.
 * @param {Api.JobView} job
 */
export function shortId({ id }) {
  return id.slice(0, 8);
}

/**
 * What a job saved: samples, and an estimate of their machine time.
 * @param {Api.JobView} job
 */
export function savings(job) {
  if (!job.samples_saved) return null;
  const seconds = job.core_hours ? (job.machine_s * job.saved_core_hours) / job.core_hours : 0;
  return { fraction: job.saved_fraction, samples: job.samples_saved, machine: seconds ? duration(seconds) : "" };
}
