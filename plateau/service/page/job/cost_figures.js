// A job's savings and costs, in figures.

import { h, setText } from "../shared/dom.js";
import { duration, large, share, sppOf, three, whole } from "../shared/figures.js";
import { durationSeconds, imagePixels, savings } from "../shared/job_summary.js";

export class CostFigures {
  /** @type {Map<string, HTMLElement>} */
  #rows = new Map();
  element = h("section", { class: "facts", "aria-label": "Figures" });

  /** @param {Api.JobView} job */
  show(job) {
    const saved = savings(job);
    this.#set("saved", saved ? "saved" : "", saved ? share(saved.fraction) : "",
      saved ? `of the cap: ${large(saved.samples)} samples${saved.machine ? `, about ${saved.machine} of machine time` : ""}` : "");
    this.#set("spp", "samples", sppOf(job.spp, job), `of ${whole(job.spec.max_spp)} at most`);
    this.#set("machine", "machine time", job.machine_s ? duration(job.machine_s) : "–",
      job.started_at ? `within ${duration(durationSeconds(job))} since it was submitted` : "not started");
    this.#set("cost", job.core_hours ? "cost" : "", `${three(job.core_hours)} core hours`, "machine time times the threads of the workers");
    this.#set("broken", job.non_finite_pixels ? "broken" : "", `${whole(job.non_finite_pixels ?? 0)} px`,
      "NaN or infinite, left out of what is counted");
    const rendered = (job.committed_spp - job.continued_spp) * imagePixels(job);
    const rate = job.machine_s ? rendered / job.machine_s : 0;
    this.#set("rate", rate ? "rate" : "", `${three(rate / 1e6)} M`, "samples per second and worker");
  }

  /**
   * @param {string} key
   * @param {string} name - "" hides the figure
   * @param {string} value
   * @param {string} more
   */
  #set(key, name, value, more) {
    let row = this.#rows.get(key);
    if (!row) {
      row = h("div", {}, h("p", { class: "fact-name" }), h("p", { class: "fact" }), h("p", { class: "fact-more" }));
      this.element.append(row);
      this.#rows.set(key, row);
    }
    row.hidden = !name;
    [name, value, more].forEach((text, at) => setText(row.children[at], text));
  }
}
