// Why a job failed: what its last tries died of, what to do, and what the renderer printed.

import { get } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { clock, sentence, several } from "../shared/figures.js";
import { complain } from "../shared/notices.js";

/**
 * What to do: where the scene is at fault, where renderers died, and otherwise.
 * @type {Record<string, string>}
 */
const ADVICE = {
  scene: "No worker can render the scene as it is. Mend it, and submit it.",
  deaths: "The renderer died. Most often a machine has too little memory for the scene: a smaller image needs less. If only some machines are at fault, drain their workers, and render it again.",
};
const OTHERWISE = "Change what is named above, and render it again.";

export class Failure {
  #signal;
  #shown = "";
  element = h("section", { class: "failure", "aria-label": "Why it failed", hidden: true });

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#signal = signal;
  }

  /** @param {Api.JobView} job */
  show(job) {
    const key = job.state === "failed" ? job.id : "";
    if (key === this.#shown) return;
    this.#shown = key;
    this.element.hidden = !key;
    if (key) this.#fill(job).catch((error) => {
      this.#shown = "";
      if (!this.#signal.aborted) complain(error);
    });
  }

  /** @param {Api.JobView} job */
  async #fill(job) {
    /** @type {Api.Log} */
    const { entries } = await get(job.links.log, this.#signal);
    const ends = job.ended_by === "deaths" ? "died" : "failed";
    const tries = entries.filter(({ what, slice }) => slice === job.failed_slice && what === ends);
    const workers = new Set(tries.map(({ worker }) => worker)).size;
    this.element.replaceChildren(h("div", {},
      h("p", {}, ADVICE[job.ended_by ?? ""] ?? OTHERWISE),
      tries.length > 0 && h("p", { class: "summary" },
        `Slice ${tries[0].slice} was tried ${several(tries.length, "time")}, by ${several(workers, "worker")}.`),
      ...tries.map(({ at, worker, cause, text }) => h("div", {},
        h("p", { class: "summary" }, h("time", { datetime: at }, clock(at)), ` ${worker}: ${sentence(cause ?? "")}`),
        text && h("pre", { tabindex: 0, "aria-label": `What ${worker} printed` }, text)))));
  }
}
