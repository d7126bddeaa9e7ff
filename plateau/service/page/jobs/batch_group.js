// The jobs of a batch, together.

import { h, KeyedList, setAttribute, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { inWords } from "../shared/job_summary.js";
import { maySteer } from "../shared/permissions.js";
import { JobRow, nameOf } from "./job_row.js";
import { showShot } from "./shot_dialog.js";

const MANY = 6;

/** @import { ListedJob, RowContext } from "./job_row.js" */
/** @typedef {{ batch: string, jobs: ListedJob[] }} Group */

export class BatchGroup {
  /** @type {ListedJob[]} */
  #jobs = [];
  #selection;
  #isPart;
  #counts = h("span", { class: "counts" });
  #pick = h("input", { type: "checkbox", onclick: () => { this.#selection.select(this.#jobs, this.#pick.checked); } });
  #all = h("label", { class: "toggle" }, this.#pick, "Select all");
  #shot;
  #rows;

  /**
   * @param {Group} group
   * @param {RowContext} context
   */
  constructor({ batch, jobs }, context) {
    this.#selection = context.selection;
    this.#isPart = context.isPart;
    setAttribute(this.#pick, "aria-label", `Select all of the batch ${batch}`);
    this.#shot = h("button", { class: "quiet", onclick: () => showShot(batch, (id) => this.#nameOf(id)) }, "Look at the shot");
    const list = h("ul", { class: "jobs", "aria-label": `Jobs of the batch ${batch}` });
    this.element = h("li", { class: "batch", "data-batch": batch },
      h("p", { class: "actions" }, this.#shot, this.#all),
      h("details", { open: jobs.length <= MANY },
        h("summary", {}, h("span", { class: "batch-name" }, batch), this.#counts), list));
    this.#rows = new KeyedList(list, (/** @type {ListedJob} */ job) => new JobRow(job, context));
  }

  /** @param {Group} group */
  update({ jobs }) {
    const counts = new Map();
    for (const { state } of jobs) counts.set(state, (counts.get(state) ?? 0) + 1);
    const states = [...counts].map(([state, count]) => `${count} ${inWords(state, count)}`).join(", ");
    setText(this.#counts, `${several(jobs.length, "job")}${this.#isPart() ? " listed" : ""}: ${states}`);
    const differing = namesOfDiffering(jobs);
    this.#jobs = jobs.map((job) => ({ ...job, told: told(job, differing) }));
    this.#shot.hidden = !jobs.some((job) => job.in_shot);
    const own = jobs.filter(maySteer);
    const selected = own.filter(({ id }) => this.#selection.has(id)).length;
    this.#all.hidden = !own.length;
    this.#pick.checked = selected === own.length;
    this.#pick.indeterminate = selected > 0 && selected < own.length;
    this.#rows.show(this.#jobs, (job) => job.id);
  }

  remove() {
    this.#rows.clear();
  }

  /** @param {string} id */
  #nameOf(id) {
    const job = this.#jobs.find((one) => one.id === id);
    return job ? nameOf(job) : id;
  }
}

/**
 * The parameters in which the jobs of a batch are not all alike.
 * @param {ListedJob[]} jobs
 */
function namesOfDiffering(jobs) {
  const names = new Set(jobs.flatMap((job) => Object.keys(job.spec.parameters)));
  return [...names].filter((name) => new Set(jobs.map((job) => job.spec.parameters[name])).size > 1);
}

/**
 * @param {ListedJob} job
 * @param {string[]} names
 */
function told({ spec: { parameters } }, names) {
  return names.filter((name) => name in parameters).map((name) => `${name} ${parameters[name]}`).join(", ");
}
