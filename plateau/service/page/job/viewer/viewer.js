// A job's image: the newest one, at any exposure, compared with others, and with its maps.

import { isAbort, isProblem } from "../../shared/api.js";
import { h, setAttribute, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";
import { isByQuality, zoneSize } from "../../shared/job_summary.js";
import { messageOf } from "../../shared/notices.js";
import { Picture } from "../../shared/picture.js";
import { PLACES } from "../../shared/spec_fields.js";
import { Comparison, newestOf } from "./comparison.js";
import { ScaleBar, slider } from "./controls.js";
import { Exposure } from "./exposure.js";
import { Stage } from "./zoom_pan.js";

/** @import { Source } from "./comparison.js" */

/**
 * A map over the image: its name, the link, and whether a job has it.
 * @typedef {object} MapAbout
 * @property {string} text
 * @property {string} link
 * @property {(job: Api.JobView) => unknown} of
 * @property {(job: Api.JobView) => unknown} [offered] - whether it is offered for a job; else always
 * @property {string} hint - what its colours mean
 * @property {(job: Api.JobView) => string} words - for the caption
 */

const hasNoise = (/** @type {Api.JobView} */ job) => job.estimate_fraction != null;

/** @type {Record<string, MapAbout>} */
const MAPS = {
  difference: {
    text: "Difference", link: "difference_png", of: (job) => job.points,
    hint: "Orange: changed since the first image, as a person sees it.", words: () => "on the image in dim grey",
  },
  noise: {
    text: "Noise", link: "noise_png", of: hasNoise,
    hint: "Orange: noise that a person could still see; darker, where that is as likely as not.",
    words: (job) => (hasNoise(job) ? "on the image in dim grey" : "known from the second slice on"),
  },
  quality: {
    text: "Quality", link: "quality_png", offered: isByQuality, of: (job) => isByQuality(job) && hasNoise(job),
    hint: "What a person would see of the noise, by ColorVideoVDP. 1 JOD: three of four people prefer the converged image.",
    words: (job) => (hasNoise(job) ? "where a person would see the noise" : "known from the second slice on"),
  },
  samples: {
    text: "Samples", link: "spp_png", offered: zoneSize, of: (job) => job.image_spp,
    hint: "Equal steps of colour are equal ratios.", words: (job) => `zones of ${zoneSize(job)} × ${zoneSize(job)} pixels`,
  },
  broken: {
    text: "Broken", link: "non_finite_png", offered: (job) => job.non_finite_pixels, of: (job) => job.non_finite_pixels,
    hint: "Magenta: NaN. Blue: infinite. No sample repairs such a pixel; look for its emitter, texture or material.",
    words: (job) => `${several(job.non_finite_pixels ?? 0, "pixel")} of the last judged image`,
  },
};

export class Viewer {
  #signal;
  /** @type {Api.JobView | null} */
  #job = null;
  /** @type {Api.CurvePoint[]} */
  #points = [];
  /** "image", "compare", or a map. */
  #mode = "image";
  #lower = layer();
  #upper = layer();
  #stage = new Stage([this.#lower.element, this.#upper.element], {
    wipe: (share) => this.#mode === "compare" && this.#compare.wipeTo(share),
    flip: () => this.#mode === "compare" && this.#compare.flip(),
    sized: (shown) => { this.#shown = shown; this.#warn(); },
  });
  /** The mode whose picture is in the upper layer. */
  #aboveOf = "";
  #listed = "";
  #busy = false;
  #nothing = h("p", { class: "nothing-yet" });
  #caption = h("p", { class: "caption" });
  #larger = h("span");
  #judgedSo = h("code");
  /** Pixels of the display across a pixel of the image. */
  #shown = 0;
  #compare;
  #exposure = new Exposure(() => { this.#layers(); this.#words(); });
  #overlay = slider("Overlay", { min: 0, max: 100, step: 1, value: 100 }, () => this.#layers());
  /** @type {Record<string, ScaleBar>} */
  #scales = { quality: new ScaleBar(["nothing", "1.5 JOD", "3 JOD and more"]), samples: new ScaleBar([]) };
  #map = h("div", { class: "panel" });
  #modes;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#signal = signal;
    this.#compare = new Comparison(() => { this.#listed = ""; this.#choose(); }, () => { this.#layers(); this.#words(); }, signal);
    const names = { image: "Image", compare: "Compare", ...Object.fromEntries(Object.entries(MAPS).map(([mode, { text }]) => [mode, text])) };
    this.#modes = new Map(Object.entries(names).map(([mode, text]) =>
      [mode, h("button", { hidden: Boolean(MAPS[mode]?.offered), onclick: () => this.#turn(mode) }, text)]));
    this.#stage.element.hidden = true;
    this.element = h("section", { class: "viewer", "aria-labelledby": "image-title" },
      h("div", { class: "viewer-head" }, h("h2", { id: "image-title" }, "Image"),
        h("div", { class: "modes", role: "group", "aria-label": "What is shown" }, [...this.#modes.values()])),
      this.#nothing, this.#stage.element, this.#caption,
      h("p", { class: "hint larger", role: "status" }, this.#larger, " ", this.#judgedSo), this.#compare.element, this.#map, this.#exposure.element);
    this.#turn(Comparison.isAskedFor ? "compare" : "image");
    signal.addEventListener("abort", () => {
      for (const { picture } of [this.#lower, this.#upper]) picture.letGo();
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
    const [least, most] = [job.spp_min ?? job.spp, job.spp_max ?? job.spp];
    this.#scales.samples.show([`${whole(least)} spp`, whole(Math.sqrt(least * most)), `${whole(most)} spp`]);
    for (const [mode, { offered }] of Object.entries(MAPS)) this.#modes.get(mode)?.toggleAttribute("hidden", Boolean(offered && !offered(job)));
    const isShown = Boolean(job.image_spp && job.spec.pictures);
    this.element.toggleAttribute("data-empty", !isShown);
    if (!isShown) {
      setText(this.#nothing, job.finished_at && !job.image_spp ? "The job ended without an image."
        : job.spec.pictures ? "Its first image comes with its first samples."
          : "The job makes no pictures; at its end, image.exr has its image.");
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
    if (this.#mode === "compare" && (stamp !== this.#listed || !this.#compare.isFinal)) {
      await this.#compare.list(job, this.#points);
      this.#listed = stamp;
    }
    const mode = this.#mode;
    const [base, over] = this.#sources(job);
    await Promise.all([
      this.#lower.picture.show(base.png, this.#signal),
      over && this.#upper.picture.show(over.png, this.#signal),
    ]);
    if (over) this.#aboveOf = mode;
    this.#nothing.hidden = true;
    this.#stage.element.hidden = false;
    this.#stage.fit(this.#lower.image.naturalWidth, this.#lower.image.naturalHeight);
    this.#lower.image.alt = `The image of ${job.name} at ${whole(this.#lower.picture.spp ?? job.spp)} spp`;
    this.#upper.image.alt = mode === "compare" && over?.name ? `${over.name}, at the right` : "";
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
    return map?.of(job) ? [newest, { png: job.links[map.link] }] : [newest];
  }

  /** @param {string} mode */
  #turn(mode) {
    this.#mode = mode;
    const map = MAPS[mode];
    for (const [name, button] of this.#modes) setAttribute(button, "aria-pressed", String(name === mode));
    this.#compare.element.hidden = mode !== "compare";
    this.#exposure.element.hidden = Boolean(map);
    this.#map.hidden = !map;
    if (map) this.#map.replaceChildren(this.#overlay.label, this.#scales[mode]?.element ?? "", h("span", { class: "hint" }, map.hint));
    this.#layers();
    this.#words();
    this.#choose();
  }

  /** Shows what was just chosen, even while a fetch for the previous choice is under way. */
  async #choose() {
    if (!this.#job?.image_spp || !this.#job.spec.pictures) return;
    try {
      await this.#look(this.#job);
    } catch (error) {
      if (!isAbort(error)) setText(this.#caption, messageOf(error));
    }
  }

  // Layers.

  #layers() {
    const [mode, above] = [this.#mode, this.#upper.element];
    above.hidden = mode !== this.#aboveOf;
    above.style.opacity = MAPS[mode] ? `${this.#overlay.input.value}%` : "1";
    setText(this.#overlay.output, `${this.#overlay.input.value} %`);
    for (const { image } of [this.#lower, this.#upper]) image.style.filter = MAPS[mode] ? "none" : this.#exposure.filter;
    this.#stage.wipe(mode === "compare" ? this.#compare.percent : null, above);
  }

  /** Says if the image is shown larger than it is judged, on a desk, and how to have it judged so. */
  #warn() {
    const { id, seen = "", seen_density: judged } = this.#job ?? {};
    const here = (PLACES.desk?.pixels_per_degree ?? Infinity) / this.#shown;
    const isLarger = this.#shown > 0 && judged != null && here * LARGER < judged;
    setText(this.#larger, isLarger
      ? `Shown larger than it is judged (${seen}), so more noise may be seen. What it needs at this size, on a desk:` : "");
    setText(this.#judgedSo, isLarger ? `plateau again ${id} --pixels-per-degree ${Number(here.toPrecision(2))}` : "");
  }

  #words() {
    const [job, mode] = [this.#job, this.#mode];
    if (!job) return;
    const exposed = this.#exposure.filter === "none" ? "as its display shows it" : "at another exposure";
    const said = mode === "compare" ? this.#compare.caption() : MAPS[mode]?.words(job) ?? exposed;
    const spp = this.#lower.picture.spp && mode !== "compare" ? `${whole(this.#lower.picture.spp)} spp` : "";
    this.#warn();
    setText(this.#caption, [job.width ? `${job.width} × ${job.height}` : "", spp, said].filter(Boolean).join(" · "));
  }
}

/** A little larger than judged is not worth a word: a desk at 200 % has 19 pixels in a degree, and not 20. */
const LARGER = 1.1;

/** One of the two pictures. */
function layer() {
  const image = h("img", { alt: "", class: "layer", draggable: "false" });
  return { image, picture: new Picture(image), element: h("div", { class: "side" }, image) };
}
