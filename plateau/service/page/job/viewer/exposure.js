// The exposure at which images are looked at, in EV from the one at which they are judged.

import { h, setText, svg } from "../../shared/dom.js";
import { slider } from "./controls.js";

const ID = "exposure";
/** The light of every sRGB code (IEC 61966-2-1). */
const LIGHT = Array.from({ length: 256 }, (_, code) => {
  const encoded = code / 255;
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
});

export class Exposure {
  #changed;
  #slider = slider("Exposure", { min: -6, max: 6, step: 0.1, value: 0 }, () => this.#set());
  #tables = /** @type {const} */ (["feFuncR", "feFuncG", "feFuncB"]).map((name) => svg(name, { type: "table" }));
  #hint = h("p", { class: "hint" });
  element = h("div", { class: "panel" }, this.#slider.label,
    h("button", { class: "quiet", onclick: () => { this.#slider.input.value = "0"; this.#set(); } }, "As judged"), this.#hint,
    svg("svg", { width: 0, height: 0, "aria-hidden": "true" },
      svg("filter", { id: ID, x: 0, y: 0, width: 1, height: 1, "color-interpolation-filters": "sRGB" },
        svg("feComponentTransfer", {}, this.#tables))));

  /** @param {() => unknown} changed */
  constructor(changed) {
    this.#changed = changed;
    this.#say();
  }

  /** The CSS filter that exposes a picture; "none" for what is judged. */
  get filter() {
    return this.#ev ? `url(#${ID})` : "none";
  }

  get #ev() {
    return Number(this.#slider.input.value);
  }

  #set() {
    const codes = LIGHT.map((light) => encoded(light * 2 ** this.#ev).toFixed(5)).join(" ");
    for (const table of this.#tables) table.setAttribute("tableValues", codes);
    this.#say();
    this.#changed();
  }

  #say() {
    const ev = this.#ev;
    setText(this.#slider.output, `${ev > 0 ? "+" : ev < 0 ? "−" : ""}${Math.abs(ev).toFixed(1)} EV`);
    setText(this.#hint, ev ? "From the picture's 8 bits: white areas stay flat, and dark shades show steps. image.exr has all of the light." : "");
  }
}

/** @param {number} light */
function encoded(light) {
  return light <= 0.0031308 ? 12.92 * light : Math.min(1, 1.055 * light ** (1 / 2.4) - 0.055);
}
