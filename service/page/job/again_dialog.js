// Submitting a job's scene again, with another spec.

import { upload } from "../shared/api.js";
import { openForm } from "../shared/dialogs.js";
import { h } from "../shared/dom.js";
import { OneJob } from "../shared/job_request.js";
import { ENDED, title } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";

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
  const { webhook, ...spec } = job.spec;  // the path of a webhook may be hidden
  const text = h("textarea", { id: "again-spec", rows: 18, spellcheck: false });
  text.value = JSON.stringify(spec, null, 2);
  const wanted = new OneJob();
  const dialog = openForm(`Submit ${title(job)} again`, "Submit it", [
    h("p", {}, "A new job renders the same scene from its first sample on. Change what is to be different; what you leave out has its default."),
    h("div", { class: "field" }, h("label", { for: text.id }, "The spec, as JSON"), text),
    h("p", { class: "help", hidden: !webhook }, "The job's webhook is left out: add it, if it is to hear of the new job."),
  ], {
    send: async () => {
      const form = new FormData();
      form.set("scene_sha256", job.scene_sha256);
      form.set("spec", new Blob([text.value], { type: "application/json" }));
      const { signal } = new AbortController();
      const next = await wanted.make((headers) => upload("/v1/jobs", form, { signal, headers }));
      return () => go(`/jobs/${next.id}`);
    },
    refused: () => text.focus(),
  });
  dialog.classList.add("wide");
}
