// The scale of a map in false colours: what its colours mean.

import { h, setText } from "../../shared/dom.js";

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
