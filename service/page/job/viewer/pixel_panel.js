// The values of one pixel in linear light, and the histogram of all: of one image, or of two that are compared.

import { h, table } from "../../shared/dom.js";
import { luminance } from "./channels.js";
import { Histogram } from "./histogram.js";

/** @import { LinearImage } from "./exr.js" */
/** @import { Shown } from "./channels.js" */

/** One of the images: its name, its linear image, what of it is shown, and the exposure at which it is. */
/** @typedef {{ name: string, image: LinearImage, shown: Shown, ev: number }} Inspected */
/** @typedef {{ x: number, y: number }} Pixel  from the left and from the top, in pixels */

const FOUR = new Intl.NumberFormat("en-GB", { maximumSignificantDigits: 5, useGrouping: false });

export class PixelPanel {
  #picked;
  #x;
  #y;
  #head = h("tr");
  #body = h("tbody");
  #histograms = h("div", { class: "histograms" });
  #known = [new Histogram(), new Histogram()];
  /** @type {Inspected[]} */
  #inspected = [];
  element;

  /**
   * @param {() => unknown} opened - called when it is opened or closed
   * @param {(pixel: Pixel) => unknown} picked - called when another pixel is looked at
   */
  constructor(opened, picked) {
    this.#picked = picked;
    const place = (/** @type {string} */ name) =>
      h("input", { type: "number", min: 0, step: 1, value: 0, "aria-label": name, oninput: () => this.#pick() });
    this.#x = place("Pixel from the left");
    this.#y = place("Pixel from the top");
    const values = table("Values of the pixel", [], this.#body);
    values.querySelector("thead")?.replaceChildren(this.#head);
    this.element = h("details", { class: "inspect", ontoggle: opened }, h("summary", {}, "Pixel values and histogram"),
      h("p", { class: "place" }, h("label", {}, "x ", this.#x), h("label", {}, "y ", this.#y),
        h("span", { class: "hint" }, "Point at the image, or type. The values are linear radiance, as in image.exr.")),
      values, this.#histograms);
  }

  get isOpen() {
    return this.element.open;
  }

  /** The pixel that is looked at. @returns {Pixel} */
  get pixel() {
    return { x: Number(this.#x.value), y: Number(this.#y.value) };
  }

  /**
   * Looks at a pixel.
   * @param {Pixel} pixel
   */
  point({ x, y }) {
    this.#x.value = String(x);
    this.#y.value = String(y);
    this.#pick();
  }

  /**
   * Shows the values and the histograms of images of one size.
   * @param {Inspected[]} inspected
   */
  show(inspected) {
    this.#inspected = inspected;
    const size = inspected[0]?.image;
    if (size) [this.#x.max, this.#y.max] = [String(size.width - 1), String(size.height - 1)];
    this.#histograms.replaceChildren(...inspected.map(({ name, shown, ev }, at) => this.#known[at].of(shown, ev, name)));
    this.#values();
  }

  #pick() {
    this.#picked(this.pixel);
    this.#values();
  }

  #values() {
    const { x, y } = this.pixel;
    const rows = this.#inspected.map(({ name, image, shown }) => ({ name, values: valuesAt(image, shown, x, y) }));
    const columns = [...new Set(rows.flatMap(({ values }) => [...values.keys()]))];
    this.#head.replaceChildren(h("td"), ...columns.map((column) => h("th", { scope: "col" }, column)));
    this.#body.replaceChildren(...rows.map(({ name, values }) =>
      h("tr", {}, h("th", { scope: "row" }, name), columns.map((column) => h("td", {}, values.get(column) ?? "–")))));
    if (!rows.length) this.#body.replaceChildren(h("tr", {}, h("td", {}, "Getting the linear image …")));
  }
}

/**
 * A pixel's values by their names: of the colour and alpha, and of a layer if one is shown.
 * @param {LinearImage} image
 * @param {Shown} shown
 * @param {number} x
 * @param {number} y
 * @returns {Map<string, string>}
 */
function valuesAt({ width, height, planes }, shown, x, y) {
  const isInside = Number.isInteger(x) && Number.isInteger(y) && x >= 0 && y >= 0 && x < width && y < height;
  const at = y * width + x;
  const layer = shown.names.filter((name) => name in planes);
  const names = [...new Set([...layer, "R", "G", "B", "A"])].filter((name) => name in planes);
  const [Y] = isInside ? luminance(["R", "G", "B"].map((name) => planes[name].slice(at, at + 1))) : [NaN];
  const all = /** @type {[string, number][]} */ ([...names.map((name) => [name, planes[name][at]]), ["luminance", Y]]);
  return new Map(all.map(([name, value]) => [name, isInside ? said(value) : "–"]));
}

/** @param {number} value */
function said(value) {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  return value !== 0 && Math.abs(value) < 1e-3 ? value.toExponential(3) : FOUR.format(value);
}
