// A job's convergence: what has changed since the first image, and the noise left.

import { h, setText, signButton } from "../../shared/dom.js";
import { three, whole } from "../../shared/figures.js";
import { imagePixels, ruleWith, stopSlope } from "../../shared/job_summary.js";
import { say } from "../../shared/notices.js";
import { valueIn } from "../../shared/rules.js";
import { colours, compact, decades, fromZero } from "./axes.js";
import { drawForecast, drawLevel, drawStops, forecastOf, stopsOf } from "./marks.js";
import { PointTable, told } from "./point_table.js";
// @ts-types="../../vendor/uPlot.d.ts"
import uPlot from "../../vendor/uPlot.esm.js";

/** @import { Theme } from "./axes.js" */

const HEIGHT_ABOVE = 250;
const HEIGHT_BELOW = 200;
const AXIS_PX = 58;

export class CurveChart {
  // `show` sets it before anything else reads it.
  #job = /** @type {Api.JobView} */ (/** @type {unknown} */ (null));
  /** @type {Api.CurvePoint[]} */
  #points = [];
  /** @type {uPlot[]} */
  #plots = [];
  /** @type {{ min: number, max: number } | null} */
  #zoom = null;
  /** @type {number | null} */
  #at = null;
  #above = h("div", { class: "plot" });
  #below = h("div", { class: "plot" });
  #readout = h("p", { class: "readout" });
  #slope = h("span", { class: "slope" });
  #undenoised = h("span", { class: "slope", hidden: true }, "; dashed: without denoising");
  #table = new PointTable();
  #drawn = "";
  #logX = toggle("spp", false, () => this.#build());
  #logAbove = toggle("changed", false, () => this.#build());
  #logBelow = toggle("noise left", true, () => this.#build());
  #host;
  #empty = h("p", { class: "lead" });
  #full;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#host = h("div", {
      class: "plots", tabindex: 0, role: "group",
      "aria-label": "Convergence curve. Left and right select a point, plus and minus zoom, 0 shows all.",
      onkeydown: (event) => this.#key(event),
    },
    h("p", { class: "plot-title" }, h("b", {}, "Changed since the first image"), ": pixels that differ visibly from it", this.#slope),
    this.#above,
    h("p", { class: "plot-title" }, h("b", {}, "Noise left"), ": pixels that more samples would still change visibly, by half buffers", this.#undenoised),
    this.#below);
    this.#full = h("div", { hidden: true },
      h("div", { class: "tools" },
        h("span", { class: "toggles", role: "group", "aria-label": "Logarithmic axes" },
          "Logarithmic", this.#logX.label, this.#logAbove.label, this.#logBelow.label),
        h("span", { class: "push" },
          signButton("−", "Zoom out", () => this.#zoomBy(2)), signButton("+", "Zoom in", () => this.#zoomBy(0.5)),
          signButton("All", "Show all of the curve", () => this.#zoomTo(null)))),
      this.#host, this.#readout,
      this.#table.element);
    this.element = h("section", { class: "curve", "aria-labelledby": "curve-title" },
      h("h2", { id: "curve-title" }, "Convergence curve"), this.#empty, this.#full);
    const observer = new ResizeObserver(() => this.#resize());
    observer.observe(this.#above);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => this.#build(), { signal });
    signal.addEventListener("abort", () => {
      observer.disconnect();
      this.#destroy();
    });
  }

  /**
   * @param {Api.JobView} job
   * @param {Api.CurvePoint[]} points
   */
  show(job, points) {
    const rebuild = !this.#plots.length || this.#job?.width !== job.width;
    this.#job = job;
    this.#points = points;
    this.#full.hidden = !points.length;
    this.#empty.hidden = points.length > 0;
    if (!points.length) {
      setText(this.#empty, job.finished_at ? "The curve has no points: the job ended before its first step."
        : `The curve begins at its first step, ${whole(job.spec.step)} spp.`);
      return;
    }
    // Most polls bring nothing new.
    const drawn = `${points.length} ${job.state}`;
    if (!rebuild && drawn === this.#drawn) return;
    this.#drawn = drawn;
    if (rebuild) this.#build();
    else this.#update();
    this.#words();
  }

  // Both plots.

  #build() {
    this.#destroy();
    if (!this.#points.length) return;
    const theme = colours();
    const sync = uPlot.sync(`curve ${this.#job.id}`);
    this.#plots = [
      new uPlot(this.#options(HEIGHT_ABOVE, theme, sync, this.#seriesAbove(theme), {
        log: this.#logAbove.input.checked, bands: [], draw: (/** @type {uPlot} */ plot) => drawStops(plot, stopsOf(this.#job, this.#points), theme, true),
      }), this.#dataAbove(), this.#above),
      new uPlot(this.#options(HEIGHT_BELOW, theme, sync, this.#seriesBelow(theme), {
        log: this.#logBelow.input.checked, bands: [{ series: [3, 2], fill: theme.band }],
        draw: (/** @type {uPlot} */ plot) => {
          drawStops(plot, stopsOf(this.#job, this.#points), theme, false);
          drawLevel(plot, this.#target(), theme);
          drawForecast(plot, this.#points, this.#target(), theme);
        },
      }), this.#dataBelow(), this.#below),
    ];
    this.#update();
  }

  /**
   * @param {number} height
   * @param {Theme} theme
   * @param {uPlot.SyncPubSub} sync
   * @param {uPlot.Series[]} series
   * @param {{ log: boolean, bands: uPlot.Band[], draw: (plot: uPlot) => void }} more
   * @returns {uPlot.Options}
   */
  #options(height, theme, sync, series, { log, bands, draw }) {
    const axis = { stroke: theme.ink, grid: { stroke: theme.grid, width: 1 }, ticks: { show: false }, font: theme.font };
    /** @type {uPlot.Axis.DynamicValues} */
    const short = (_, values) => values.map((value) => (value == null ? "" : compact(value)));
    return {
      width: Math.max(200, this.#above.clientWidth), height, series, bands,
      legend: { show: false },
      scales: {
        x: { time: false, auto: false, distr: this.#logX.input.checked ? 3 : 1 },
        y: log ? { distr: 3, range: decades(this.#target()) } : { range: fromZero },
      },
      axes: [
        { ...axis, values: short, space: 60, size: 30 },
        { ...axis, values: short, size: AXIS_PX },
      ],
      cursor: {
        sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false }, focus: { prox: 1e6 },
        points: { size: 9 },
        bind: { dblclick: () => () => { this.#zoomTo(null); return null; } },
      },
      hooks: {
        draw: [draw],
        setCursor: [(plot) => this.#read(plot.cursor.idx)],
        setSelect: [(plot) => {
          if (plot.select.width < 4) return;
          const [min, max] = [plot.select.left, plot.select.left + plot.select.width].map((x) => plot.posToVal(x, "x"));
          this.#zoomTo({ min, max });
        }],
      },
    };
  }

  /**
   * @param {Theme} theme
   * @returns {uPlot.Series[]}
   */
  #seriesAbove(theme) {
    return [{}, line(theme.curve), { stroke: theme.stopFaint, width: 5, points: { show: false } },
      { stroke: theme.stop, width: 1.5, dash: [5, 4], points: { show: false } }];
  }

  /**
   * @param {Theme} theme
   * @returns {uPlot.Series[]}
   */
  #seriesBelow(theme) {
    const edge = { stroke: "transparent", points: { show: false } };
    return [{}, line(theme.estimate), edge, edge,
      { stroke: theme.estimate, width: 1.5, dash: [5, 4], points: { show: false } }];
  }

  /** @returns {uPlot.AlignedData} */
  #dataAbove() {
    const points = this.#points;
    const rule = ruleWith("slope", this.#job);
    const window = points.slice(-((rule && valueIn("window", rule)) ?? 5));
    const slope = points[points.length - 1].slope;
    const mean = (/** @type {(point: Api.CurvePoint) => number} */ of) => window.reduce((sum, point) => sum + of(point), 0) / window.length;
    const [spp, visible] = [mean((point) => point.spp), mean((point) => point.visible_pixels)];
    const laid = (/** @type {number | null} */ steepness) => points.map((point) =>
      steepness != null && window.includes(point) ? visible + steepness * (point.spp - spp) : null);
    return [
      points.map((point) => point.spp),
      points.map((point) => drawable(point.visible_pixels, this.#logAbove)),
      laid(slope),
      laid(rule && slope != null ? stopSlope(this.#job, rule) : null),
    ];
  }

  /** @returns {uPlot.AlignedData} */
  #dataBelow() {
    const column = (/** @type {"estimate_pixels" | "estimate_low_pixels" | "estimate_high_pixels" | "raw_estimate_pixels"} */ name) => this.#points.map((point) => drawable(point[name], this.#logBelow));
    return [this.#points.map((point) => point.spp), column("estimate_pixels"),
      column("estimate_low_pixels"), column("estimate_high_pixels"), column("raw_estimate_pixels")];
  }

  #target() {
    const rule = ruleWith("noise_target", this.#job);
    const target = rule ? valueIn("noise_target", rule) : null;
    return target === null ? null : target * imagePixels(this.#job);
  }

  #update() {
    if (!this.#plots.length) return;
    const data = [this.#dataAbove(), this.#dataBelow()];
    const range = this.#zoom ?? this.#whole();
    this.#plots.forEach((plot, index) => plot.batch(() => {
      plot.setData(data[index], false);
      plot.setScale("x", range);
    }));
  }

  #whole() {
    const last = this.#points[this.#points.length - 1].spp;
    const forecast = forecastOf(this.#points);
    const max = Math.max(last, this.#job.state === "rendering" ? Math.min(forecast?.spp ?? 0, 2.5 * last) : 0);
    const min = this.#logX.input.checked ? this.#points[0].spp * 0.9 : 0;
    return { min, max: max * 1.03 };
  }

  /** @param {number} factor */
  #zoomBy(factor) {
    const { min, max } = this.#zoom ?? this.#whole();
    const middle = this.#at == null ? (min + max) / 2 : this.#points[this.#at].spp;
    const all = this.#whole();
    const next = { min: Math.max(all.min, middle - (middle - min) * factor), max: Math.min(all.max, middle + (max - middle) * factor) };
    this.#zoomTo(factor > 1 && next.min <= all.min && next.max >= all.max ? null : next);
  }

  /** @param {{ min: number, max: number } | null} zoom */
  #zoomTo(zoom) {
    if (zoom && zoom.max - zoom.min < this.#job.spec.step / 2) return;
    this.#zoom = zoom;
    this.#update();
    for (const plot of this.#plots) plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }

  #resize() {
    const width = this.#above.clientWidth;
    if (width < 1) return;
    for (const plot of this.#plots) if (plot.width !== width) plot.setSize({ width, height: plot.height });
  }

  #destroy() {
    for (const plot of this.#plots) plot.destroy();
    this.#plots = [];
  }

  // Words.

  #words() {
    const { slope } = this.#points[this.#points.length - 1];
    const rule = ruleWith("slope", this.#job);
    const limit = rule ? stopSlope(this.#job, rule) : null;
    const aim = rule && limit !== null ? `; ${rule.name} waits for ${three(limit)}` : "";
    setText(this.#slope, slope == null ? "" : `, rising by ${three(slope)} px/spp${aim}`);
    this.#undenoised.hidden = this.#job.spec.denoise.name === "none";
    if (this.#at == null) this.#read(null);
    this.#table.show(this.#points);
  }

  /** @param {number | null | undefined} index */
  #read(index) {
    this.#at = index ?? null;
    const point = this.#points[index ?? this.#points.length - 1];
    if (point) setText(this.#readout, told(point));
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const last = this.#points.length - 1;
    const step = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
    if (step) this.#walk(Math.min(last, Math.max(0, (this.#at ?? (step > 0 ? -1 : last + 1)) + step)));
    else if (event.key === "Home") this.#walk(0);
    else if (event.key === "End") this.#walk(last);
    else if (event.key === "+" || event.key === "=") this.#zoomBy(0.5);
    else if (event.key === "-") this.#zoomBy(2);
    else if (event.key === "0") this.#zoomTo(null);
    else return;
    event.preventDefault();
  }

  /** @param {number} index */
  #walk(index) {
    const point = this.#points[index];
    for (const plot of this.#plots) {
      const top = plot.valToPos(point.visible_pixels, "y");
      plot.setCursor({ left: plot.valToPos(point.spp, "x"), top: Number.isFinite(top) ? top : 0 }, false);
    }
    this.#read(index);
    say(told(point));
  }
}

/**
 * The value, or null if a logarithmic axis cannot show it.
 * @param {number | null | undefined} value
 * @param {{ input: HTMLInputElement }} toggle
 */
function drawable(value, { input: { checked: logarithmic } }) {
  return value == null || (logarithmic && value <= 0) ? null : value;
}

/**
 * @param {string} name
 * @param {boolean} checked
 * @param {() => void} act
 */
function toggle(name, checked, act) {
  const input = h("input", { type: "checkbox", checked, onchange: act });
  return { input, label: h("label", { class: "toggle" }, input, name) };
}

/**
 * @param {string} stroke
 * @returns {uPlot.Series}
 */
function line(stroke) {
  return { stroke, width: 2, points: { show: true, size: 6, fill: stroke } };
}
