// The selected jobs, and the bar of actions on all of them.

import { downloadLink } from "../shared/api.js";
import { byId, h, setAttribute, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { JobControls } from "../shared/job_controls.js";
import { comparisonOf } from "../shared/job_summary.js";
import { maySteer } from "../shared/permissions.js";

/** Jobs whose results the API sends in one zip. */
const MOST_DOWNLOADED = 200;

export class Selection {
  #changed;
  /** @type {Set<string>} */
  #ids = new Set();
  /** The listed jobs that may be selected, from top to bottom. @type {Api.JobView[]} */
  #jobs = [];
  /** The job that was selected last, from which the Shift key selects a range. */
  #last = "";
  #count = h("strong");
  #compare = h("a", { class: "button", hidden: true }, "Compare");
  #download = downloadLink("", "results.zip", "Download");
  #controls;
  #every = h("button", { class: "quiet", onclick: () => this.select(this.#jobs, true) });
  #clear = h("button", { class: "quiet", onclick: () => this.select(this.#jobs, false) }, "Clear");
  element;

  /**
   * @param {() => void} changed - called when jobs are selected or not any more
   * @param {() => unknown} refresh - called when jobs were changed
   */
  constructor(changed, refresh) {
    this.#changed = changed;
    this.#controls = new JobControls(refresh);
    this.#download.className = "button";
    this.element = h("div", { class: "selected", role: "region", "aria-label": "Selected jobs", hidden: true },
      this.#count, this.#compare, this.#download, this.#controls.elements, this.#every, this.#clear);
  }

  /**
   * Takes the listed jobs; one that is listed no more is selected no more.
   * @param {Api.JobView[]} jobs - from top to bottom
   */
  show(jobs) {
    const focused = this.element.contains(document.activeElement) ? document.activeElement : null;
    this.#jobs = jobs.filter(maySteer);
    const selected = this.#jobs.filter(({ id }) => this.has(id));
    this.#ids = new Set(selected.map(({ id }) => id));
    this.element.hidden = !selected.length;
    setText(this.#count, `${several(selected.length, "job")} selected`);
    setText(this.#every, `Select all ${this.#jobs.length}`);
    this.#every.hidden = selected.length === this.#jobs.length;
    const compared = selected.length === 2 ? comparisonOf(selected[0], selected[1]) : null;
    this.#compare.hidden = !compared;
    setAttribute(this.#compare, "href", compared);
    const images = selected.filter(({ image_spp: spp }) => spp).slice(0, MOST_DOWNLOADED);
    this.#download.hidden = !images.length;
    setText(this.#download, images.length < selected.length ? `Download ${images.length}` : "Download");
    setAttribute(this.#download, "href", `/v1/results.zip?${images.map(({ id }) => `job=${id}`).join("&")}`);
    this.#controls.show(selected);
    if (!focused?.closest("[hidden]")) return;
    // What had the focus is gone.
    if (selected.length) this.#clear.focus();
    else byId("main").focus({ preventScroll: true });
  }

  /** @param {string} id */
  has(id) {
    return this.#ids.has(id);
  }

  /**
   * Selects a job, or all from the one before to this; or removes it from the selection.
   * @param {Api.JobView} job
   * @param {{ checked: boolean, range: boolean }} how
   */
  toggle(job, { checked, range }) {
    const ids = this.#jobs.map(({ id }) => id);
    const [from, to] = [ids.indexOf(range && this.#last ? this.#last : job.id), ids.indexOf(job.id)].sort((a, b) => a - b);
    this.#last = job.id;
    this.select(from < 0 ? [job] : this.#jobs.slice(from, to + 1), checked);
  }

  /**
   * Selects jobs, or removes them from the selection.
   * @param {Api.JobView[]} jobs
   * @param {boolean} checked
   */
  select(jobs, checked) {
    for (const { id } of jobs) {
      if (checked) this.#ids.add(id);
      else this.#ids.delete(id);
    }
    this.#changed();
  }
}
