// The scales of the maps in false colours: what their colours mean.

import { h, setText } from "../../shared/dom.js";
import { whole } from "../../shared/figures.js";

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

  /** @param {Api.JobView} job */
  show({ spp, spp_min, spp_max }) {
    const [least, most] = [spp_min ?? spp, spp_max ?? spp];
    this.#bar.element.hidden = least === most;
    this.#bar.show([`${whole(least)} spp`, whole(Math.sqrt(least * most)), `${whole(most)} spp`]);
    setText(this.#hint, least === most ? `All zones have ${whole(least)} spp.` : "Equal steps of colour are equal ratios.");
  }
}
