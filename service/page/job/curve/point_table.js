// The points of a curve in words: one of them in a line, all of them as a table.

import { h } from "../../shared/dom.js";
import { percent, pixels, three, whole } from "../../shared/figures.js";

const COLUMNS = ["spp", "changed", "slope", "noise left", "between", "forecast"];

/** A point in a line. */
export function told(point) {
  const parts = [`${whole(point.spp)} spp`,
    `${pixels(point.visible_pixels)} px (${percent(point.visible_fraction)}) changed since the first image`];
  if (point.slope != null) parts.push(`slope ${three(point.slope)} px/spp`);
  if (point.estimate_pixels != null) {
    const band = point.estimate_low_pixels == null ? "" : ` (${pixels(point.estimate_low_pixels)} to ${pixels(point.estimate_high_pixels)})`;
    parts.push(`${pixels(point.estimate_pixels)} px${band} of noise left`);
  }
  return parts.join(" · ");
}

/** The table, folded away until somebody wants it; a row is made once. */
export class PointTable {
  #rows = h("tbody");
  element = h("details", { class: "points" }, h("summary", {}, "The points as a table"),
    h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": "The points of the curve" },
      h("table", {}, h("thead", {}, h("tr", {}, COLUMNS.map((name) => h("th", { scope: "col" }, name)))), this.#rows)));

  /** Adds the points that it has not shown yet: those that it has never change. */
  show(points) {
    if (points.length < this.#rows.children.length) this.#rows.replaceChildren();
    this.#rows.append(...points.slice(this.#rows.children.length).map(row));
  }
}

function row(point) {
  const cells = [
    whole(point.visible_pixels),
    point.slope == null ? "–" : three(point.slope),
    point.estimate_pixels == null ? "–" : pixels(point.estimate_pixels),
    point.estimate_low_pixels == null ? "–" : `${pixels(point.estimate_low_pixels)} – ${pixels(point.estimate_high_pixels)}`,
    point.forecast_spp == null ? "–" : `${whole(point.forecast_spp)} spp`,
  ];
  return h("tr", {}, h("th", { scope: "row" }, whole(point.spp)), cells.map((text) => h("td", {}, text)));
}
