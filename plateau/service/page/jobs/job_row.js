// A job as a row of the list.

import { h, setAttribute, setText } from "../shared/dom.js";
import { ago, percent, several, share, whole } from "../shared/figures.js";
import { asked, deletedSince, ENDED, savings, shortId, took } from "../shared/job_summary.js";
import { maySteer } from "../shared/permissions.js";
import { Picture } from "../shared/picture.js";

/** @import { Selection } from "./selection.js" */

const PICTURE_EVERY_MS = 4000;

/** @typedef {Api.JobView & { serving?: number, told?: string }} ListedJob
 *   a job with the number of its workers, and its differences from the others of its batch */
/** @typedef {{ signal: AbortSignal, selection: Selection, isPart: () => boolean }} RowContext  isPart: whether some jobs may be left out */

export class JobRow {
  #signal;
  #selection;
  #seen = false;
  #job;
  #shownPicture = "";
  #picturedAt = 0;
  #fetching = false;
  #image = h("img", { alt: "", width: 96, height: 72, hidden: true });
  #picture = new Picture(this.#image);
  #pick = h("input", { type: "checkbox", class: "pick", onclick: (event) => {
    this.#selection.toggle(this.#job, { checked: this.#pick.checked, range: event.shiftKey });
  } });
  #name = h("a", { class: "name" });
  #state = h("span", { class: "state" });
  #id = h("code", { class: "job-id" });
  #owner = h("span", { class: "owner" });
  #asked = h("p", { class: "asked" });
  #why = h("p", { class: "why" });
  #spp = h("strong");
  #cap = h("span");
  #left = h("strong");
  #leftOf = h("span");
  #time = h("span");
  #who = h("span");

  /**
   * @param {ListedJob} job
   * @param {RowContext} context
   */
  constructor(job, { signal, selection }) {
    this.#job = job;
    this.#signal = signal;
    this.#selection = selection;
    this.element = h("li", { class: "job" },
      h("div", { class: "thumb" }, this.#image, this.#pick),
      h("div", { class: "what" },
        h("p", { class: "title" }, this.#name, this.#state, this.#id, this.#owner),
        this.#asked, this.#why),
      h("p", { class: "figure" }, this.#spp, this.#cap),
      h("p", { class: "figure" }, this.#left, this.#leftOf),
      h("p", { class: "figure" }, this.#time, this.#who));
    // Only rows in sight fetch pictures.
    this.element.addEventListener("contentvisibilityautostatechange", (event) => {
      this.#seen = !(/** @type {ContentVisibilityAutoStateChangeEvent} */ (event).skipped);
      if (this.#seen) this.#fetch();
    });
  }

  /** @param {ListedJob} job */
  update(job) {
    this.#job = job;
    const { spec, state } = job;
    setAttribute(this.element, "data-state", state);
    setAttribute(this.element, "data-job", job.id);
    setAttribute(this.#name, "href", `/jobs/${job.id}`);
    const name = nameOf(job);
    setText(this.#name, name);
    setAttribute(this.#pick, "aria-label", `Select ${name}`);
    setAttribute(this.#pick, "hidden", maySteer(job) ? null : "");
    this.#pick.checked = this.#selection.has(job.id);
    setText(this.#state, job.outcome);
    setAttribute(this.#state, "data-state", state);
    setText(this.#owner, job.owner_name ? `by ${job.owner_name}` : "");
    setText(this.#id, shortId(job));
    setText(this.#asked, asked(job, { withParameters: !job.told }).join(" · "));
    setAttribute(this.#asked, "title", this.#asked.textContent);
    const why = [deletedSince(job), job.waits_for ?? job.reason].filter(Boolean).join(" · ");
    setText(this.#why, why);
    setAttribute(this.#why, "title", why);
    setText(this.#spp, `${whole(job.spp)} spp`);
    const saved = savings(job);
    setText(this.#cap, saved ? `${share(saved.fraction)} saved` : `of ${whole(spec.max_spp)} at most`);
    setText(this.#left, job.estimate_fraction == null ? "" : percent(job.estimate_fraction));
    setText(this.#leftOf, job.estimate_fraction == null ? "" : job.estimate_undetermined ? "noise left, undetermined" : "noise left");
    setText(this.#time, ENDED.has(state) ? took(job) : job.time_left);
    setText(this.#who, who(job));
    if (this.#seen) this.#fetch();
  }

  remove() {
    this.#picture.letGo();
  }

  #fetch() {
    const job = this.#job;
    const stamp = `${job.image_spp} ${job.finished_at ?? ""}`;
    const due = Boolean(job.finished_at) || Date.now() > this.#picturedAt + PICTURE_EVERY_MS;
    if (job.image_spp && job.spec.pictures && stamp !== this.#shownPicture && due && !this.#fetching) {
      this.#fetching = true;
      this.#shownPicture = stamp;
      this.#picturedAt = Date.now();
      this.#picture.show(job.links.thumbnail_png, this.#signal)
        .then(() => (this.#image.hidden = false), () => (this.#shownPicture = ""))
        .finally(() => (this.#fetching = false));
    }
  }
}

/**
 * A job's name in the list, with its differences from the others of its batch.
 * @param {ListedJob} job
 */
export function nameOf(job) {
  return [job.name, job.told].filter(Boolean).join(", ");
}

/** @param {ListedJob} job */
function who(job) {
  if (ENDED.has(job.state)) return ago(job.ended_at);
  if (job.serving) return several(job.serving, "worker");
  return job.state === "rendering" ? "waits for a worker" : ago(job.created_at);
}
