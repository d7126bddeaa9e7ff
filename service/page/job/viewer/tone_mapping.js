// Planes as pictures: light as the job's display shows it, the same as metric.encode_srgb, or in false colours.

import { drawing, h } from "../../shared/dom.js";
import { boundsOf, luminance } from "./channels.js";

const SHIFT = 12;
/** The code of every 2¹²th positive float32 up to 1, by its bits. */
const TABLE = table();

/** The light of every sRGB code (IEC 61966-2-1). */
const LIGHT = Float32Array.from({ length: 256 }, (_, code) => {
  const encoded = code / 255;
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
});

/**
 * The sRGB code, 0 to 255, of a linear value (IEC 61966-2-1).
 * @param {number} linear
 */
function code(linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 255;
  const encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
  return Math.round(255 * encoded);
}

function table() {
  const one = new Uint32Array(new Float32Array([1]).buffer)[0];
  const bits = new Uint32Array(1);
  const value = new Float32Array(bits.buffer);
  const codes = new Uint8Array((one >>> SHIFT) + 2);
  for (let index = 0; index < codes.length; index += 1) {
    bits[0] = index << SHIFT;
    codes[index] = code(value[0]);
  }
  return codes;
}

/** @import { Shown } from "./channels.js" */
/** @import { LinearImage } from "./exr.js" */
/** @typedef {[red: number, green: number, blue: number]} Colour  sRGB codes */

/** The exposures that false colours span, relative to white. */
export const FALSE_EV = { least: -8, most: 4 };
/** What has no place on a scale: not finite. @type {Colour} */
const BROKEN = [255, 0, 255];
/** By which the hue of an id turns: the golden ratio, so that neighbours differ. */
const TURN = 0.618034;

/**
 * The picture of what is shown, its light times 2^ev.
 * @param {Shown} shown
 * @param {{ width: number, height: number }} size
 * @param {number} ev
 * @param {Colour[] | null} palette - the false colours; null: light as it is, data in greys
 */
export function pictureOf({ kind, planes }, { width, height }, ev, palette) {
  const picture = new ImageData(width, height);
  if (kind === "ids") paint(picture, planes[0], hue);
  else if (kind === "light" && palette) {
    const { least, most } = FALSE_EV;
    paint(picture, luminance(planes), (value) => along(palette, (Math.log2(Math.max(value, 0)) + ev - least) / (most - least)));
  } else if (kind === "light") tone(picture, planes, ev);
  else {
    const [least, most] = boundsOf(planes);
    const share = (/** @type {number} */ value) => (most > least ? (value - least) / (most - least) : 0.5);
    if (planes.length === 1 && palette) paint(picture, planes[0], (value) => along(palette, share(value)));
    else {
      const [red, green = red, blue = planes.length > 1 ? null : red] = planes;
      const part = (/** @type {Float32Array | null} */ plane, /** @type {number} */ at) => (plane ? 255 * share(plane[at]) : 0);
      paint(picture, red, (value, at) => [255 * share(value), part(green, at), part(blue, at)]);
    }
  }
  return picture;
}

/**
 * Colours each pixel by its value; one that is not finite is magenta.
 * @param {ImageData} picture
 * @param {Float32Array} plane
 * @param {(value: number, at: number) => Colour} colourOf
 */
function paint({ data }, plane, colourOf) {
  plane.forEach((value, at) => data.set(Number.isFinite(value) ? colourOf(value, at) : BROKEN, 4 * at));
  for (let at = 3; at < data.length; at += 4) data[at] = 255;
}

/**
 * The colour at a share of a palette, from its first to its last.
 * @param {Colour[]} palette
 * @param {number} share
 * @returns {Colour}
 */
function along(palette, share) {
  const place = Math.min(1, Math.max(0, share)) * (palette.length - 1);
  const [one, other] = [palette[Math.floor(place)], palette[Math.ceil(place)]];
  const mixed = (/** @type {0 | 1 | 2} */ part) => one[part] + (place % 1) * (other[part] - one[part]);
  return [mixed(0), mixed(1), mixed(2)];
}

/**
 * The colour of an id: neighbouring numbers have different hues.
 * @param {number} id
 * @returns {Colour}
 */
function hue(id) {
  const wave = (/** @type {number} */ third) => 140 + 90 * Math.cos(2 * Math.PI * (((id * TURN) % 1) + third / 3));
  return [wave(0), wave(1), wave(2)];
}

/**
 * @param {ImageData} picture
 * @param {Float32Array[]} planes - R, G and B, or one of them as grey
 * @param {number} ev
 */
function tone({ width, height, data: out }, [R, G = R, B = R], ev) {
  const gain = 2 ** ev;
  const row = new Float32Array(width);
  const bits = new Uint32Array(row.buffer);
  [R, G, B].forEach((plane, channel) => {
    for (let y = 0; y < height; y += 1) {
      const start = y * width;
      for (let x = 0; x < width; x += 1) row[x] = plane[start + x] * gain;
      for (let x = 0; x < width; x += 1) {
        const at = 4 * (start + x) + channel;
        const value = row[x];
        if (!(value > 0)) continue;  // NaN too is black
        if (value >= 1) { out[at] = 255; continue; }
        const index = bits[x] >>> SHIFT;
        const found = TABLE[index];
        // The code is computed if it changes within the table's step.
        out[at] = found === TABLE[index + 1] ? found : code(value);
      }
    }
  });
  for (let at = 3; at < out.length; at += 4) out[at] = 255;
}

/**
 * The linear light of an <img>, with the precision of its 8 bits.
 * @param {HTMLImageElement} image
 * @returns {LinearImage}
 */
export function linearised(image) {
  const { naturalWidth: width, naturalHeight: height } = image;
  const canvas = h("canvas", { width, height });
  const context = drawing(canvas, { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  const planes = [0, 1, 2].map((channel) => {
    const plane = new Float32Array(width * height);
    for (let at = 0; at < plane.length; at += 1) plane[at] = LIGHT[data[4 * at + channel]];
    return plane;
  });
  return { width, height, planes: { R: planes[0], G: planes[1], B: planes[2] }, channels: ["R", "G", "B"] };
}
