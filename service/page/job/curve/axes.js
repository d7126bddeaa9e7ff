// How the axes of the curve are scaled, numbered and coloured.

import { three } from "../../shared/figures.js";

/** @import uPlot from "../../vendor/uPlot.d.ts" */

/** @typedef {ReturnType<typeof colours>} Theme */

/**
 * The range of an axis that begins at zero.
 * @param {uPlot} _plot
 * @param {number | null} _min
 * @param {number | null} max
 * @returns {[number, number]}
 */
export function fromZero(_plot, _min, max) {
  return [0, Math.max(1, max ?? 1) * 1.12];
}

/**
 * The range of a logarithmic axis: with room for the target, which may lie below all points.
 * @param {number | null} target
 * @returns {(plot: uPlot, min: number | null, max: number | null) => [number, number]}
 */
export function decades(target) {
  return (_plot, min, max) => {
    const [low, high] = [Math.min(min ?? 1, target ?? Infinity), Math.max(max ?? 1, target ?? 0)];
    return [10 ** Math.floor(Math.log10(low) - 0.1), 10 ** Math.ceil(Math.log10(high) + 0.05)];
  };
}

/**
 * A number as an axis has room for it.
 * @param {number} value
 */
export function compact(value) {
  if (value >= 1e6) return `${three(value / 1e6)} M`;
  if (value >= 1e4) return `${three(value / 1e3)} k`;
  return value >= 1 || value === 0 ? three(value) : value.toPrecision(1);
}

/** The colours of the plots, as the style sheet has them now. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: of("ink-2"), grid: of("line"), curve: of("curve"), estimate: of("estimate"), band: of("band"),
    stop: of("stop"), stopFaint: of("stop-faint"), font: `12px ${style.fontFamily}`,
  };
}
