// A point of a curve as text.

import { percent, pixels, sppOf, three } from "../../shared/figures.js";
import { ruleNamed } from "../../shared/rules.js";

/**
 * A point in a line.
 * @param {Api.CurvePoint} point
 */
export function told(point) {
  const parts = [sppOf(point.spp, point),
    `${pixels(point.visible_pixels)} px (${percent(point.visible_fraction)}) changed since the first image`];
  if (point.slope != null) parts.push(`slope ${three(point.slope)} px/spp`);
  const { estimate_pixels: left, estimate_low_pixels: low, estimate_high_pixels: high } = point;
  if (left != null) {
    const band = low == null || high == null ? "" : ` (${pixels(low)} to ${pixels(high)})`;
    parts.push(`${pixels(left)} px${band} of noise left${point.estimate_undetermined ? ", undetermined" : ""}`);
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

