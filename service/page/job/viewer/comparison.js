// Which two images of a job's way are compared: any two points of its curve that have one.

import { get } from "../../shared/api.js";
import { h, setText } from "../../shared/dom.js";
import { several, whole } from "../../shared/figures.js";

const NEWEST = "newest";

export class Comparison {
  #previews = [];
  #job = null;
  #left;
  #right;
  #wipe;
  #hint = h("p", { class: "hint" });
  element;

  /** `choose()` is called when another image was chosen, `wipe()` when the wipe was moved. */
  constructor(choose, wipe) {
    const select = () => h("select", { onchange: choose });
    const label = (name, one) => h("label", {}, h("span", {}, name), one);
    [this.#left, this.#right] = [select(), select()];
    this.#wipe = h("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50, oninput: wipe });
    this.element = h("div", { class: "panel" },
      h("label", { class: "slider" }, h("span", {}, "Wipe"), this.#wipe, h("output")),
      label("Left", this.#left), label("Right", this.#right), this.#hint);
  }

  /** Where the wipe is, in percent of the image's width. */
  get percent() {
    return Number(this.#wipe.value);
  }

  wipeTo(share) {
    this.#wipe.value = 100 * share;
  }

  /** What lies at the left and at the right, as sources of a `Side`, with their names. */
  sides() {
    if (!this.#job) return [];
    return [this.#left, this.#right].map((select) => this.#source(select));
  }

  #source(select) {
    const preview = this.#previews.find(({ spp }) => String(spp) === select.value);
    if (!preview) return newestOf(this.#job);
    return {
      name: `${whole(preview.spp)} spp`, png: preview.link, exr: preview.linear,
      ev: this.#job.spec.view.exposure_ev, version: "",
    };
  }

  /** Asks which images there are, and offers them. */
  async list(job, points, signal) {
    this.#job = job;
    const { previews } = await get(job.links.previews, signal);
    const same = previews.length === this.#previews.length && previews.every(({ spp }, at) => spp === this.#previews[at].spp);
    this.#previews = previews;
    const final = newestOf(job).name;
    for (const [select, start] of [[this.#left, previews[0]?.spp], [this.#right, NEWEST]]) {
      if (same && select.options.length) {
        setText(select.options[select.options.length - 1], final);
        continue;
      }
      const value = select.value || String(start ?? NEWEST);
      select.replaceChildren(...previews.map(({ spp }) => h("option", { value: spp }, `${whole(spp)} spp`)),
        h("option", { value: NEWEST }, final));
      select.value = value;
      if (select.selectedIndex < 0) select.value = NEWEST;
    }
    setText(this.#hint, kept(previews, points));
  }

  /** What has to be known of the exposure of these two; "" where it is exact. */
  static doubt(sides) {
    const rough = sides.filter(({ exr }) => !exr).map(({ name }) => name);
    if (!rough.length) return "";
    return `${rough.join(" and ")}: kept in 8 bits, so what was white stays flat, and dark shades show steps.`;
  }
}

/** The newest image of a job as a source of a `Side`. */
export function newestOf(job) {
  return {
    name: job.finished_at ? "final image" : "newest image",
    png: job.links.image_png, exr: job.links.image_exr,
    ev: job.spec.view.exposure_ev, version: job.finished_at,
  };
}

function kept(previews, points) {
  const missing = points.filter(({ spp }) => !previews.some((one) => one.spp === spp)).length;
  if (previews.length && previews[0].linear) return "Every point of the curve, merged from the slices that the job keeps.";
  if (missing <= 1) return "";
  return `The job kept pictures of ${several(previews.length, "point")} out of ${whole(points.length)}; a job that keeps its slices offers them all.`;
}
