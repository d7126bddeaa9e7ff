// The scale of a map in false colours: what its colours mean.

import { h, setText } from "../../shared/dom.js";

/** @import { Colour } from "./tone_mapping.js" */

export class ScaleBar {
  #ends = [h("output"), h("output"), h("output")];
  #colours = h("span", { class: "viridis" });
  element = h("span", { class: "scale" }, this.#colours, this.#ends);

  /**
   * Shows what is at its left end, in its middle, and at its right end.
   * @param {string[]} texts
   */
  show(texts) {
    texts.forEach((text, at) => setText(this.#ends[at], text));
  }

  /** Its colours from left to right, as its style has them; the bar must be in the document. */
  palette() {
    const { backgroundImage } = getComputedStyle(this.#colours);
    return [...backgroundImage.matchAll(/rgb\((\d+), (\d+), (\d+)\)/g)].map(([, ...parts]) => /** @type {Colour} */ (parts.map(Number)));
  }
}
