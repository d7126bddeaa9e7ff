// A job's convergence: what has changed since the first image, the noise left, and the values of rules.

import { h, setText } from "../../shared/dom.js";
import { whole } from "../../shared/figures.js";
import { say } from "../../shared/notices.js";
import { ruleNamed } from "../../shared/rules.js";
import { colours, compact, marked } from "./axes.js";
import { ChangedPanel, NoiseLeftPanel, rulesWithValues, ValuePanel } from "./panels.js";
import { told } from "./point_words.js";
// @ts-types="../../vendor/uPlot.d.ts"
import uPlot from "../../vendor/uPlot.esm.js";

/** @import { Theme } from "./axes.js" */
/** @typedef {(ChangedPanel | NoiseLeftPanel | ValuePanel)[]} Panels */

const AXIS_PX = 58;
/** Heights of the first plot and of the others. */
const FIRST_PX = 250, OTHER_PX = 190;

export class CurveChart {
  // `show` sets it before anything else reads it.
  #job = /** @type {Api.JobView} */ (/** @type {unknown} */ (null));
  /** @type {Api.CurvePoint[]} */
  #points = [];
  /** @type {uPlot[]} */
  #plots = [];
  /** @type {number | null} */
  #at = null;
  /** The point that a key has selected. @type {number | null} */
  #walked = null;
  /** @type {Panels} */
  #panels = [];
  #readout = h("p", { class: "readout" });
  #drawn = "";
  #logX = h("input", { type: "checkbox", onchange: () => this.#build() });
  #host;
  #empty = h("p", { class: "lead" });
  #full;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#host = h("div", {
      class: "plots", tabindex: 0, role: "group",
      "aria-label": "Convergence curve. Left and right select a point.",
      onkeydown: (event) => this.#key(event),
      onpointermove: () => (this.#walked = null),
    });
    this.#full = h("div", { hidden: true },
      h("label", { class: "toggle" }, this.#logX, "Logarithmic spp"),
      this.#host, this.#readout);
    this.element = h("section", { class: "curve", "aria-labelledby": "curve-title" },
      h("h2", { id: "curve-title" }, "Convergence curve"), this.#empty, this.#full);
    const observer = new ResizeObserver(() => this.#resize());
    observer.observe(this.#host);
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
    if (!this.#job) this.#addPanels(job);
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

  // The plots.

  #build() {
    this.#destroy();
    if (!this.#points.length) return;
    const theme = colours();
    const sync = uPlot.sync(`curve ${this.#job.id}`);
    this.#plots = this.#panels.map((panel) => new uPlot(this.#options(panel, theme, sync), this.#data(panel), panel.box));
    this.#update();
  }

  /**
   * The panels, once the job is known; what ends the job comes first.
   * @param {Api.JobView} job
   */
  #addPanels(job) {
    const values = rulesWithValues(job).map((rule) => new ValuePanel(rule));
    const own = ruleNamed(job.spec.rule.name)?.quantity ? values.splice(0, 1) : [];
    this.#panels = [...own, new ChangedPanel(), new NoiseLeftPanel(), ...values];
    this.#host.append(...this.#panels.flatMap(({ title, box }) => [title, box]));
  }

  /**
   * @param {Panels[number]} panel
   * @param {Theme} theme
   * @param {uPlot.SyncPubSub} sync
   * @returns {uPlot.Options}
   */
  #options(panel, theme, sync) {
    const axis = { stroke: theme.ink, grid: { stroke: theme.grid, width: 1 }, ticks: { show: false }, font: theme.font };
    const decades = panel.logarithmic ? { filter: marked, grid: { ...axis.grid, filter: marked } } : {};
    const isFirst = panel === this.#panels[0];
    /** @type {uPlot.Axis.DynamicValues} */
    const short = (_, values) => values.map((value) => (value == null ? "" : compact(value)));
    return {
      width: Math.max(200, this.#host.clientWidth), height: isFirst ? FIRST_PX : OTHER_PX, series: [{}, ...panel.series(theme)], bands: panel.bands(theme),
      legend: { show: false },
      scales: {
        x: { time: false, auto: false, distr: this.#logX.checked ? 3 : 1 },
        y: { distr: panel.logarithmic ? 3 : 1, range: panel.range(this.#job) },
      },
      axes: [
        { ...axis, values: short, space: 60, size: 30 },
        { ...axis, ...decades, values: short, size: AXIS_PX },
      ],
      cursor: {
        sync: { key: sync.key, setSeries: false }, drag: { x: false, y: false }, focus: { prox: 1e6 },
        points: { size: 9 }, bind: { dblclick: () => null },
      },
      hooks: {
        draw: [(plot) => panel.draw(plot, this.#job, this.#points, theme, isFirst)],
        setCursor: [(plot) => this.#read(plot.cursor.idx)],
      },
    };
  }

  /**
   * @param {Panels[number]} panel
   * @returns {uPlot.AlignedData}
   */
  #data(panel) {
    return [this.#points.map((point) => point.spp), ...panel.data(this.#job, this.#points)];
  }

  #update() {
    if (!this.#plots.length) return;
    const range = this.#whole();
    this.#plots.forEach((plot, index) => plot.batch(() => {
      plot.setData(this.#data(this.#panels[index]), false);
      plot.setScale("x", range);
    }));
    if (this.#walked != null) this.#walk(this.#walked);
  }

  #whole() {
    const { spp: last, expected_spp: end } = this.#points[this.#points.length - 1];
    const max = Math.max(last, this.#job.state === "rendering" ? Math.min(end ?? 0, 2.5 * last) : 0);
    const min = this.#logX.checked ? this.#points[0].spp * 0.9 : 0;
    return { min, max: max * 1.03 };
  }

  #resize() {
    const width = this.#host.clientWidth;
    if (width < 1) return;
    for (const plot of this.#plots) if (plot.width !== width) plot.setSize({ width, height: plot.height });
  }

  #destroy() {
    for (const plot of this.#plots) plot.destroy();
    this.#plots = [];
  }

  // Words.

  #words() {
    for (const panel of this.#panels) panel.words(this.#job, this.#points);
    if (this.#at == null) this.#read(null);
  }

  /** @param {number | null | undefined} index */
  #read(index) {
    this.#at = index ?? null;
    const point = this.#points[index ?? this.#points.length - 1];
    if (point) setText(this.#readout, told(point));
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const last = this.#points.length - 1;
    const step = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
    if (step) this.#go(Math.min(last, Math.max(0, (this.#at ?? (step > 0 ? -1 : last + 1)) + step)));
    else if (event.key === "Home") this.#go(0);
    else if (event.key === "End") this.#go(last);
    else return;
    event.preventDefault();
  }

  /** @param {number} index */
  #go(index) {
    this.#walk(index);
    say(told(this.#points[index]));
  }

  /** @param {number} index */
  #walk(index) {
    const point = this.#points[(this.#walked = index)];
    for (const plot of this.#plots) {
      const top = plot.valToPos(point.visible_pixels, "y");
      plot.setCursor({ left: plot.valToPos(point.spp, "x"), top: Number.isFinite(top) ? top : 0 }, false);
    }
    this.#read(index);
  }
}
