// Marks on the curves: where each rule stops, and the target.

import { rulesOf } from "../../shared/job_summary.js";

/** @import uPlot from "../../vendor/uPlot.d.ts" */
/** @import { Theme } from "./axes.js" */
/** @typedef {{ name: string, spp: number, own: boolean }} Stop */

/**
 * Where each rule stopped or would have stopped; the job's own rule comes first.
 * @param {Api.JobView} job
 * @param {Api.CurvePoint[]} points
 * @returns {Stop[]}
 */
export function stopsOf(job, points) {
  return rulesOf(job).flatMap(({ name }, index) => {
    // Another target may have stopped the job that this one goes on with.
    const first = points.find(({ spp, rules }) => rules[name]?.stop && (index || spp > job.continued_spp));
    return first ? [{ name, spp: first.spp, own: index === 0 }] : [];
  });
}

/**
 * Draws on a plot's canvas, whose units are device pixels, clipped to the plot.
 * @param {uPlot} plot
 * @param {(ctx: CanvasRenderingContext2D, bbox: uPlot.BBox, unit: number,
 *   to: { x: (value: number) => number, y: (value: number) => number }) => void} draw
 */
function onPlot(plot, draw) {
  const { ctx, bbox } = plot;
  const unit = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  draw(ctx, bbox, unit, {
    x: (value) => plot.valToPos(value, "x", true),
    y: (value) => plot.valToPos(value, "y", true),
  });
  ctx.restore();
}

/**
 * Vertical lines where rules stop.
 * @param {uPlot} plot
 * @param {Stop[]} stops
 * @param {Theme} theme
 * @param {boolean} named - whether their names are written beside them
 */
export function drawStops(plot, stops, theme, named) {
  onPlot(plot, (ctx, bbox, unit, to) => {
    ctx.font = theme.font.replace("12px", `${12 * unit}px`);
    stops.forEach(({ name, spp, own }, index) => {
      const x = Math.round(to.x(spp));
      ctx.strokeStyle = ctx.fillStyle = theme.ink;
      ctx.lineWidth = (own ? 2 : 1) * unit;
      ctx.setLineDash(own ? [] : [4 * unit, 3 * unit]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (!named) return;
      const text = own ? `${name} stops` : `${name} would stop`;
      // At the left if the right has no room; each name has its own line, so that all are legible.
      const room = x + ctx.measureText(text).width + 6 * unit < bbox.left + bbox.width;
      ctx.textAlign = room ? "left" : "right";
      ctx.fillText(text, x + (room ? 5 : -5) * unit, bbox.top + (14 + 15 * index) * unit);
    });
  });
}

/**
 * A horizontal line at the target: the noise that may be left, in pixels.
 * @param {uPlot} plot
 * @param {number | null} target
 * @param {Theme} theme
 */
export function drawLevel(plot, target, theme) {
  if (target == null) return;
  onPlot(plot, (ctx, bbox, unit, to) => {
    const y = Math.round(to.y(target));
    if (!Number.isFinite(y)) return;
    ctx.strokeStyle = theme.stop;
    ctx.lineWidth = 1.5 * unit;
    ctx.setLineDash([]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.font = theme.font.replace("12px", `${12 * unit}px`);
    ctx.fillStyle = theme.stop;
    ctx.textAlign = "left";
    ctx.fillText("target", bbox.left + 4 * unit, y + (y - bbox.top < 18 * unit ? 14 : -5) * unit);
  });
}
