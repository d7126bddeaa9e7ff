// The choice of two images to compare: points of the curve of a job that have a picture, beside those of it or of another job.

import { get } from "../../shared/api.js";
import { h, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";
import { comparisonOf, WITH } from "../../shared/job_summary.js";
import { slider } from "./slider.js";

/** @import { Source } from "./image_layer.js" */

const NEWEST = "newest";
/** The jobs among which another one is offered. */
const NEWEST_JOBS = 200;

/** One of the two: a job, the pictures that it has, and the choice among them. */
class Side {
  /** @type {Api.Preview[]} */
  previews = [];
  /** @type {Api.JobView | null} */
  job = null;
  select;

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
    const isSame = job.id === this.job?.id && previews.length === this.previews.length && previews.every(({ spp }, at) => spp === this.previews[at].spp);
    const value = (job.id === this.job?.id && this.select.value) || String(isFirst && previews.length ? previews[0].spp : NEWEST);
    this.job = job;
    this.previews = previews;
    if (isSame) {
      setText(this.select.options[this.select.options.length - 1], nameOfNewest(job));
      return;
    }
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
    const name = `${whole(preview.spp)} spp`;
    return [{ name, png: preview.link, version: "" }];
  }
}

export class Comparison {
  #left;
  #right;
  /** @type {HTMLSelectElement} */
  #other;
  #choose;
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
    this.#choose = choose;
    this.#wiped = wipe;
    this.#signal = signal;
    this.#left = new Side(choose);
    this.#right = new Side(choose);
    this.#wipe = slider("Wipe", { min: 0, max: 100, step: 0.5, value: 50 }, wipe);
    this.#other = h("select", { "aria-label": "The other job", onchange: () => this.#turnTo(this.#other.value) }, h("option", { value: "" }, "this job"));
    this.element = h("div", { class: "panel" }, this.#wipe.label,
      label("Left", this.#left.select), label("Right", this.#right.select), h("label", {}, h("span", {}, "of"), this.#other),
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

  /**
   * The images at the left and at the right.
   * @returns {Source[]}
   */
  sides() {
    const sides = [...this.#left.source, ...this.#right.source];
    if (this.#left.job?.id === this.#right.job?.id) return sides;
    return sides.map((side, at) => ({ ...side, name: `${named(at ? this.#right.job : this.#left.job)}, ${side.name}` }));
  }

  /**
   * Fetches the lists of images and of other jobs, and offers them.
   * @param {Api.JobView} job
   * @param {Api.CurvePoint[]} points
   */
  async list(job, points) {
    /** @type {Api.JobPage} */
    const { jobs } = await get(`/v1/jobs?limit=${NEWEST_JOBS}`, this.#signal);
    const wanted = otherAsked();
    /** @type {Api.JobView | null} */
    const asked = wanted && wanted !== job.id ? await get(`/v1/jobs/${encodeURIComponent(wanted)}`, this.#signal).catch(() => null) : null;
    const alike = (/** @type {Api.JobView} */ one) => one.id !== job.id && comparisonOf(job, one);
    const others = [...new Map([...jobs, ...(asked ? [asked] : [])].filter(alike).map((one) => [one.id, one])).values()];
    const other = others.find(({ id }) => id === wanted) ?? null;
    const ids = others.map(({ id }) => id).join();
    if ([...this.#other.options].slice(1).map(({ value }) => value).join() !== ids) {
      this.#other.replaceChildren(h("option", { value: "" }, "this job"), ...others.map((one) => h("option", { value: one.id }, named(one))));
    }
    this.#other.value = other?.id ?? "";
    await Promise.all([this.#left.list(job, this.#signal, !other), this.#right.list(other ?? job, this.#signal, false)]);
    const refused = wanted && !other && wanted !== job.id ? `Job ${wanted} has no image of ${job.width} × ${job.height} pixels to compare. ` : "";
    setText(this.#hint, refused + kept(this.#left.previews, points));
  }

  /**
   * Compares with another job, which the page's address names from now on; "" is this job.
   * @param {string} id
   */
  #turnTo(id) {
    const address = new URL(location.href);
    if (id) address.searchParams.set(WITH, id);
    else address.searchParams.delete(WITH);
    history.replaceState(null, "", address);
    this.#choose();
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
  return { name: nameOfNewest(job), png: job.links.image_png, version: job.finished_at };
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
