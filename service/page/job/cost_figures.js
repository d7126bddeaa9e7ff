// What a job saved and cost, in figures.

import { h, setText } from "../shared/dom.js";
import { duration, large, share, three, whole } from "../shared/figures.js";
import { durationSeconds, savings } from "../shared/job_summary.js";

export class Facts {
  #rows = new Map();
  element = h("section", { class: "facts", "aria-label": "Figures" });

  show(job) {
    const saved = savings(job);
    this.#set("saved", saved && "saved", saved && share(saved.fraction),
      saved && `of the cap: ${large(saved.samples)} samples${saved.machine ? `, about ${saved.machine} of machine time` : ""}`);
    this.#set("spp", "samples", `${whole(job.spp)} spp`, `of ${whole(job.spec.max_spp)} at most`);
    this.#set("machine", "machine time", job.machine_s ? duration(job.machine_s) : "–",
      job.started_at ? `within ${duration(durationSeconds(job))} since it was submitted` : "not started");
    this.#set("broken", job.non_finite_pixels ? "broken" : null, `${whole(job.non_finite_pixels ?? 0)} px`,
      "NaN or infinite, left out of what is counted");
    const rate = job.width && job.machine_s ? (job.committed_spp * job.width * job.height) / job.machine_s : 0;
    this.#set("rate", rate ? "rate" : null, `${three(rate / 1e6)} M`, "samples per second and worker");
  }

  #set(key, name, value, more) {
    let row = this.#rows.get(key);
    if (!row) {
      row = { name: h("p", { class: "fact-name" }), value: h("p", { class: "fact" }), more: h("p", { class: "fact-more" }) };
      row.element = h("div", {}, row.name, row.value, row.more);
      this.element.append(row.element);
      this.#rows.set(key, row);
    }
    row.element.hidden = !name;
    if (!name) return;
    setText(row.name, name);
    setText(row.value, value);
    setText(row.more, more ?? "");
  }
}
