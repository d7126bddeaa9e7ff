// The choice of two images to compare: points of the curve of a job that have a picture, beside those of it or of another job.

import { get, isProblem } from "../../shared/api.js";
import { h, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";
import { comparisonOf, WITH } from "../../shared/job_summary.js";
import { slider } from "./controls.js";

/** @typedef {{ name?: string, png: string }} Source  an image, or a map */

const NEWEST = "newest";

/** One of the two: a job, the pictures that it has, and the choice among them. */
class Side {
  /** @type {Api.Preview[]} */
  previews = [];
  /** @type {Api.JobView | null} */
  job = null;
  select;
  #listed = "";

  /** @param {() => unknown} choose */
  constructor(choose) {
    this.select = h("select", { onchange: choose });
  }

  /**
   * Fetches a job's list of pictures, and offers them.
   * @param {Api.JobView} job
   * @param {AbortSignal} signal
   * @param {boolean} isFirst - whether its first picture is chosen at first, rather than the newest
   */
  async list(job, signal, isFirst) {
    /** @type {Api.PreviewList} */
    const { previews } = await get(job.links.previews, signal);
    const listed = JSON.stringify([job.id, job.finished_at, previews]);
    if (listed === this.#listed) return;  // one that is open stays open
    this.#listed = listed;
    const value = this.select.value || String(isFirst && previews.length ? previews[0].spp : NEWEST);
    this.job = job;
    this.previews = previews;
    this.select.replaceChildren(...previews.map(({ spp }) => h("option", { value: spp }, `${whole(spp)} spp`)),
      h("option", { value: NEWEST }, nameOfNewest(job)));
    this.select.value = value;
    if (this.select.selectedIndex < 0) this.select.value = NEWEST;
  }

  /** The chosen image. @returns {Source[]} */
  get source() {
    const { job } = this;
    if (!job) return [];
    const preview = this.previews.find(({ spp }) => String(spp) === this.select.value);
    if (!preview) return [newestOf(job)];
    return [{ name: `${whole(preview.spp)} spp`, png: preview.link }];
  }
}

export class Comparison {
  /** Whether the other job will not change, or there is none. */
  isFinal = false;
  #left;
  #right;
  #wiped;
  #wipe;
  #signal;
  #hint = h("p", { class: "hint" });

  /**
   * @param {() => unknown} choose - called when another image was chosen
   * @param {() => unknown} wipe - called when the wipe was moved
   * @param {AbortSignal} signal
   */
  constructor(choose, wipe, signal) {
    const label = (/** @type {string} */ name, /** @type {Element} */ one) => h("label", {}, h("span", {}, name), one);
    this.#wiped = wipe;
    this.#signal = signal;
    this.#left = new Side(choose);
    this.#right = new Side(choose);
    this.#wipe = slider("Wipe", { min: 0, max: 100, step: 0.5, value: 50 }, wipe);
    this.element = h("div", { class: "panel" }, this.#wipe.label,
      label("Left", this.#left.select), label("Right", this.#right.select),
      h("button", { class: "quiet", title: "F on the image", onclick: () => this.flip() }, "Flip"), this.#hint);
  }

  /** Whether the page's address names another job. */
  static get isAskedFor() {
    return otherAsked() !== "";
  }

  /** The wipe's position, in percent of the image's width. */
  get percent() {
    return Number(this.#wipe.input.value);
  }

  /** @param {number} share */
  wipeTo(share) {
    this.#wipe.input.value = String(100 * share);
    this.#wiped();
  }

  /** Shows all of one image, and then all of the other. */
  flip() {
    this.wipeTo(this.percent > 0 ? 0 : 1);
  }

  /** What is shown of the two, in words. */
  caption() {
    const [left, right] = this.sides().map(({ name }) => name);
    if (!right) return "";
    return [`${right} alone`, `${left} alone`][[0, 100].indexOf(this.percent)] ?? `${left} at the left, ${right} at the right: drag across the image`;
  }

  /** The images at the left and at the right. @returns {Source[]} */
  sides() {
    const sides = [...this.#left.source, ...this.#right.source];
    if (this.#left.job?.id === this.#right.job?.id) return sides;
    return sides.map((side, at) => ({ ...side, name: `${named(at ? this.#right.job : this.#left.job)}, ${side.name}` }));
  }

  /**
   * Fetches the lists of the images, of this job and of the other one if the page's address names one.
   * @param {Api.JobView} job
   * @param {Api.CurvePoint[]} points
   */
  async list(job, points) {
    const wanted = otherAsked();
    /** @type {Api.JobView | null} */
    const found = wanted ? await get(`/v1/jobs/${encodeURIComponent(wanted)}`, this.#signal).catch((error) => {
      if (!isProblem(error, "unknown-job")) throw error;
      return null;
    }) : null;
    const other = found && comparisonOf(job, found) ? found : null;
    await Promise.all([this.#left.list(job, this.#signal, !other), this.#right.list(other ?? job, this.#signal, false)]);
    const refused = wanted && !other ? `Job ${wanted} has no image of ${job.width} × ${job.height} pixels to compare. ` : "";
    setText(this.#hint, refused + kept(this.#left.previews, points));
    this.isFinal = !found || Boolean(found.finished_at);
  }
}

/** The other job that the page's address names; "" if it names none. */
function otherAsked() {
  return new URLSearchParams(location.search).get(WITH) ?? "";
}

/** @param {Api.JobView | null} job */
function named(job) {
  return job ? `${job.name} ${job.id.slice(0, 6)}` : "";
}

/**
 * The newest image of a job.
 * @param {Api.JobView} job
 * @returns {Source}
 */
export function newestOf(job) {
  return { name: nameOfNewest(job), png: job.links.image_png };
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
  if (missing <= 1) return "";
  return `The job kept pictures of ${several(previews.length, "point")} out of ${whole(points.length)}.`;
}
