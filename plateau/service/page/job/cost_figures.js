// A job's savings and costs, in figures.

import { h } from "../shared/dom.js";
import { duration, large, share, three, whole } from "../shared/figures.js";
import { durationSeconds, imagePixels, savings } from "../shared/job_summary.js";

export class CostFigures {
  #shown = "";
  element = h("section", { class: "facts", "aria-label": "Figures" });

  /** @param {Api.JobView} job */
  show(job) {
    const saved = savings(job);
    const machine = saved?.machine ? `, about ${saved.machine} of machine time` : "";
    const rendered = (job.committed_spp - (job.again?.kept_spp ?? 0)) * imagePixels(job);
    const rate = job.machine_s ? rendered / job.machine_s : 0;
    const zones = job.spp_min == null || job.spp_max == null || job.spp_min === job.spp_max ? "" : `; by zones ${whole(job.spp_min)} to ${whole(job.spp_max)}`;
    const figures = [
      ["saved", saved ? share(saved.fraction) : "", `of the cap: ${large(saved?.samples ?? 0)} samples${machine}`],
      ["samples", `${whole(job.spp)} spp`, `of ${whole(job.spec.max_spp)} at most${zones}`],
      ["machine time", job.machine_s ? duration(job.machine_s) : "–",
        job.started_at ? `within ${duration(durationSeconds(job))} since it was submitted` : "not started"],
      ["cost", job.core_hours ? `${three(job.core_hours)} core hours` : "", "machine time times the threads of the workers"],
      ["broken", job.non_finite_pixels ? `${whole(job.non_finite_pixels)} px` : "", "NaN or infinite, left out of what is counted"],
      ["rate", rate ? `${three(rate / 1e6)} M` : "", "samples per second and worker"],
    ].filter(([, figure]) => figure);
    if (this.#shown === String(figures)) return;  // what is marked to be copied stays marked
    this.#shown = String(figures);
    this.element.replaceChildren(...figures.map(([name, figure, more]) => h("div", {},
      h("p", { class: "fact-name" }, name), h("p", { class: "fact" }, figure), h("p", { class: "fact-more" }, more))));
  }
}
