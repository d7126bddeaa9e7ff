// Figures as text, the same as in plateau/farm/wire/figures.py and on the command line; a test compares them.

const WHOLE = new Intl.NumberFormat("en-GB", { maximumFractionDigits: 0 });
const THREE = new Intl.NumberFormat("en-GB", { maximumSignificantDigits: 3 });
const TWO = new Intl.NumberFormat("en-GB", { maximumSignificantDigits: 2 });

/** @type {[number, string][]} */
const LARGE = [[1e12, "trillion"], [1e9, "billion"], [1e6, "million"]];
/** @type {[number, string][]} */
const BYTES = [[1e9, "GB"], [1e6, "MB"], [1e3, "kB"]];

/** A space that keeps a figure and its unit together. */
const NB = "\u00a0";

/**
 * A whole number with separators of thousands.
 * @param {number} number
 */
export function whole(number) {
  return WHOLE.format(number);
}

/**
 * A number with three significant digits, or with all digits of its whole part.
 * @param {number} number
 */
export function three(number) {
  return (Math.abs(number) >= 100 ? WHOLE : THREE).format(number);
}

/**
 * A number of pixels: whole, or with two digits below ten.
 * @param {number} count
 */
export function pixels(count) {
  return count >= 10 ? WHOLE.format(count) : TWO.format(count);
}

/**
 * Samples per pixel; by zones their mean, beside the fewest and the most that a zone has.
 * @param {number} mean
 * @param {{ spp_min: number | null, spp_max: number | null }} zones
 */
export function sppOf(mean, { spp_min: least, spp_max: most }) {
  const range = least == null || most == null || least === most ? "" : ` (${whole(least)} to ${whole(most)})`;
  return `${whole(mean)} spp${range}`;
}

/**
 * A fraction as a percentage with two or three digits.
 * @param {number} fraction
 */
export function percent(fraction) {
  return `${(fraction >= 0.1 ? THREE : TWO).format(100 * fraction)}${NB}%`;
}

/**
 * A share of a cap, rounded down, so that only all of it is 100 %.
 * @param {number} fraction
 */
export function share(fraction) {
  return `${THREE.format(Math.floor(fraction * 1000 + 1e-9) / 10)}${NB}%`;
}

/**
 * Large numbers in words: 563 million.
 * @param {number} number
 */
export function large(number) {
  for (const [size, name] of LARGE) {
    if (number >= size) return `${THREE.format(number / size)} ${name}`;
  }
  return WHOLE.format(number);
}

/**
 * A duration: 4.2 s, 3 min 20 s, 2 h 05 min.
 * @param {number} seconds
 */
export function duration(seconds) {
  if (seconds < 59.95) return `${seconds.toFixed(1)}${NB}s`;
  const rounded = Math.round(seconds);
  if (rounded < 3600) return [Math.floor(rounded / 60), "min", rounded % 60, "s"].join(NB);
  const minutes = Math.floor((rounded % 3600) / 60);
  return [Math.floor(rounded / 3600), "h", String(minutes).padStart(2, "0"), "min"].join(NB);
}

/**
 * A number of bytes, with a prefix.
 * @param {number} count
 */
export function bytes(count) {
  for (const [size, name] of BYTES) {
    if (count >= size) return `${THREE.format(count / size)} ${name}`;
  }
  return `${count} bytes`;
}

/**
 * One thing, or several: 1 slice, 3 slices.
 * @param {number} count
 * @param {string} one
 */
export function several(count, one) {
  return `${WHOLE.format(count)} ${one}${count === 1 ? "" : "s"}`;
}

/**
 * A local time; with its date unless that is today's.
 * @param {string} iso
 */
export function clock(iso) {
  const time = new Date(iso);
  const hours = time.toLocaleTimeString("en-GB");
  const today = new Date().toDateString() === time.toDateString();
  return today ? hours : `${time.toLocaleDateString("en-GB", { day: "numeric", month: "short" })} ${hours}`;
}

/**
 * The farm's words as a sentence.
 * @param {string} text
 */
export function sentence(text) {
  const trimmed = text.trim();
  if (!trimmed) return "";
  return `${trimmed[0].toUpperCase()}${trimmed.slice(1)}${/[.!?]$/.test(trimmed) ? "" : "."}`;
}

/**
 * How long ago a time was.
 * @param {string | null} iso
 */
export function ago(iso) {
  const seconds = Math.max(0, (Date.now() - Date.parse(iso ?? "")) / 1000);
  if (seconds < 60) return "just now";
  if (seconds < 5400) return `${Math.round(seconds / 60)} min ago`;
  if (seconds < 129_600) return `${Math.round(seconds / 3600)} h ago`;
  return `${Math.round(seconds / 86_400)} days ago`;
}
