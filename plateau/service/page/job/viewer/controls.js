// Parts of the viewer: sliders, and the scale of a map in false colours.

import { h, setText } from "../../shared/dom.js";

/**
 * A slider with its name and its value.
 * @param {string} name
 * @param {{ min: number, max: number, step: number, value: number }} attributes
 * @param {() => void} act
 */
export function slider(name, attributes, act) {
  const input = h("input", { type: "range", ...attributes, oninput: act });
  const output = h("output");
  return { input, output, label: h("label", { class: "slider" }, h("span", {}, name), input, output) };
}

/** What the colours of a map mean. */
export class ScaleBar {
  #ends = [h("output"), h("output"), h("output")];
  element = h("span", { class: "scale" }, h("span", { class: "viridis" }), this.#ends);

  /** @param {string[]} texts - at its left end, in its middle, and at its right end */
  constructor(texts) {
    this.show(texts);
  }

  /** @param {string[]} texts */
  show(texts) {
    texts.forEach((text, at) => setText(this.#ends[at], text));
  }
}
