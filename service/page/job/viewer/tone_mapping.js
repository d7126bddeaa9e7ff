// Linear radiance as the job's display shows it, at any exposure; the same as metric.encode_srgb.

import { drawing, h } from "../../shared/dom.js";

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

/** @import { LinearImage } from "./exr.js" */

/**
 * The image with its light times 2^ev.
 * @param {LinearImage} image
 * @param {number} ev
 */
export function toned({ width, height, planes: { R, G, B } }, ev) {
  const data = new ImageData(width, height);
  const out = data.data;
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
  return data;
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
  return { width, height, planes: { R: planes[0], G: planes[1], B: planes[2] } };
}
