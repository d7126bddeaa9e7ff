// How light is looked at: its exposure, one of its channels, and false colours.

import { h, setText } from "../../shared/dom.js";
import { three } from "../../shared/figures.js";
import { boundsOf, choicesOf, layerBehind } from "./channels.js";
import { ScaleBar } from "./scale_bar.js";
import { slider } from "./slider.js";
import { FALSE_EV } from "./tone_mapping.js";

/** @import { Shown } from "./channels.js" */
/** @import { Colour } from "./tone_mapping.js" */

/**
 * @typedef {object} Look
 * @property {number} ev - relative to the exposure at which the image is judged
 * @property {string} choice - of channels; "" is the colour
 * @property {Colour[] | null} palette - the false colours, if it is by them
 */

/** As the job's display shows it. @type {Look} */
export const AS_JUDGED = { ev: 0, choice: "", palette: null };

/**
 * Whether a picture shows it, without the linear image.
 * @param {Look} look
 */
export function isAsJudged({ ev, choice, palette }) {
  return ev === 0 && choice === "" && !palette;
}

export class LookPanel {
  #changed;
  #exposure = slider("Exposure", { min: -6, max: 6, step: 0.1, value: 0 }, () => this.#changed());
  #channel = h("select", { onchange: () => this.#changed() });
  #isFalse = h("input", { type: "checkbox", onchange: () => this.#changed() });
  #scale = new ScaleBar();
  #doubt = h("p", { class: "hint" });
  element = h("div", { class: "panel" }, this.#exposure.label,
    h("label", {}, h("span", {}, "Channel"), this.#channel),
    h("label", { class: "toggle" }, this.#isFalse, "False colour"),
    h("button", { class: "quiet", onclick: () => this.#reset() }, "As judged"),
    this.#scale.element, this.#doubt);

  /** @param {() => unknown} changed */
  constructor(changed) {
    this.#changed = changed;
    this.offer(["R", "G", "B"]);
  }

  /** @returns {Look} */
  get look() {
    return {
      ev: Number(this.#exposure.input.value), choice: this.#channel.value,
      palette: this.#isFalse.checked ? this.#scale.palette() : null,
    };
  }

  /** The layer that has to be read; "" for light. */
  get layer() {
    return layerBehind(this.#channel.value);
  }

  /**
   * Offers the channels of an image.
   * @param {string[]} channels
   */
  offer(channels) {
    const choices = choicesOf(channels);
    const offered = [...this.#channel.options].map(({ value }) => value);
    if (offered.join() === choices.map(([value]) => value).join()) return;
    const chosen = this.#channel.value;
    this.#channel.replaceChildren(...choices.map(([value, title]) => h("option", { value }, title)));
    this.#channel.value = choices.some(([value]) => value === chosen) ? chosen : "";
  }

  /**
   * Says what the colours mean.
   * @param {Shown | null} shown - null while a picture is shown
   * @param {string} doubt
   */
  explain(shown, doubt) {
    const { ev, palette } = this.look;
    const sign = ev > 0 ? "+" : ev < 0 ? "−" : "";
    setText(this.#exposure.output, `${sign}${Math.abs(ev).toFixed(1)} EV`);
    this.#scale.element.hidden = !palette;
    setText(this.#doubt, [meaning(shown), doubt].filter(Boolean).join(" "));
    if (!shown || shown.kind === "light") {
      const { least, most } = FALSE_EV;
      this.#scale.show([`white − ${-least} EV`, `− ${-(least + most) / 2} EV`, `+ ${most} EV`]);
    } else if (shown.planes.length === 1) {
      const [least, most] = boundsOf(shown.planes);
      this.#scale.show([least, (least + most) / 2, most].map(three));
    }
    if (shown && (shown.kind === "ids" || (shown.kind === "data" && shown.planes.length > 1))) this.#scale.element.hidden = true;
  }

  #reset() {
    this.#exposure.input.value = "0";
    this.#channel.value = "";
    this.#isFalse.checked = false;
    this.#changed();
  }
}

/** @param {Shown | null} shown */
function meaning(shown) {
  if (!shown || shown.kind === "light") return "";
  if (shown.kind === "ids") return "Each id has a colour of its own.";
  const [least, most] = boundsOf(shown.planes).map(three);
  const parts = shown.planes.length > 1 ? `, ${shown.names.join(", ")} as red, green${shown.planes.length > 2 ? ", blue" : ""}` : "";
  return `From ${least} (dark) to ${most} (bright)${parts}.`;
}
