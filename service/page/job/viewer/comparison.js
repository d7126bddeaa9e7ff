// The choice of two images to compare: any points of the curve that have a picture.

import { get } from "../../shared/api.js";
import { h, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";
import { READ } from "./exr.js";

/** @import { Source } from "./image_layer.js" */

const NEWEST = "newest";

export class Comparison {
  /** @type {Api.Preview[]} */
  #previews = [];
  /** @type {Api.JobView | null} */
  #job = null;
  #left = h("select");
  #right = h("select");
  #wipe;
  #hint = h("p", { class: "hint" });

  /**
   * @param {() => unknown} choose - called when another image was chosen
   * @param {() => unknown} wipe - called when the wipe was moved
   */
  constructor(choose, wipe) {
    const label = (/** @type {string} */ name, /** @type {Element} */ one) => h("label", {}, h("span", {}, name), one);
    for (const select of [this.#left, this.#right]) select.addEventListener("change", choose);
    this.#wipe = h("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50, oninput: wipe });
    this.element = h("div", { class: "panel" },
      h("label", { class: "slider" }, h("span", {}, "Wipe"), this.#wipe, h("output")),
      label("Left", this.#left), label("Right", this.#right), this.#hint);
  }

  /** The wipe's position, in percent of the image's width. */
  get percent() {
    return Number(this.#wipe.value);
  }

  /** @param {number} share */
  wipeTo(share) {
    this.#wipe.value = String(100 * share);
  }

  /**
   * The images at the left and at the right.
   * @returns {Source[]}
   */
  sides() {
    const job = this.#job;
    if (!job) return [];
    return [this.#left, this.#right].map((select) => {
      const preview = this.#previews.find(({ spp }) => String(spp) === select.value);
      if (!preview) return newestOf(job);
      const name = `${whole(preview.spp)} spp`;
      return { name, png: preview.link, exr: preview.linear, ev: job.spec.view.exposure_ev, version: "" };
    });
  }

  /**
   * Fetches the list of images, and offers them.
   * @param {Api.JobView} job
   * @param {Api.CurvePoint[]} points
   * @param {AbortSignal} signal
   */
  async list(job, points, signal) {
    this.#job = job;
    /** @type {Api.PreviewList} */
    const { previews } = await get(job.links.previews, signal);
    const same = previews.length === this.#previews.length && previews.every(({ spp }, at) => spp === this.#previews[at].spp);
    this.#previews = previews;
    const final = nameOfNewest(job);
    for (const select of [this.#left, this.#right]) {
      if (same && select.options.length) {
        setText(select.options[select.options.length - 1], final);
        continue;
      }
      const value = select.value || String(select === this.#left && previews.length ? previews[0].spp : NEWEST);
      select.replaceChildren(...previews.map(({ spp }) => h("option", { value: spp }, `${whole(spp)} spp`)),
        h("option", { value: NEWEST }, final));
      select.value = value;
      if (select.selectedIndex < 0) select.value = NEWEST;
    }
    setText(this.#hint, kept(previews, points));
  }

  /**
   * A caveat about the exposure of these two; "" if it is exact.
   * @param {Source[]} sides
   */
  static doubt(sides) {
    const rough = sides.filter(({ exr }) => !exr).map(({ name }) => name);
    if (!rough.length) return "";
    return `${rough.join(" and ")}: kept in 8 bits, so white areas stay flat, and dark shades show steps.`;
  }
}

/**
 * The newest image of a job.
 * @param {Api.JobView} job
 * @returns {Source}
 */
export function newestOf(job) {
  return {
    name: nameOfNewest(job),
    png: job.links.image_png, exr: READ.includes(job.spec.exr.compression) ? job.links.image_exr : null,
    background: job.spec.view.background, ev: job.spec.view.exposure_ev, version: job.finished_at,
  };
}

/** @param {Api.JobView} job */
function nameOfNewest(job) {
  return job.finished_at ? "final image" : "newest image";
}

/**
 * @param {Api.Preview[]} previews
 * @param {Api.CurvePoint[]} points
 */
function kept(previews, points) {
  const missing = points.filter(({ spp }) => !previews.some((one) => one.spp === spp)).length;
  if (previews.length && previews[0].linear) return "Every point of the curve, merged from the slices that the job keeps.";
  if (missing <= 1) return "";
  return `The job kept pictures of ${several(previews.length, "point")} out of ${whole(points.length)}; a job that keeps its slices offers them all.`;
}
