// The scale of the map of the quality, as `metric.heat_map` draws it.

import { h } from "../../shared/dom.js";
import { ScaleBar } from "./scale_bar.js";

export class QualityScale {
  #bar = new ScaleBar();
  element = h("div", { class: "panel" }, this.#bar.element,
    h("span", { class: "hint" }, "What a person would see of the noise, by ColorVideoVDP. 1 JOD: three of four people prefer the converged image."));

  constructor() {
    this.#bar.show(["nothing", "1.5 JOD", "3 JOD and more"]);
  }
}
