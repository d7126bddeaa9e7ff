// Linear radiance as the job's display shows it, at any exposure: what metric.encode_srgb does.

const SHIFT = 12;
/** The code of every 2¹²th positive float32 up to 1, by its bits. */
const TABLE = table();

/** The sRGB code, 0 to 255, of a linear value (IEC 61966-2-1). */
export function code(linear) {
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

/** An ImageData of the image `{ width, height, planes }` with its light times 2^ev. */
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
        // Where the code changes within the table's step, it is worked out.
        out[at] = found === TABLE[index + 1] ? found : code(value);
      }
    }
  });
  for (let at = 3; at < out.length; at += 4) out[at] = 255;
  return data;
}
