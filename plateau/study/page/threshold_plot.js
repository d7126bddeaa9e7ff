// A plot of how often a difference was seen, over spp: shares as points, the fit as a curve.

import { h, svg } from "../shared/dom.js";
import { whole } from "../shared/figures.js";

const WIDTH = 640;
const HEIGHT = 280;
const [LEFT, RIGHT, TOP, BOTTOM] = [44, 14, 12, 36];

/** @param {Api.StudyResult} result */
export function studyPlot({ levels, a, b, thresholds }) {
  const most = 1.1 * levels[levels.length - 1].spp;
  const x = (/** @type {number} */ spp) => LEFT + (WIDTH - LEFT - RIGHT) * Math.min(1, Math.max(0, spp / most));
  const y = (/** @type {number} */ share) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - share);
  const across = (/** @type {number} */ share) => svg("g", {},
    svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y(share), y2: y(share) }),
    svg("text", { x: LEFT - 8, y: y(share), class: "down" }, `${100 * share} %`));
  const along = levels.map(({ spp }) => svg("text", { x: x(spp), y: HEIGHT - BOTTOM + 18, class: "along" }, whole(spp)));
  const bands = thresholds.map(({ low_spp: low, high_spp: high }) =>
    svg("rect", { class: "band", x: x(low), width: x(high) - x(low), y: TOP, height: HEIGHT - TOP - BOTTOM }));
  const curve = a == null || b == null ? [] : Array.from({ length: 101 }, (_, at) => {
    const spp = (most * at) / 100;
    return `${x(spp).toFixed(1)} ${y(1 / (1 + Math.exp(-(a * spp + b)))).toFixed(1)}`;
  });
  const dots = levels.filter(({ shown }) => shown).map(({ spp, shown, seen }) =>
    svg("circle", { class: "dot", cx: x(spp), cy: y(seen / shown), r: 4.5 }));
  return h("figure", { class: "study-plot" },
    svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "The share of answers that saw a difference, over samples per pixel; the table has the figures" },
      ...bands, ...[0, 0.25, 0.5, 0.75, 1].map(across), ...along,
      curve.length > 0 && svg("path", { class: "fit", d: `M${curve.join("L")}` }), ...dots),
    h("figcaption", { class: "caption" }, "Share of answers that saw a difference, over spp", thresholds.length ? "; the bands are the 95 % intervals of the thresholds of 50 % and 10 %, where the answers bound them." : "."));
}
