// The histogram of an image: of light over its exposures, of data over its values.

import { h, svg } from "../../shared/dom.js";
import { three, whole } from "../../shared/figures.js";
import { boundsOf } from "./channels.js";

/** @import { Shown } from "./channels.js" */

const BINS = 96;
const HEIGHT = 40;
/** The exposures that a histogram of light spans, relative to white as it is judged. */
const EV = { least: -12, most: 6 };
/** The classes of the lines of three planes, in order; of one plane it is the last. */
const LINES = ["red", "green", "blue", "one"];

export class Histogram {
  /** @type {Shown | null} */
  #shown = null;
  #key = "";
  #element = h("figure");

  /**
   * The histogram of what is shown; made anew only if that has changed.
   * @param {Shown} shown
   * @param {number} ev - of white
   * @param {string} name
   */
  of(shown, ev, name) {
    if (shown !== this.#shown || this.#key !== `${ev} ${name}`) {
      const isLight = shown.kind === "light";
      const [least, most] = isLight ? [EV.least - ev, EV.most - ev] : boundsOf(shown.planes);
      const counted = shown.planes.map((plane) => countsOf(plane, least, most, isLight));
      this.#element.replaceChildren(drawn(counted.map(({ counts }) => counts), isLight),
        h("figcaption", { class: "hint" }, `${name}: ${inWords(shown, counted, isLight)}`));
      this.#shown = shown;
      this.#key = `${ev} ${name}`;
    }
    return this.#element;
  }
}

/**
 * How many pixels are in each of the bins, in none for being black or broken.
 * @param {Float32Array} plane
 * @param {number} least
 * @param {number} most
 * @param {boolean} isLight - whether bins are equal ratios
 */
function countsOf(plane, least, most, isLight) {
  const counts = new Array(BINS).fill(0);
  let [black, broken] = [0, 0];
  for (const value of plane) {
    if (!Number.isFinite(value)) { broken += 1; continue; }
    if (isLight && value <= 0) { black += 1; continue; }
    const share = ((isLight ? Math.log2(value) : value) - least) / (most - least || 1);
    counts[Math.min(BINS - 1, Math.max(0, Math.floor(share * BINS)))] += 1;
  }
  return { counts, black, broken };
}

/**
 * @param {number[][]} counts
 * @param {boolean} isLight
 */
function drawn(counts, isLight) {
  // The ends gather what lies beyond, and would flatten the rest.
  const highest = Math.max(1, ...counts.flatMap((one) => one.slice(1, -1)));
  const lines = counts.map((one, at) => {
    const tops = one.map((count, bin) => `L${bin} ${HEIGHT * (1 - Math.min(1, count / highest))}h1`).join("");
    return svg("path", { class: LINES[counts.length === 1 ? 3 : at], d: `M0 ${HEIGHT}${tops}V${HEIGHT}Z` });
  });
  const white = (BINS * -EV.least) / (EV.most - EV.least);
  return svg("svg", { class: "histogram", viewBox: `0 0 ${BINS} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    lines, isLight && svg("path", { class: "white", d: `M${white} 0V${HEIGHT}` }));
}

/**
 * @param {Shown} shown
 * @param {{ black: number, broken: number }[]} counted
 * @param {boolean} isLight
 */
function inWords({ planes, names }, counted, isLight) {
  const [least, most] = boundsOf(planes);
  const broken = Math.max(...counted.map((one) => one.broken));
  const black = Math.max(...counted.map((one) => one.black));
  return [
    `${names.join(", ")} from ${three(least)} to ${three(most)}`,
    isLight && `drawn from −${-EV.least} to +${EV.most} EV around white, the line`,
    black && `${whole(black)} px are black`,
    broken && `${whole(broken)} px are not finite`,
  ].filter(Boolean).join("; ");
}
