// The judgement by zones, as a map over the image.

import { setText, svg } from "../../shared/dom.js";
import { percent } from "../../shared/figures.js";
import { imagePixels, ruleWith } from "../../shared/job_summary.js";
import { fieldIn, RULES, valueIn } from "../../shared/rules.js";

const BLOCK = 16;
const STRONGEST = 0.75;
/** @typedef {"estimate_fraction" | "visible_fraction"} Measure */
/** @type {Record<Measure, string>} */
const WORDS = {
  estimate_fraction: "noise left in each zone; the colour says how it compares with the target of the whole image",
  visible_fraction: "share of each zone's pixels that have changed since the first image",
};

export class ZoneMap {
  /** @type {Measure} */
  #measure = "estimate_fraction";
  /** @type {Api.JobView | null} */
  #job = null;
  /** @type {Api.CurvePoint | undefined} */
  #point;
  element = svg("svg", { class: "layer zones", role: "img", hidden: true });

  /**
   * @param {Api.JobView} job
   * @param {Api.CurvePoint | undefined} point
   */
  show(job, point) {
    this.#job = job;
    this.#point = point;
    this.#draw();
  }

  /**
   * Shows the other measure of a point's zones.
   * @param {Measure} name
   */
  measure(name) {
    this.#measure = name;
    this.#draw();
  }

  caption() {
    return this.#point?.zones?.[this.#measure] ? WORDS[this.#measure] : "no zone has been judged yet";
  }

  /**
   * The opacity of a zone, by its fraction and its number of pixels.
   *
   * Noise is relative to what the target allows the whole image: the colour starts at a tenth of that
   * and is full at ten times it. So the map fades as the image converges, which a map scaled by its own
   * maximum would not.
   * @param {Api.JobView} job
   * @param {number} fraction
   * @param {number} pixels
   */
  #strength(job, fraction, pixels) {
    if (this.#measure === "visible_fraction") return STRONGEST * Math.sqrt(fraction);
    const rule = ruleWith("noise_target", job);
    // A job without such a rule is compared with the default rule's target.
    const usual = RULES.find((one) => one.default);
    const target = rule ? valueIn("noise_target", rule) : usual && fieldIn("noise_target", usual)?.value;
    const decades = Math.log10((fraction * pixels) / ((target ?? 0) * imagePixels(job)));
    return STRONGEST * Math.min(1, Math.max(0, (decades + 1) / 2));
  }

  #draw() {
    const job = this.#job;
    const fractions = this.#point?.zones?.[this.#measure];
    this.element.replaceChildren();
    if (!fractions || !job?.width || !job.height) return;
    const { width, height } = job;
    this.element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.element.setAttribute("preserveAspectRatio", "none");
    const [rows, columns] = [edges(height, fractions.length), edges(width, fractions[0].length)];
    const size = Math.min(height / fractions.length / 4, width / fractions[0].length / 5.5);
    const title = svg("title");
    setText(title, `Zones from the top: ${fractions.map((row) => row.map(percent).join(", ")).join("; ")}`);
    this.element.append(title);
    fractions.forEach((row, r) => row.forEach((fraction, c) => {
      const [x, y] = [columns[c], rows[r]];
      const [w, hgt] = [columns[c + 1] - x, rows[r + 1] - y];
      this.element.append(
        svg("rect", { x, y, width: w, height: hgt, "fill-opacity": this.#strength(job, fraction, w * hgt).toFixed(3) }),
        svg("text", { x: x + w / 2, y: y + hgt / 2, "font-size": size, "stroke-width": size / 6, "aria-hidden": "true" },
          percent(fraction)));
    }));
  }
}

/**
 * The edges of the zones along one axis, in pixels; the same as metric.zone_edges.
 * @param {number} size
 * @param {number} zones
 */
function edges(size, zones) {
  const blocks = Math.ceil(size / BLOCK);
  const starts = Array.from({ length: zones }, (_, zone) => Math.floor((blocks * zone) / zones) * BLOCK);
  return [...starts, size];
}
