// Reads channels of the EXR files that Plateau writes: one part, scan lines, half or float32.
// See "OpenEXR File Layout" (openexr.com).

const UNKNOWN_KIND = "not an EXR file of this kind";
const MAGIC = 20000630;
const MULTIPART_OR_TILES = 0x1a00;
const HALF = 1;
const FLOAT = 2;
/** Lines in a chunk, by compression: none, zips and zip. */
const LINES = new Map([[0, 1], [2, 1], [3, 16]]);
/** The compressions that are read, by their names in a spec. */
export const READ = ["none", "zips", "zip"];

/** @typedef {{ width: number, height: number, planes: Record<string, Float32Array>, channels: string[] }} LinearImage
 *   linear radiance; the planes that were read, among them R, G and B, and the names of all channels of the file */

/**
 * A file's pixels.
 * @param {ArrayBuffer} buffer
 * @param {(channel: string) => boolean} isWanted
 * @returns {Promise<LinearImage>}
 */
export async function readExr(buffer, isWanted) {
  const view = new DataView(buffer);
  const flags = view.getUint32(4, true);
  if (view.getUint32(0, true) !== MAGIC || flags & MULTIPART_OR_TILES) throw new Error(UNKNOWN_KIND);
  const { attribute, end } = header(view, 8);
  const channels = channelList(attribute("channels"));
  const lines = LINES.get(attribute("compression").getUint8(0));
  if (!lines || channels.some(({ type }) => type !== FLOAT && type !== HALF)) throw new Error(UNKNOWN_KIND);
  const box = attribute("dataWindow");
  const [left, top, right, bottom] = [0, 4, 8, 12].map((offset) => box.getInt32(offset, true));
  const [width, height] = [right - left + 1, bottom - top + 1];
  const names = channels.map(({ name }) => name);
  const planes = Object.fromEntries(names.filter(isWanted).map((name) => [name, new Float32Array(width * height)]));
  const pixelBytes = channels.reduce((sum, { type }) => sum + 2 * type, 0);

  const chunk = async (/** @type {number} */ number) => {
    const start = Number(view.getBigUint64(end + 8 * number, true));
    const first = view.getInt32(start, true) - top;
    const size = view.getInt32(start + 4, true);
    const rows = Math.min(lines, height - first);
    const whole = rows * width * pixelBytes;
    const packed = new Uint8Array(buffer, start + 8, size);
    // A chunk that compression would not make smaller is stored uncompressed.
    const bytes = size === whole ? packed.slice() : unpredicted(await inflated(packed));
    const values = new DataView(bytes.buffer, bytes.byteOffset, whole);
    let at = 0;
    for (let row = first; row < first + rows; row += 1) {
      for (const { name, type } of channels) {
        const plane = planes[name];
        for (let x = 0; plane && x < width; x += 1) {
          plane[row * width + x] = type === HALF ? ofHalf(values.getUint16(at + 2 * x, true)) : values.getFloat32(at + 4 * x, true);
        }
        at += 2 * type * width;
      }
    }
  };
  await Promise.all(Array.from({ length: Math.ceil(height / lines) }, (_, number) => chunk(number)));
  return { width, height, planes, channels: names };
}

/**
 * A number that is stored in 16 bits.
 * @param {number} bits
 */
function ofHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 25) * (1024 + fraction) : 2 ** -24 * fraction);
}

/**
 * @param {DataView} view
 * @param {number} offset
 */
function header(view, offset) {
  /** @type {Map<string, DataView>} */
  const attributes = new Map();
  let at = offset;
  const text = () => {
    const start = at;
    while (view.getUint8(at) !== 0) at += 1;
    at += 1;
    return new TextDecoder().decode(new Uint8Array(view.buffer, start, at - start - 1));
  };
  for (;;) {
    const name = text();
    if (name === "") break;
    text();  // its type
    const size = view.getInt32(at, true);
    attributes.set(name, new DataView(view.buffer, at + 4, size));
    at += 4 + size;
  }
  const attribute = (/** @type {string} */ name) => {
    const found = attributes.get(name);
    if (!found) throw new Error(UNKNOWN_KIND);
    return found;
  };
  return { attribute, end: at };
}

/** @param {DataView} view */
function channelList(view) {
  const found = [];
  let at = 0;
  while (view.getUint8(at) !== 0) {
    let name = "";
    for (; view.getUint8(at) !== 0; at += 1) name += String.fromCharCode(view.getUint8(at));
    found.push({ name, type: view.getInt32(at + 1, true) });
    at += 17;
  }
  return found;
}

/** @param {Uint8Array<ArrayBuffer>} packed */
async function inflated(packed) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/**
 * Undoes the predictor and the interleaving, which precede the compression.
 * @param {Uint8Array} bytes
 */
function unpredicted(bytes) {
  for (let at = 1; at < bytes.length; at += 1) bytes[at] = (bytes[at - 1] + bytes[at] - 128) & 255;
  const found = new Uint8Array(bytes.length);
  const half = (bytes.length + 1) >> 1;
  for (let at = 0; at < half; at += 1) found[2 * at] = bytes[at];
  for (let at = half; at < bytes.length; at += 1) found[2 * (at - half) + 1] = bytes[at];
  return found;
}
