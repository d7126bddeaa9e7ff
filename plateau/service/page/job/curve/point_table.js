// The points of a curve as text: one in a line, all as a table.

import { h, table } from "../../shared/dom.js";
import { percent, pixels, sppOf, three, whole } from "../../shared/figures.js";
import { ruleNamed } from "../../shared/rules.js";

const COLUMNS = ["spp", "changed", "slope", "noise left", "between", "forecast"];

/**
 * A point in a line.
 * @param {Api.CurvePoint} point
 */
export function told(point) {
  const parts = [sppOf(point.spp, point),
    `${pixels(point.visible_pixels)} px (${percent(point.visible_fraction)}) changed since the first image`];
  if (point.slope != null) parts.push(`slope ${three(point.slope)} px/spp`);
  if (point.estimate_pixels != null) {
    const band = bandOf(point, " to ");
    parts.push(`${pixels(point.estimate_pixels)} px${band && ` (${band})`} of noise left${undetermined(point)}`);
  }
  if (point.raw_estimate_pixels != null) parts.push(`${pixels(point.raw_estimate_pixels)} px without denoising`);
  return [...parts, ...ownValues(point)].join(" · ");
}

/**
 * The values of rules that have a quantity of their own, such as a quality.
 * @param {Api.CurvePoint} point
 */
function ownValues(point) {
  return Object.entries(point.rules).flatMap(([name, { value }]) => {
    const { quantity = "", unit = "" } = ruleNamed(name) ?? {};
    return quantity && value != null ? [`${quantity} ${three(value)} ${unit}`] : [];
  });
}

/** A collapsed table of all points. */
export class PointTable {
  #rows = h("tbody");
  element = h("details", { class: "points" }, h("summary", {}, "The points as a table"),
    table("The points of the curve", COLUMNS, this.#rows));

  /**
   * Adds the new points; a point never changes.
   * @param {Api.CurvePoint[]} points
   */
  show(points) {
    if (points.length < this.#rows.children.length) this.#rows.replaceChildren();
    this.#rows.append(...points.slice(this.#rows.children.length).map(row));
  }
}

/**
 * The interval of the noise left; "" if it is not known.
 * @param {Api.CurvePoint} point
 * @param {string} to
 */
function bandOf({ estimate_low_pixels: low, estimate_high_pixels: high }, to) {
  return low == null || high == null ? "" : `${pixels(low)}${to}${pixels(high)}`;
}

/** @param {Api.CurvePoint} point */
const undetermined = (point) => (point.estimate_undetermined ? ", undetermined" : "");

/** @param {Api.CurvePoint} point */
function row(point) {
  const cells = [
    whole(point.visible_pixels),
    point.slope == null ? "–" : three(point.slope),
    point.estimate_pixels == null ? "–" : pixels(point.estimate_pixels) + undetermined(point),
    bandOf(point, " – ") || "–",
    point.forecast_spp == null ? "–" : `${whole(point.forecast_spp)} spp`,
  ];
  return h("tr", {}, h("th", { scope: "row" }, whole(point.spp)), cells.map((text) => h("td", {}, text)));
}
