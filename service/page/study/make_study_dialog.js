// Making an observer study of a job that kept its slices.

import { get, send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { roughly, several, whole } from "../shared/figures.js";
import { title } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";

/** To read and add a slice takes about so long for each pixel, in seconds. */
const A_PIXEL_S = 6e-8;

/** A button that asks what is to be compared; null where nothing can be. */
export function studyButton(job, go) {
  if (!job.spec.keep_slices || !job.finished_at || !job.spp || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Study…");
}

async function ask(job, go) {
  const others = new Map();
  const reference = h("select", { id: "study-reference", "aria-describedby": "study-reference-help" },
    h("option", { value: "" }, "this job, all its samples"));
  const method = h("select", { id: "study-method", "aria-describedby": "study-method-help" },
    h("option", { value: "constant" }, "constant stimuli: how many see a difference"),
    h("option", { value: "limits" }, "first stage: find the interval"));
  const levels = h("input", { id: "study-levels", type: "text", autocomplete: "off", pattern: "[0-9, ]*", "aria-describedby": "study-levels-help" });
  const name = h("input", { id: "study-name", type: "text", maxlength: 200, value: title(job), required: true, autocomplete: "off" });
  const wrong = h("p", { class: "bad", role: "alert" });
  const merging = h("p", { class: "hint", role: "status" });
  const progress = h("progress", { hidden: true, "aria-label": "Merging slices" });
  const make = h("button", { type: "submit", class: "primary" }, "Make the study");
  const dialog = h("dialog", { class: "ask", "aria-labelledby": "make-study", onclose: () => dialog.remove() },
    h("form", { onsubmit: submit },
      h("h2", { id: "make-study" }, "Ask people what they see"),
      h("p", {}, "Images of this job's first samples are shown beside a reference, to as many observers as you like."),
      field(name, "Name", ""),
      field(reference, "Reference", "A job of the same scene with another seed and more samples is best."),
      field(method, "Method", "The first stage shows the levels rising and falling, and suggests levels for the second."),
      field(levels, "Levels, in spp", `Multiples of ${whole(job.spec.slice_spp)} spp up to ${whole(job.spp)}, with commas between them. Leave this empty for the paper's levels, 1 % to 25 % of the reference.`),
      wrong, progress, merging,
      h("div", { class: "answers" },
        h("button", { type: "button", onclick: () => dialog.close() }, "Leave it"), make)));

  async function submit(event) {
    event.preventDefault();
    work(true);
    try {
      const wanted = levels.value.split(/[, ]+/).filter(Boolean).map(Number);
      const study = await send("POST", "/v1/studies", {
        job_id: job.id, reference_job_id: reference.value || null, method: method.value,
        levels: wanted.length ? wanted : null, name: name.value,
      });
      dialog.close();
      go(study.links.page);
    } catch (error) {
      setText(wrong, error.message);
      work(false);
    }
  }

  /** All slices are merged within the one request: says how many, and how long that takes. */
  function work(isUnderWay) {
    const slices = slicesOf(job) + (others.has(reference.value) ? slicesOf(others.get(reference.value)) : 0);
    make.disabled = isUnderWay;
    progress.hidden = !isUnderWay;
    setText(make, isUnderWay ? "Merging…" : "Make the study");
    setText(merging, isUnderWay
      ? `Merging ${several(slices, "slice")}, about ${roughly(slices * secondsOf(job))}. You may leave this page: the list of studies shows the study once it is made.`
      : "");
  }
  document.body.append(dialog);
  dialog.showModal();
  const { jobs } = await get("/v1/jobs?limit=200").catch(() => ({ jobs: [] }));
  for (const other of jobs) {
    const fits = other.spec.keep_slices && other.finished_at && other.id !== job.id && other.width === job.width && other.height === job.height;
    if (!fits) continue;
    others.set(other.id, other);
    reference.append(h("option", { value: other.id }, `${title(other)}, ${whole(other.spp)} spp, seed ${other.spec.seed}`));
  }
}

function slicesOf({ committed_spp: spp, spec }) {
  return spp / spec.slice_spp;
}

function secondsOf({ width, height }) {
  return A_PIXEL_S * width * height;
}

function field(input, label, help) {
  return h("div", { class: "field" }, h("label", { for: input.id }, label), input,
    help && h("p", { class: "help", id: `${input.id}-help` }, help));
}
