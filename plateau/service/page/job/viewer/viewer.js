// A job's image: the newest one, at any exposure, compared with others, and with its maps.

import { isAbort, isProblem } from "../../shared/api.js";
import { h, setAttribute, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";
import { isByQuality, zoneSize } from "../../shared/job_summary.js";
import { messageOf } from "../../shared/notices.js";
import { Comparison, newestOf } from "./comparison.js";
import { Exposure } from "./exposure.js";
import { ImageLayer } from "./image_layer.js";
import { qualityPanel, SamplesScale } from "./scales.js";
import { slider } from "./slider.js";
import { Stage } from "./zoom_pan.js";

/** @import { Source } from "./image_layer.js" */

/** A fetch that takes longer is announced. */
const SOON_MS = 400;
/** @typedef {"image" | "compare" | "difference" | "noise" | "quality" | "samples" | "broken"} Mode */
/** @type {[Mode, string][]} */
const MODES = [
  ["image", "Image"],
  ["compare", "Compare"],
  ["difference", "Difference"],
  ["noise", "Noise"],
  ["quality", "Quality"],
  ["samples", "Samples"],
  ["broken", "Broken"],
];

/** @type {Mode[]} */
const ALWAYS = ["image", "compare", "difference", "noise"];

/**
 * Maps over the image, by mode: the link, and whether a job has the map.
 * @type {Partial<Record<Mode, { link: string, of: (job: Api.JobView) => unknown }>>}
 */
const MAPS = {
  difference: { link: "difference_png", of: (job) => job.points },
  noise: { link: "noise_png", of: (job) => job.estimate_fraction != null },
  quality: { link: "quality_png", of: (job) => isByQuality(job) && job.estimate_fraction != null },
  samples: { link: "spp_png", of: (job) => job.image_spp },
  broken: { link: "non_finite_png", of: (job) => job.non_finite_pixels },
};

export class Viewer {
  #signal;
  /** @type {Api.JobView | null} */
  #job = null;
  /** @type {Api.CurvePoint[]} */
  #points = [];
  /** @type {Mode} */
  #mode = "image";
  #lower = new ImageLayer();
  #upper = new ImageLayer();
  #scale = new SamplesScale();
  #stage = new Stage([this.#lower.element, this.#upper.element], {
    wipe: (share) => this.#mode === "compare" && this.#compare.wipeTo(share),
    flip: () => this.#mode === "compare" && this.#compare.flip(),
  });
  /**
   * The mode whose picture is in the upper layer; null before there is one.
   * @type {Mode | null}
   */
  #aboveOf = null;
  #listed = "";
  #busy = false;
  #asked = 0;
  #nothing = h("p", { class: "nothing-yet" });
  #caption = h("p", { class: "caption" });
  #compare;
  #exposure = new Exposure(() => { this.#layers(); this.#words(); });
  #overlay = slider("Overlay", { min: 0, max: 100, step: 1, value: 100 }, () => this.#layers());
  #panels;
  #modes;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#signal = signal;
    this.#compare = new Comparison(() => { this.#listed = ""; this.#choose(); }, () => { this.#layers(); this.#words(); }, signal);
    /** @type {Partial<Record<Mode, HTMLElement>>} */
    this.#panels = {
      compare: this.#compare.element,
      difference: h("div", { class: "panel" },
        h("span", { class: "hint" }, "Orange: changed since the first image, as a person sees it.")),
      noise: h("div", { class: "panel" },
        h("span", { class: "hint" }, "Orange: noise that a person could still see; darker, where that is as likely as not.")),
      quality: qualityPanel(),
      samples: this.#scale.element,
      broken: h("div", { class: "panel" },
        h("span", { class: "hint" }, "Magenta: NaN. Blue: infinite. No sample repairs such a pixel; look for its emitter, texture or material.")),
    };
    this.#modes = new Map(MODES.map(([mode, text]) =>
      [mode, h("button", { "data-mode": mode, hidden: !ALWAYS.includes(mode), onclick: () => this.#turn(mode) }, text)]));
    const modes = h("div", { class: "modes", role: "group", "aria-label": "What is shown" }, [...this.#modes.values()]);
    this.#stage.element.hidden = true;
    this.element = h("section", { class: "viewer", "aria-labelledby": "image-title" },
      h("div", { class: "viewer-head" }, h("h2", { id: "image-title" }, "Image"), modes),
      this.#nothing, this.#stage.element, this.#caption,
      ...Object.values(this.#panels), this.#exposure.element);
    this.#turn(Comparison.isAskedFor ? "compare" : "image");
    signal.addEventListener("abort", () => {
      this.#lower.letGo();
      this.#upper.letGo();
    });
  }

  /**
   * Shows the job's newest image and point; a call does nothing while another is under way.
   * @param {Api.JobView} job
   * @param {Api.CurvePoint[]} points
   */
  async show(job, points) {
    this.#job = job;
    this.#points = points;
    this.#modes.get("broken")?.toggleAttribute("hidden", !job.non_finite_pixels);
    this.#modes.get("quality")?.toggleAttribute("hidden", !isByQuality(job));
    this.#modes.get("samples")?.toggleAttribute("hidden", !zoneSize(job));
    if (!job.image_spp) {
      setText(this.#nothing, job.finished_at ? "The job ended without an image." : "Its first image comes with its first samples.");
      return;
    }
    if (this.#busy) return;
    this.#busy = true;
    try {
      await this.#look(job);
    } catch (error) {
      if (isAbort(error)) return;
      if (!isProblem(error, "no-image-yet")) throw error;
      if (job.finished_at) setText(this.#nothing, messageOf(error));
    } finally {
      this.#busy = false;
    }
  }

  /**
   * Fetches and shows what the chosen mode needs.
   * @param {Api.JobView} job
   */
  async #look(job) {
    const stamp = `${job.points} ${job.finished_at ?? ""}`;
    if (this.#mode === "compare" && stamp !== this.#listed) {
      await this.#compare.list(job, this.#points);
      this.#listed = stamp;
    }
    const mode = this.#mode;
    const [base, over] = this.#sources(job);
    await Promise.all([
      this.#lower.show(base, this.#signal),
      over && this.#upper.show(over, this.#signal),
    ]);
    if (over) this.#aboveOf = mode;
    if (mode === "samples" && this.#upper.file) await this.#scale.show(this.#upper.file);
    this.#nothing.hidden = true;
    this.#stage.element.hidden = false;
    this.#stage.fit(this.#lower.size.width, this.#lower.size.height);
    this.#lower.describe(`The image of ${job.name} at ${whole(this.#lower.spp ?? job.spp)} spp`);
    this.#upper.describe(this.#mode === "compare" ? `The same at ${whole(this.#upper.spp ?? job.spp)} spp, at the right` : "");
    this.#layers();
    this.#words();
  }

  /**
   * The source of the lower layer, and of the upper one if it has any.
   * @param {Api.JobView} job
   * @returns {Source[]}
   */
  #sources(job) {
    if (this.#mode === "compare") return this.#compare.sides();
    const newest = newestOf(job);
    const map = MAPS[this.#mode];
    return map?.of(job) ? [newest, { png: job.links[map.link], version: newest.version }] : [newest];
  }

  /** @param {Mode} mode */
  #turn(mode) {
    this.#mode = mode;
    for (const [name, button] of this.#modes) setAttribute(button, "aria-pressed", String(name === mode));
    for (const [name, panel] of Object.entries(this.#panels)) panel.hidden = name !== mode;
    this.#exposure.element.hidden = !isOfLight(mode);
    if (isOverlaid(mode)) this.#panels[mode]?.prepend(this.#overlay.label);
    this.#layers();
    this.#words();
    this.#choose();
  }

  /** Shows what was just chosen, even while a fetch for the previous choice is under way. */
  async #choose() {
    const job = this.#job;
    if (!job?.image_spp) return;
    const asked = (this.#asked += 1);
    const patience = setTimeout(() => {
      const names = this.#sources(job).map(({ name }) => name).filter(Boolean);
      setText(this.#caption, `Getting ${names.join(" and ")} …`);
    }, SOON_MS);
    try {
      await this.#look(job);
    } catch (error) {
      if (!isAbort(error)) setText(this.#caption, messageOf(error));
    } finally {
      clearTimeout(patience);
      if (asked === this.#asked && this.#caption.textContent?.endsWith("…")) this.#words();
    }
  }

  // Layers.

  #layers() {
    const [mode, above] = [this.#mode, this.#upper.element];
    above.hidden = mode !== this.#aboveOf;
    above.style.opacity = isOverlaid(mode) ? `${this.#overlay.input.value}%` : "1";
    setText(this.#overlay.output, `${this.#overlay.input.value} %`);
    for (const layer of [this.#lower, this.#upper]) layer.filter(isOfLight(mode) ? this.#exposure.filter : "none");
    this.#stage.wipe(mode === "compare" ? this.#compare.percent : null, above);
  }

  #words() {
    const job = this.#job;
    if (!job) return;
    const size = job.width ? `${job.width} × ${job.height}` : "";
    const spp = this.#lower.spp && this.#mode !== "compare" ? `${whole(this.#lower.spp)} spp` : "";
    const said = {
      image: this.#exposure.filter === "none" ? "as its display shows it" : "at another exposure",
      compare: this.#compare.caption(),
      difference: "on the image in dim grey",
      noise: job.estimate_fraction == null ? "known from the second slice on" : "on the image in dim grey",
      quality: job.estimate_fraction == null ? "known from the second slice on" : "where a person would see the noise",
      samples: `zones of ${zoneSize(job)} × ${zoneSize(job)} pixels`,
      broken: `${several(job.non_finite_pixels ?? 0, "pixel")} of the last judged image`,
    };
    setText(this.#caption, [size, spp, said[this.#mode]].filter(Boolean).join(" · "));
  }
}

/**
 * Whether a map covers the image, unless it is made transparent.
 * @param {Mode} mode
 */
function isOverlaid(mode) {
  return mode === "difference" || mode === "noise" || mode === "quality" || mode === "samples";
}

/**
 * Whether a mode shows images, rather than a map.
 * @param {Mode} mode
 */
function isOfLight(mode) {
  return mode === "image" || mode === "compare";
}
