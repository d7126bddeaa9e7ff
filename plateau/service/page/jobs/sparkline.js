// A small picture of a job's curve: changes since the first image, and the noise left.

import { setAttribute, svg } from "../shared/dom.js";

const WIDTH = 132;
const HEIGHT = 40;
const PAD = 4;

export class Sparkline {
  #area = svg("path", { class: "area" });
  #line = svg("path", { class: "line" });
  #left = svg("path", { class: "left" });
  #end = svg("circle", { class: "end", r: 3, hidden: true });

  constructor() {
    this.element = svg("svg",
      { class: "spark", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true", focusable: "false" },
      this.#area, this.#left, this.#line, this.#end);
  }

  /**
   * Shows the points from 0 spp to the last one.
   * @param {Api.CurvePoint[]} points
   */
  show(points) {
    if (!points.length) return;
    const last = points[points.length - 1];
    const x = (/** @type {number} */ spp) => PAD + (WIDTH - 2 * PAD) * (spp / last.spp);
    const most = Math.max(1, ...points.map((point) => point.visible_pixels));
    const y = (/** @type {number} */ value) => HEIGHT - PAD - (HEIGHT - 2 * PAD) * (value / most);
    const curve = [[0, 0], ...points.map((point) => [point.spp, point.visible_pixels])];
    const line = curve.map(([spp, value]) => `${x(spp).toFixed(1)} ${y(value).toFixed(1)}`).join("L");
    setAttribute(this.#line, "d", `M${line}`);
    setAttribute(this.#area, "d", `M${line}V${HEIGHT - PAD}H${x(0)}Z`);
    const left = points.flatMap(({ spp, estimate_pixels: estimate }) =>
      (estimate == null ? [] : [`${x(spp).toFixed(1)} ${y(Math.min(most, estimate)).toFixed(1)}`]));
    setAttribute(this.#left, "d", left.length > 1 ? `M${left.join("L")}` : null);
    setAttribute(this.#end, "cx", x(last.spp));
    setAttribute(this.#end, "cy", y(last.visible_pixels));
    this.#end.removeAttribute("hidden");
  }
}
