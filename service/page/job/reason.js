// Why a job is in its state, in words for somebody who has not read the papers.

import { percent, pixels, sentence, three, whole } from "../shared/figures.js";
import { stopSlope } from "../shared/job_summary.js";

/** A sentence or two: what happened, and what it means. */
export function reasonInWords(job) {
  const { state, spec } = job;
  if (state === "converged") return converged(job);
  if (state === "exhausted") return `${sentence(job.reason)} ${leftToSee(job)}`.trim();
  if (state === "cancelled") {
    const kept = job.spp ? ` Its image stays as it was, at ${whole(job.spp)} spp.` : "";
    return `${sentence(job.reason)}${kept}`;
  }
  if (state === "failed") return sentence(job.reason);
  if (state === "paused") return `${sentence(job.reason)} Workers render no more of it until it is resumed.`;
  if (job.waits_for) return `It ${job.waits_for}. ${leftToSee(job)}`.trim();
  if (state === "queued") return "It waits for a worker.";
  if (!job.points) {
    return `It is being rendered, and first judged at ${whole(spec.step)} spp; ${whole(job.committed_spp)} are done so far.`;
  }
  return `${leftToSee(job)} ${aim(job)}`.trim();
}

function converged(job) {
  const { rule } = job.spec;
  const at = `It stopped by itself at ${whole(job.spp)} spp`;
  if (rule.name === "visible" && job.estimate_pixels != null) {
    return `${at}: the noise left is ${seen(job)}, by its own estimate, and you allowed ${percent(rule.target)}.`;
  }
  if (rule.name === "reverse" && job.slope != null && job.width) {
    return `${at}: compared with the first image hardly anything changes any more. The curve rises by ${three(job.slope)} pixels per spp; you asked for less than ${three(stopSlope(job, rule))}.`;
  }
  return `${at}: ${sentence(job.reason)}`;
}

function leftToSee(job) {
  if (job.estimate_pixels == null) return "";
  return `The noise left is ${seen(job)}: what more samples would still change so that a person could see it.`;
}

function seen(job) {
  return `${pixels(job.estimate_pixels)} pixels (${percent(job.estimate_fraction)})`;
}

function aim(job) {
  const { rule, max_spp: cap } = job.spec;
  if (rule.name === "visible") {
    if (job.forecast_spp == null) return `It goes on until that is ${percent(rule.target)}, or to ${whole(cap)} spp.`;
    const far = job.forecast_spp > cap ? `, which is beyond its cap of ${whole(cap)}` : "";
    return `It goes on until that is ${percent(rule.target)}, which is expected at ${whole(job.forecast_spp)} spp${far}.`;
  }
  return `It goes on until the rule ${rule.name} stops it, or to ${whole(cap)} spp.`;
}
