// The scales of the maps in false colours: what their colours mean.

import { h, setText } from "../../shared/dom.js";
import { whole } from "../../shared/figures.js";

const LATIN = new TextDecoder("latin1");

class ScaleBar {
  #ends = [h("output"), h("output"), h("output")];
  element = h("span", { class: "scale" }, h("span", { class: "viridis" }), this.#ends);

  /**
   * Shows what is at its left end, in its middle, and at its right end.
   * @param {string[]} texts
   */
  show(texts) {
    texts.forEach((text, at) => setText(this.#ends[at], text));
  }
}

/** The panel of the map of the quality, as `metric.heat_map` draws it. */
export function qualityPanel() {
  const bar = new ScaleBar();
  bar.show(["nothing", "1.5 JOD", "3 JOD and more"]);
  return h("div", { class: "panel" }, bar.element,
    h("span", { class: "hint" }, "What a person would see of the noise, by ColorVideoVDP. 1 JOD: three of four people prefer the converged image."));
}

/** The panel of the map of samples. */
export class SamplesScale {
  #bar = new ScaleBar();
  #hint = h("span", { class: "hint" });
  element = h("div", { class: "panel" }, this.#bar.element, this.#hint);

  /**
   * Shows the scale of a map: its file says where it ends.
   * @param {Blob} map
   */
  async show(map) {
    const texts = await textsOf(map);
    const [least, most] = ["spp_min", "spp_max"].map((name) => Number(texts.get(`plateau:${name}`)));
    this.#bar.element.hidden = least === most;
    this.#bar.show([`${whole(least)} spp`, whole(Math.sqrt(least * most)), `${whole(most)} spp`]);
    setText(this.#hint, least === most ? `All zones have ${whole(least)} spp.` : "Equal steps of colour are equal ratios.");
  }
}

/**
 * The text chunks of a PNG file, by keyword.
 * @param {Blob} file
 */
async function textsOf(file) {
  const view = new DataView(await file.arrayBuffer());
  const text = (/** @type {number} */ at, /** @type {number} */ length) => LATIN.decode(new Uint8Array(view.buffer, at, length));
  /** @type {Map<string, string>} */
  const found = new Map();
  for (let at = 8; at < view.byteLength; at += 12 + view.getUint32(at)) {
    if (text(at + 4, 4) !== "tEXt") continue;
    const [keyword, said] = text(at + 8, view.getUint32(at)).split("\0");
    found.set(keyword, said);
  }
  return found;
}
