// Submitting a job's scene again: with another spec, or as it was.

import { send } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { OneJob } from "../shared/job_request.js";
import { AGAIN, ENDED } from "../shared/job_summary.js";
import { complain } from "../shared/notices.js";
import { maySteer, maySubmit } from "../shared/permissions.js";

/**
 * The way to the form with the job's scene and spec; null while the job runs.
 * @param {Api.JobView} job
 */
export function againButton(job) {
  if (!ENDED.has(job.state) || !maySubmit()) return null;
  return h("a", { class: "button", href: `/submit?${AGAIN}=${job.id}` }, "Submit again…");
}

/**
 * A button that tries a job again at once, on workers on which it did not fail; null if the key may not.
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
export function tryAgainButton(job, go) {
  if (!maySteer(job)) return null;
  const wanted = new OneJob();
  return h("button", { class: "primary", onclick: async () => {
    try {
      const next = await wanted.make((headers) => send("POST", job.links.retry, undefined, headers));
      go(`/jobs/${next.id}`);
    } catch (error) {
      complain(error, true);
    }
  } }, "Try again on another worker");
}
