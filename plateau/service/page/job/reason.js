// Why a job is in its state, in words for readers who do not know the papers.

import { percent, pixels, sentence, several, sppOf, whole } from "../shared/figures.js";
import { valueIn } from "../shared/rules.js";

/** What to do about a failure: where the scene is at fault, where renderers died, and otherwise. @type {Record<string, string>} */
const ADVICE = {
  scene: "No worker can render the scene as it is. Mend it, and submit it.",
  deaths: "The renderer died. Most often a machine has too little memory for the scene: a smaller image needs less. If only some machines are at fault, drain their workers, and render it again.",
};
const OTHERWISE = "Change what is named here, and render it again.";

/**
 * One or two sentences: what happened, and what it means.
 * @param {Api.JobView} job
 */
export function reasonInWords(job) {
  const { state, spec } = job;
  if (state === "converged") return sentence(`it stopped by itself at ${sppOf(job.spp, job)}: ${job.reason}`);
  if (state === "exhausted") return `${sentence(job.reason)} ${leftToSee(job)}`.trim();
  if (state === "cancelled") {
    const kept = job.spp ? ` Its image stays as it was, at ${whole(job.spp)} spp.` : "";
    return `${sentence(job.reason)}${kept}`;
  }
  if (state === "failed") return `${sentence(job.reason)} ${ADVICE[job.ended_by ?? ""] ?? OTHERWISE}`;
  if (state === "paused" || job.held) return `${sentence(job.reason)} Workers render no more of it until it is resumed.`;
  if (job.waits_for) return `It ${job.waits_for}. ${leftToSee(job)}`.trim();
  if (state === "queued") {
    return job.fitting_workers ? `It waits for a worker: ${several(job.fitting_workers, "living one")} can render it.` : "It waits for a worker.";
  }
  if (!job.points) {
    return `It is being rendered, and first judged at ${whole(spec.step)} spp; ${whole(job.committed_spp)} are done so far.`;
  }
  return `${leftToSee(job)} ${aim(job)}`.trim();
}

/** @param {Api.JobView} job */
function leftToSee(job) {
  if (job.estimate_pixels == null) return "";
  const doubt = job.estimate_undetermined ? " It may be far more: the samples do not tell yet how wrong the denoiser is." : "";
  const seen = `${pixels(job.estimate_pixels)} pixels (${percent(job.estimate_fraction ?? 0)})`;
  return `The noise left is ${seen}: what more samples would still change so that a person could see it.${doubt}`;
}

/** @param {Api.JobView} job */
function aim(job) {
  const { rule, max_spp: cap } = job.spec;
  const target = valueIn("noise_target", rule);
  const end = target == null ? `the rule ${rule.name} stops it` : `that is ${percent(target)}`;
  const expected = job.expected_spp == null ? "" : `, which is expected at ${whole(job.expected_spp)} spp`;
  return `It continues until ${end}${expected}, or to ${whole(cap)} spp.`;
}
