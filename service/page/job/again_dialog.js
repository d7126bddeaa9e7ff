// Submitting a job's scene again, with another spec.

import { send, upload } from "../shared/api.js";
import { openForm } from "../shared/dialogs.js";
import { h } from "../shared/dom.js";
import { OneJob } from "../shared/job_request.js";
import { ENDED, title } from "../shared/job_summary.js";
import { complain } from "../shared/notices.js";
import { maySteer, maySubmit } from "../shared/permissions.js";

/**
 * The button for it; null while the job runs.
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
export function againButton(job, go) {
  if (!ENDED.has(job.state) || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Submit again…");
}

/**
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
function ask(job, go) {
  const { webhook, ...spec } = job.spec;
  const text = h("textarea", { id: "again-spec", rows: 18, spellcheck: false });
  text.value = JSON.stringify(spec, null, 2);
  const wanted = new OneJob();
  const dialog = openForm(`Submit ${title(job)} again`, "Submit it", [
    h("p", {}, "A new job renders the same scene from its first sample on. Change what is to be different; what you leave out has its default."),
    h("div", { class: "field" }, h("label", { for: text.id }, "The spec, as JSON"), text),
    h("p", { class: "help", hidden: !webhook }, "The job's webhook is left out: add it, if it is to hear of the new job."),
  ], {
    send: async () => {
      const next = await submitAgain(job, text.value, wanted);
      return () => go(`/jobs/${next.id}`);
    },
    refused: () => text.focus(),
  });
  dialog.classList.add("wide");
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

/**
 * @param {Api.JobView} job
 * @param {string} spec - as JSON
 * @param {OneJob} wanted
 */
function submitAgain({ scene_sha256: scene }, spec, wanted) {
  const form = new FormData();
  form.set("scene_sha256", scene);
  form.set("spec", new Blob([spec], { type: "application/json" }));
  const { signal } = new AbortController();
  return wanted.make((headers) => upload("/v1/jobs", form, { signal, headers }));
}
