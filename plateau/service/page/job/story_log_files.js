// A job's records: its files, its story, its log and its spec.

import { downloadLink, get, isAbort } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { clock, several, whole } from "../shared/figures.js";
import { inWords, isByQuality, zoneSize } from "../shared/job_summary.js";
import { complain } from "../shared/notices.js";

const EVERY_MS = 4000;

/** @import { Child } from "../shared/dom.js" */
/** @import { JobEvent } from "../shared/api.js" */

export class Records {
  #signal;
  /** @type {Api.JobView | null} */
  #job = null;
  /** When the log was fetched, and of which state of the job. */
  #logged = { of: "", at: 0 };
  #story = h("ol", { class: "story" });
  #notes = h("ul", { class: "notes" });
  #log = h("div", { class: "log" });
  #quiet = h("p", { class: "hint" });
  #logShown = "";
  #spec = h("pre", { tabindex: 0, "aria-label": "The job's spec" });
  #files = h("ul", { class: "files" });
  #filesShown = "";
  #logBox;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#signal = signal;
    const box = (/** @type {string} */ name, /** @type {Child} */ inside) => h("details", {}, h("summary", {}, name), inside);
    this.#logBox = box("Log", this.#log);
    this.#logBox.addEventListener("toggle", () => this.#fetch());
    this.element = h("section", { class: "records", "aria-label": "Records" },
      h("div", {}, h("h2", {}, "Files"), this.#files),
      h("details", { open: true }, h("summary", {}, "Story"), this.#story, this.#notes),
      this.#logBox, box("What was asked", this.#spec));
  }

  /**
   * Adds events of the job's stream.
   * @param {JobEvent[]} events
   */
  tell(events) {
    const news = events.filter(({ type }) => ["state", "image", "trouble", "finished"].includes(type));
    this.#story.append(...news.map((event) => h("li", { "data-type": event.type },
      h("time", { datetime: event.data.at }, clock(event.data.at)), " ", ...told(event))));
  }

  /** @param {Api.JobView} job */
  show(job) {
    if (job.state === "failed" && this.#job?.state !== "failed") this.#logBox.open = true;
    this.#job = job;
    this.#showFiles(job);
    const untold = job.notices.filter(({ state }) => state !== "delivered").map(({ to, state, error }) =>
      `The notice to ${to} ${state === "waiting" ? "is not delivered yet" : "was given up"}${error ? `: ${error}` : "."}`);
    const notes = [...job.notes, ...untold].map((note) => h("li", {}, note));
    if (this.#notes.textContent !== notes.map(({ textContent }) => textContent).join("")) this.#notes.replaceChildren(...notes);
    this.#notes.hidden = !this.#notes.childElementCount;
    setText(this.#spec, JSON.stringify(job.spec, null, 2));
    this.#fetch();
  }

  /** @param {Api.JobView} job */
  #showFiles(job) {
    const { id, links, points, image_spp: image, finished_at: finished, non_finite_pixels: broken, estimate_fraction: noise } = job;
    const kind = [image, points, finished, broken, noise != null].map(Boolean).join();
    if (kind === this.#filesShown) return;
    this.#filesShown = kind;
    const ofImage = [
      ["image.exr", "EXR", "the merged image, linear, with its alpha and AOVs", links.image_exr],
      ["image.png", "PNG", "the image as judged", links.image_png],
      ...(zoneSize(job) ? [["spp.png", "Samples", "how many each zone has", links.spp_png]] : []),
    ];
    const ofPoints = [
      ["difference.png", "Difference", "what has changed since the first image", links.difference_png],
      ...(noise == null ? [] : [["noise.png", "Noise", "where noise is left to see", links.noise_png]]),
      ...(noise == null || !isByQuality(job) ? [] : [["quality.png", "Quality", "where a person would see the noise", links.quality_png]]),
      ["curve.csv", "CSV", "the points of the curve", `${links.self}/curve.csv`],
    ];
    const ofBroken = [["non-finite.png", "Broken", "where the image is NaN or infinite", links.non_finite_png]];
    const together = [
      ["results.zip", "Zip", "all of these, with the pictures of its points and a summary", links.results],
    ];
    const files = [...(image ? ofImage : []), ...(points ? ofPoints : []), ...(broken ? ofBroken : [])]
      .filter(([name]) => job.spec.pictures || !name.endsWith(".png"));
    this.#files.replaceChildren(...(files.length ? [...files, ...together].map(([name, short, what, path]) => h("li", {},
      downloadLink(path, `${id}-${name}`, short), " ", h("span", {}, what)))
      : [h("li", {}, finished ? "It ended without any." : "They come with its first samples.")]));
  }

  /** Fetches the log if it is open, again and again while the job runs. */
  #fetch() {
    const { of, at } = this.#logged;
    const now = this.#job?.finished_at ?? this.#job?.state ?? "";
    if (!this.#job || !this.#logBox.open || (now === of && (this.#job.finished_at || Date.now() < at + EVERY_MS))) return;
    this.#logged = { of: now, at: Date.now() };
    this.#fetchLog(this.#job).catch((error) => { this.#logged.of = ""; if (!isAbort(error)) complain(error); });
  }

  /** @param {Api.JobView} job */
  async #fetchLog(job) {
    /** @type {Api.Log} */
    const { entries } = await get(job.links.log, this.#signal);
    const shown = entries.filter(({ what, text }) => what !== "committed" || text);
    const quiet = entries.length - shown.length;
    setText(this.#quiet, quiet ? `${several(quiet, "slice")} went through without trouble.` : "");
    const news = JSON.stringify(shown);
    if (news === this.#logShown) return; // whoever reads it keeps their place
    this.#logShown = news;
    this.#log.replaceChildren(this.#quiet,
      ...shown.map((entry) => h("div", {},
        h("p", { "data-what": entry.what }, h("time", { datetime: entry.at }, clock(entry.at)),
          ` slice ${entry.slice} ${entry.what} by ${entry.worker}`, entry.cause ? `: ${entry.cause}` : ""),
        entry.text && h("pre", { tabindex: 0, "aria-label": `Output of slice ${entry.slice}` }, entry.text))));
  }
}

/** @param {JobEvent} event */
function told({ type, data }) {
  if (type === "image") return [`The first image is there, of ${whole(data.spp)} spp.`];
  if (type === "finished") return ["Its results are written."];
  if (type === "trouble") return [`Slice ${data.index}, worker ${data.worker}: ${data.cause}`];
  const reason = data.reason && data.reason !== data.to ? `: ${data.reason}` : "";
  return [h("b", { class: "state", "data-state": data.to }, inWords(data.to)), reason];
}
