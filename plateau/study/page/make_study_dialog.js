// The dialog that makes an observer study of a job that kept its slices.

import { get, send } from "../shared/api.js";
import { openDialog } from "../shared/dialogs.js";
import { h, setText } from "../shared/dom.js";
import { several, whole } from "../shared/figures.js";
import { zoneSize } from "../shared/job_summary.js";
import { messageOf } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";

/**
 * The button for it; null if the job does not allow a study.
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
export function studyButton(job, go) {
  if (!job.spec.keep_slices || !job.finished_at || !job.spp || zoneSize(job) || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Study…");
}

/**
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
async function ask(job, go) {
  /** @type {Map<string, Api.JobView>} */
  const others = new Map();
  const reference = h("select", { id: "study-reference", "aria-describedby": "study-reference-help" },
    h("option", { value: "" }, "this job, all its samples"));
  const method = h("select", { id: "study-method", "aria-describedby": "study-method-help" },
    h("option", { value: "constant" }, "constant stimuli: how many see a difference"),
    h("option", { value: "limits" }, "first stage: find the interval"));
  const levels = h("input", { id: "study-levels", type: "text", autocomplete: "off", pattern: "[0-9, ]*", "aria-describedby": "study-levels-help" });
  const name = h("input", { id: "study-name", type: "text", maxlength: 200, value: job.name, required: true, autocomplete: "off" });
  const merging = h("p", { class: "hint", role: "status" });
  const progress = h("progress", { hidden: true, "aria-label": "Merging slices" });
  const wrong = h("p", { class: "bad", role: "alert" });
  const button = h("button", { type: "submit", class: "primary" }, "Make the study");
  const dialog = openDialog("Ask people what they see", { onsubmit: make }, [
    h("p", {}, "Images of this job's first samples are shown beside a reference, to as many observers as you like."),
    field(name, "Name", ""),
    field(reference, "Reference", "A job of the same scene with another seed and more samples is best."),
    field(method, "Method", "The first stage shows the levels rising and falling, and suggests levels for the second."),
    field(levels, "Levels, in spp", `Multiples of ${whole(job.spec.slice_spp)} spp up to ${whole(job.spp)}, with commas between them. Leave this empty for the paper's levels, 1 % to 25 % of the reference.`),
    progress, merging, wrong,
    h("div", { class: "answers" }, h("button", { type: "button", onclick: () => dialog.close() }, "Close"), button),
  ]);

  /** @param {SubmitEvent} event */
  async function make(event) {
    event.preventDefault();
    waits(true);
    try {
      const wanted = levels.value.split(/[, ]+/).filter(Boolean).map(Number);
      /** @type {Api.StudyView} */
      const study = await send("POST", "/v1/studies", {
        job_id: job.id, reference_job_id: reference.value || null, method: method.value,
        levels: wanted.length ? wanted : null, name: name.value,
      });
      if (!dialog.open) return;
      dialog.close();
      go(study.links.page);
    } catch (error) {
      setText(wrong, messageOf(error));
    }
    waits(false);
  }

  /**
   * The request merges all slices, which takes long.
   * @param {boolean} busy
   */
  function waits(busy) {
    const slices = slicesOf(job) + slicesOf(others.get(reference.value));
    button.disabled = busy;
    progress.hidden = !busy;
    if (busy) setText(wrong, "");
    setText(merging, busy ? `Merging ${several(slices, "slice")}. You may leave this page: the list of studies shows the study once it is made.` : "");
  }

  /** @type {Api.JobPage} */
  const { jobs } = await get("/v1/jobs?limit=200").catch(() => ({ jobs: [] }));
  for (const other of jobs) {
    const fits = other.spec.keep_slices && other.finished_at && other.id !== job.id && other.width === job.width && other.height === job.height;
    if (!fits) continue;
    others.set(other.id, other);
    reference.append(h("option", { value: other.id }, `${other.name}, ${whole(other.spp)} spp, seed ${other.spec.seed}`));
  }
}

/** @param {Api.JobView | undefined} job */
function slicesOf(job) {
  return job ? job.committed_spp / job.spec.slice_spp : 0;
}

/**
 * @param {HTMLElement} input
 * @param {string} label
 * @param {string} help
 */
function field(input, label, help) {
  return h("div", { class: "field" }, h("label", { for: input.id }, label), input,
    help && h("p", { class: "help", id: `${input.id}-help` }, help));
}
