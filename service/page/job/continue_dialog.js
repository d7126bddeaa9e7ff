// Continuing an ended job, to a stricter rule or a higher cap, as a new job.

import { openForm } from "../shared/dialogs.js";
import { h } from "../shared/dom.js";
import { whole } from "../shared/figures.js";
import { fieldsOf } from "../shared/form_fields.js";
import { jobMaker } from "../shared/job_request.js";
import { ENDED, noiseTarget } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";
import { fieldIn } from "../shared/rules.js";
import { LIMITS } from "../shared/spec_fields.js";

/**
 * The button for it; null if the job cannot be continued.
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
export function continueButton(job, go) {
  if (!ENDED.has(job.state) || !job.finished_at || !job.spp || job.state === "failed" || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Continue…");
}

/**
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
function ask(job, go) {
  const { rule, max_spp: cap } = job.spec;
  const limits = fieldsOf("spec", LIMITS.filter(({ name }) => name === "max_spp").map((about) => {
    const most = about.max ?? Infinity;
    return {
      ...about, value: Math.min(most, Math.max(cap, 2 * job.spp)), min: Math.min(most, job.spp + 1),
      help: `The job has ${whole(job.spp)} now; the new one keeps them all.`,
    };
  }));
  const asked = fieldIn("noise_target", rule);
  const target = noiseTarget(job) ?? 0;
  const stricter = fieldsOf("spec.rule", !asked ? [] : [{
    ...asked, help: "The smaller, the stricter.",
    value: Number(Math.max(asked.min, job.state === "converged" ? target / 2 : target).toPrecision(3)),
  }]);
  const changes = () => ({ ...limits.values(), ...(asked && { rule: stricter.values() }) });
  openForm(`Continue ${job.name}`, "Continue",
    [h("p", {}, "A new job takes over its samples; this one stays as it is."), ...limits.elements, ...stricter.elements],
    { send: jobMaker(job.links.continue, changes, go) });
}
