// What follows from a job's JSON: its title, its rules, how long it took, what it saved.

import { duration, roughly } from "./figures.js";
import { valueIn } from "./rules.js";

/** @import { Rule } from "./rules.js" */

/** @type {Set<Api.JobState>} */
export const ENDED = new Set(["converged", "exhausted", "cancelled", "failed"]);

/**
 * A scene's name without what every name ends with.
 * @param {Api.JobView} job
 */
export function title(job) {
  return job.name.replace(/\.(zip|xml)$/i, "") || job.name;
}

/**
 * How many pixels its image has; 0 before its size is known.
 * @param {Api.JobView} job
 */
export function imagePixels(job) {
  return (job.width ?? 0) * (job.height ?? 0);
}

/**
 * The slope of the curve at which a rule stops, in changed pixels per spp of this job's image; null where it has none.
 * @param {Api.JobView} job
 * @param {Rule} rule
 */
export function stopSlope(job, rule) {
  const slope = valueIn("slope", rule);
  return slope == null || !imagePixels(job) ? null : (slope * imagePixels(job)) / (512 * 512);
}

/**
 * The first rule of the job that has a value in this role; undefined where none has.
 * @param {Api.ParameterRole} role
 * @param {Api.JobView} job
 */
export function ruleWith(role, job) {
  return rulesOf(job).find((rule) => valueIn(role, rule) != null);
}

/**
 * The noise left, as a share of the pixels, at which the job ends; null where its rule looks at something else.
 * @param {Api.JobView} job
 */
export function noiseTarget(job) {
  return valueIn("noise_target", job.spec.rule);
}

/**
 * Every rule of the job: the one that ends it first.
 * @param {Api.JobView} job
 */
export function rulesOf(job) {
  return [job.spec.rule, ...job.spec.watch];
}

/**
 * Seconds from a job's submission to its end, or until now: waits and pauses count.
 * @param {Api.JobView} job
 */
export function durationSeconds(job) {
  return Math.max(0, ((job.ended_at ? Date.parse(job.ended_at) : Date.now()) - Date.parse(job.created_at)) / 1000);
}

/**
 * What is left of a job's time, in words; "" where nobody can know.
 * @param {Api.JobView} job
 */
export function timeLeft(job) {
  if (job.state !== "rendering") return "";
  const { forecast_spp: forecast, committed_spp: committed } = job;
  if (noiseTarget(job) != null && job.forecast_s != null && forecast != null && forecast <= job.spec.max_spp) {
    // The forecast is of the last point, and slices have come since.
    const ahead = Math.max(0, forecast - committed) / Math.max(1, forecast - job.spp);
    const seconds = ahead * job.forecast_s;
    return seconds < 3 ? "any moment" : `about ${roughly(seconds)} left`;
  }
  const rendered = committed - job.continued_spp;
  const rendering = (Date.now() - Date.parse(job.started_at ?? "")) / 1000 - job.paused_s;
  if (!(rendered > 0 && rendering > 0)) return "";
  return `at most ${roughly((Math.max(0, job.spec.max_spp - committed) * rendering) / rendered)} left`;
}

/**
 * How long an ended job took, in words.
 * @param {Api.JobView} job
 */
export function took(job) {
  return `took ${duration(durationSeconds(job))}`;
}

/**
 * What a job would have cost otherwise: samples, and about how long machines would have worked on them.
 * @param {Api.JobView} job
 */
export function savings(job) {
  if (!job.samples_saved) return null;
  const rendered = (job.committed_spp - job.continued_spp) * imagePixels(job);
  const seconds = rendered > 0 ? (job.machine_s * job.samples_saved) / rendered : 0;
  return { fraction: job.samples_saved / (job.spec.max_spp * imagePixels(job)), samples: job.samples_saved, machine: seconds ? duration(seconds) : "" };
}
