// What each plot of a curve shows: its title, series and data, and the marks on it.

import { h, setText } from "../../shared/dom.js";
import { three } from "../../shared/figures.js";
import { imagePixels, ruleWith, rulesOf, stopSlope } from "../../shared/job_summary.js";
import { ruleNamed, valueIn } from "../../shared/rules.js";
import { around, decades, fromZero } from "./axes.js";
import { drawLevel, drawStops, stopsOf } from "./marks.js";

/** @import uPlot from "../../vendor/uPlot.d.ts" */
/** @import { Theme } from "./axes.js" */
/** @typedef {Api.CurvePoint[]} Points */
/** @typedef {(plot: uPlot, min: number | null, max: number | null) => [number, number]} Range */

/** One plot, without the canvas. */
class Panel {
  box = h("div", { class: "plot" });
  title = h("p", { class: "plot-title" });

  /** @param {boolean} logarithmic - of its values' axis */
  constructor(logarithmic) {
    this.logarithmic = logarithmic;
  }

  /** @returns {uPlot.Band[]} */
  bands(/** @type {Theme} */ _theme) {
    return [];
  }

  /** The value at which the job's rule stops it. @returns {number | null} */
  target(/** @type {Api.JobView} */ _job) {
    return null;
  }

  /** @param {uPlot} plot @param {Api.JobView} job @param {Points} points @param {Theme} theme @param {boolean} named */
  draw(plot, job, points, theme, named) {
    drawStops(plot, stopsOf(job, points), theme, named);
    drawLevel(plot, this.target(job), theme);
  }

  /**
   * The values, without those that a logarithmic axis cannot show.
   * @param {Points} points
   * @param {(point: Api.CurvePoint) => number | null | undefined} of
   */
  column(points, of) {
    return points.map((point) => {
      const value = of(point);
      return value == null || (this.logarithmic && value <= 0) ? null : value;
    });
  }
}

/** The pixels that have changed since the first image, and the slope of the last window. */
export class ChangedPanel extends Panel {
  #slope = h("span");

  constructor() {
    super(false);
    this.title.append(h("b", {}, "Changed since the first image"), ": pixels that differ visibly from it", this.#slope);
  }

  /** @param {Theme} theme @returns {uPlot.Series[]} */
  series(theme) {
    return [line(theme.curve), { stroke: theme.stop, width: 1.5, points: { show: false } },
      { stroke: theme.stop, width: 1.5, dash: [5, 4], points: { show: false } }];
  }

  /** @param {Api.JobView} job @param {Points} points */
  data(job, points) {
    const { rule } = job.spec;
    const window = points.slice(-(valueIn("window", rule) ?? 5));
    const slope = valueIn("slope", rule) == null ? null : points[points.length - 1].slope;
    const mean = (/** @type {(point: Api.CurvePoint) => number} */ of) => window.reduce((sum, point) => sum + of(point), 0) / window.length;
    const [spp, visible] = [mean((point) => point.spp), mean((point) => point.visible_pixels)];
    const laid = (/** @type {number | null} */ steepness) => points.map((point) =>
      steepness != null && window.includes(point) ? visible + steepness * (point.spp - spp) : null);
    return [this.column(points, (point) => point.visible_pixels), laid(slope),
      laid(slope == null ? null : stopSlope(job, rule))];
  }

  /** @returns {Range} */
  range(/** @type {Api.JobView} */ _job) {
    return fromZero;
  }

  /** @param {Api.JobView} job @param {Points} points */
  words(job, points) {
    const { slope } = points[points.length - 1];
    const rule = ruleWith("slope", job);
    const limit = rule ? stopSlope(job, rule) : null;
    const aim = rule && limit !== null ? `; ${rule.name} waits for ${three(limit)}` : "";
    setText(this.#slope, slope == null ? "" : `, rising by ${three(slope)} px/spp${aim}`);
  }
}

/** The noise left, its band, and the target. */
export class NoiseLeftPanel extends Panel {
  #undenoised = h("span", { hidden: true }, "; dashed: without denoising");

  constructor() {
    super(true);
    this.title.append(h("b", {}, "Noise left"), ": pixels that more samples would still change visibly, by half buffers", this.#undenoised);
  }

  /** @param {Theme} theme @returns {uPlot.Series[]} */
  series(theme) {
    const edge = { stroke: "transparent", points: { show: false } };
    return [line(theme.estimate), edge, edge, { stroke: theme.estimate, width: 1.5, dash: [5, 4], points: { show: false } }];
  }

  /** @override @param {Theme} theme @returns {uPlot.Band[]} */
  bands(theme) {
    return [{ series: [3, 2], fill: theme.band }];
  }

  /** @param {Api.JobView} _job @param {Points} points */
  data(_job, points) {
    return [this.column(points, (point) => point.estimate_pixels), this.column(points, (point) => point.estimate_low_pixels),
      this.column(points, (point) => point.estimate_high_pixels), this.column(points, (point) => point.raw_estimate_pixels)];
  }

  /** @override @param {Api.JobView} job */
  target(job) {
    const rule = ruleWith("noise_target", job);
    const target = rule ? valueIn("noise_target", rule) : null;
    return target === null ? null : target * imagePixels(job);
  }

  /** @param {Api.JobView} job @returns {Range} */
  range(job) {
    return decades(this.target(job), 0.1);
  }

  /** @param {Api.JobView} job */
  words(job) {
    this.#undenoised.hidden = job.spec.denoise.name === "none";
  }
}

/** The values of a rule that has a quantity of its own, such as a quality in JOD. */
export class ValuePanel extends Panel {
  #rule;

  /** @param {Api.JobSpec["rule"]} rule */
  constructor(rule) {
    super(ruleNamed(rule.name)?.is_error ?? false);
    this.#rule = rule;
    const { quantity = "", unit = "" } = ruleNamed(rule.name) ?? {};
    this.title.append(h("b", {}, `${quantity.charAt(0).toUpperCase()}${quantity.slice(1)}`),
      ` ${unit.startsWith("of ") ? "" : "in "}${unit}, by the rule ${rule.name}`);
  }

  /** @param {Theme} theme @returns {uPlot.Series[]} */
  series(theme) {
    return [line(theme.curve)];
  }

  /** @param {Api.JobView} _job @param {Points} points */
  data(_job, points) {
    return [this.column(points, (point) => point.rules[this.#rule.name]?.value)];
  }

  /** @override */
  target(/** @type {Api.JobView} */ _job) {
    return valueIn("value_target", this.#rule);
  }

  /** @param {Api.JobView} job @returns {Range} */
  range(job) {
    return (this.logarithmic ? decades : around)(this.target(job));
  }

  words() {} // its title says all
}

/**
 * The rules of a job that have a quantity of their own.
 * @param {Api.JobView} job
 */
export function rulesWithValues(job) {
  return rulesOf(job).filter(({ name }) => ruleNamed(name)?.quantity);
}

/**
 * @param {string} stroke
 * @returns {uPlot.Series}
 */
function line(stroke) {
  return { stroke, width: 2, points: { show: true, size: 6, fill: stroke } };
}
