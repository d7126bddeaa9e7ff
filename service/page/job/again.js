// Submitting a job's scene again.

import { h } from "../shared/dom.js";
import { AGAIN, ENDED } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";

/**
 * The way to the form with the job's scene and spec; null while the job runs.
 * @param {Api.JobView} job
 */
export function againButton(job) {
  if (!ENDED.has(job.state) || !maySubmit()) return null;
  return h("a", { class: "button", href: `/submit?${AGAIN}=${job.id}` }, "Submit again…");
}
