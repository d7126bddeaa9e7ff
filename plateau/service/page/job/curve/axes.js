// The ranges, numbers and colours of the curve's axes.

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
 * The range of a logarithmic axis; it includes the target, which may lie below all points.
 * @param {number | null} target
 * @param {number} least - below which the values do not matter
 * @returns {(plot: uPlot, min: number | null, max: number | null) => [number, number]}
 */
export function decades(target, least = 0) {
  return (_plot, min, max) => {
    const [low, high] = [Math.min(Math.max(min ?? 1, least), target ?? Infinity), Math.max(max ?? 1, target ?? 0)];
    return [10 ** Math.floor(Math.log10(low) - 0.1), 10 ** Math.ceil(Math.log10(high) + 0.05)];
  };
}

/**
 * The range of an axis of values that never come near zero; it includes the target.
 * @param {number | null} target
 * @returns {(plot: uPlot, min: number | null, max: number | null) => [number, number]}
 */
export function around(target) {
  return (_plot, min, max) => {
    const [low, high] = [Math.min(min ?? Infinity, target ?? Infinity), Math.max(max ?? -Infinity, target ?? -Infinity)];
    if (low > high) return [0, 1];
    const room = 0.12 * (high - low || 1);
    return [low - room, high + room];
  };
}

/**
 * A short form of a number for an axis.
 * @param {number} value
 */
export function compact(value) {
  if (value >= 1e6) return `${three(value / 1e6)} M`;
  if (value >= 1e4) return `${three(value / 1e3)} k`;
  return value >= 1 || value === 0 ? three(value) : String(Number(value.toPrecision(3)));
}

/**
 * The marks of a logarithmic axis: the powers of ten.
 * @param {uPlot} _plot
 * @param {number[]} values
 */
export function marked(_plot, values) {
  return values.map((value) => (Math.abs(Math.log10(value) - Math.round(Math.log10(value))) < 1e-9 ? value : null));
}

/** The colours of the plots, from the current style sheet. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: of("ink-2"), grid: of("line"), curve: of("curve"), estimate: of("estimate"), band: of("band"),
    stop: of("stop"), font: `12px ${style.fontFamily}`,
  };
}
