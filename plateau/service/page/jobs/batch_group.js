// The jobs of a batch, together.

import { h, KeyedList, setAttribute, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { inWords } from "../shared/job_summary.js";
import { JobRow, nameOf } from "./job_row.js";
import { batchMenu } from "./menus.js";

const MANY = 6;

/** @import { ListedJob, RowContext } from "./job_row.js" */
/** @typedef {{ batch: string, jobs: ListedJob[] }} Group */

export class BatchGroup {
  #batch;
  /** @type {ListedJob[]} */
  #jobs = [];
  #counts = h("span", { class: "counts" });
  #details;
  #rows;

  /**
   * @param {Group} group
   * @param {RowContext} context
   */
  constructor(group, context) {
    this.#batch = group.batch;
    const list = h("ul", { class: "jobs", "aria-label": `Jobs of the batch ${group.batch}` });
    this.#details = h("details", { open: group.jobs.length <= MANY },
      h("summary", {}, h("span", { class: "batch-name" }, group.batch), this.#counts),
      list);
    this.element = h("li", { class: "batch" }, this.#details,
      batchMenu(this.#batch, () => this.#jobs, (id) => this.#nameOf(id), context.refresh, context.deleted).element);
    this.#rows = new KeyedList(list, (/** @type {ListedJob} */ job) => new JobRow(job, context));
  }

  /** @param {Group} group */
  update({ jobs }) {
    const counts = new Map();
    for (const { state } of jobs) counts.set(state, (counts.get(state) ?? 0) + 1);
    const states = [...counts].map(([state, count]) => `${count} ${inWords(state, count)}`).join(", ");
    setText(this.#counts, `${several(jobs.length, "job")}: ${states}`);
    setAttribute(this.element, "data-batch", this.#batch);
    const differing = namesOfDiffering(jobs);
    this.#jobs = jobs.map((job) => ({ ...job, told: told(job, differing) }));
    this.#rows.show(this.#jobs, (job) => job.id);
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
