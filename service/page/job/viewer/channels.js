// What of a linear image is shown: its colour, one of its channels, or an AOV.

import { LAYERS } from "../../shared/spec_fields.js";

/** @import { LinearImage } from "./exr.js" */

/** The choices for light, in this order; an image without alpha has no A. @type {Record<string, string>} */
const OF_LIGHT = { "": "Colour", Y: "Luminance", R: "Red", G: "Green", B: "Blue", A: "Alpha" };
/** The parts of a pixel's luminance (IEC 61966-2-1). */
const WEIGHTS = [0.2126, 0.7152, 0.0722];
const COLOUR = ["R", "G", "B"];

/**
 * What is shown: `light` at an exposure, `data` from the least to the greatest value, and `ids` in arbitrary colours.
 * @typedef {{ kind: "light" | "data" | "ids", names: string[], planes: Float32Array[] }} Shown
 */

/**
 * The layer of a channel: what comes before its part, and all of it where a channel is a layer.
 * @param {string} channel
 */
export function layerOf(channel) {
  if ([...COLOUR, "A"].includes(channel)) return "";
  return channel.replace(/\.[RGBXYZUV]$/, "");
}

/**
 * The choices that an image of these channels offers, with their titles.
 * @param {string[]} channels
 * @returns {[choice: string, title: string][]}
 */
export function choicesOf(channels) {
  const light = Object.entries(OF_LIGHT).filter(([name]) => name !== "A" || channels.includes("A"));
  const layers = [...new Set(channels.map(layerOf))].filter(Boolean);
  return [...light, ...layers.map((name) => /** @type {[string, string]} */ ([name, LAYERS[name] ?? name]))];
}

/**
 * The layer that a choice shows; "" for light.
 * @param {string} choice
 */
export function layerBehind(choice) {
  return choice in OF_LIGHT ? "" : choice;
}

/**
 * The planes of a choice; the colour where the image does not have it.
 * @param {LinearImage} image
 * @param {string} choice
 * @param {number[]} background - linear R, G and B behind its colour
 * @returns {Shown}
 */
export function shownOf(image, choice, background) {
  const { planes } = image;
  const layer = layerBehind(choice);
  const names = Object.keys(planes).filter((name) => layer && layerOf(name) === layer);
  if (names.length) {
    const kind = names[0].startsWith("id.") ? "ids" : names.some((name) => name.endsWith(".R")) ? "light" : "data";
    const inOrder = kind === "light" ? COLOUR.map((part) => `${layer}.${part}`) : names;
    return { kind, names: inOrder, planes: inOrder.map((name) => planes[name]) };
  }
  if (choice in planes) return { kind: "light", names: [choice], planes: [planes[choice]] };
  const colour = over(image, background);
  if (choice === "Y") return { kind: "light", names: ["luminance"], planes: [luminance(colour)] };
  return { kind: "light", names: COLOUR, planes: colour };
}

/**
 * The luminance of three planes of light; of one plane, itself.
 * @param {Float32Array[]} planes
 */
export function luminance(planes) {
  if (planes.length === 1) return planes[0];
  const [R, G, B] = planes;
  return R.map((red, at) => WEIGHTS[0] * red + WEIGHTS[1] * G[at] + WEIGHTS[2] * B[at]);
}

/**
 * The colour over a background, where the image has alpha; a pixel whose alpha is not finite is opaque.
 * @param {LinearImage} image
 * @param {number[]} background - linear R, G and B
 */
function over({ planes: { A, ...colour } }, background) {
  return COLOUR.map((name, part) => (!A || !background[part] ? colour[name]
    : colour[name].map((value, at) => value + (Number.isFinite(A[at]) ? 1 - A[at] : 0) * background[part])));
}

/**
 * The least and the greatest finite value of planes; 0 and 0 where there is none.
 * @param {Float32Array[]} planes
 */
export function boundsOf(planes) {
  let [least, most] = [Infinity, -Infinity];
  for (const plane of planes) {
    for (const value of plane) {
      if (!Number.isFinite(value)) continue;
      if (value < least) least = value;
      if (value > most) most = value;
    }
  }
  return least > most ? [0, 0] : [least, most];
}
