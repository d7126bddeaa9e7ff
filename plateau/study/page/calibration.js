// Questions to an observer about what a browser cannot measure: the size and distance of a pixel.

import { h, setText } from "../shared/dom.js";
import { three } from "../shared/figures.js";

/** A bank card (ISO/IEC 7810 ID-1). */
const CARD_MM = { width: 85.6, height: 53.98 };
/** The nominal size of a CSS pixel. */
const CSS_PX_PER_MM = 96 / 25.4;
/** The sRGB code of half the light of white. */
const HALF_GREY = 188;
const PATCH = { width: 240, height: 72 };

export class Calibration {
  #distance = h("input", { id: "distance", type: "number", min: 10, max: 1000, step: "any", value: 60, required: true, "aria-describedby": "distance-help" });
  #size = h("input", { id: "card-size", type: "range", min: 120, max: 900, step: 0.5, value: CARD_MM.width * CSS_PX_PER_MM, "aria-describedby": "card-help" });
  #matched = h("input", { type: "checkbox", required: true });
  #gamma = h("select", { id: "gamma", "aria-describedby": "gamma-help" },
    h("option", { value: "" }, "I have not looked"),
    h("option", { value: "true" }, "Both halves look equally bright"),
    h("option", { value: "false" }, "One half is clearly brighter"));
  #card = h("div", { class: "card", "aria-hidden": "true" }, h("span", {}, "your card"));
  #said = h("p", { class: "summary", role: "status" });
  element = h("div", { class: "calibration" },
    h("fieldset", {},
      h("legend", {}, "Your screen"),
      h("p", { class: "help", id: "card-help" }, "Hold a bank card flat against the rectangle, and make the rectangle exactly as wide as the card. The arrow keys change it in small steps."),
      this.#card,
      h("div", { class: "field" }, h("label", { for: "card-size" }, "Width of the rectangle"), this.#size),
      h("label", { class: "check" }, this.#matched, "The rectangle is as wide as my card")),
    h("fieldset", {},
      h("legend", {}, "Your seat"),
      h("div", { class: "field" }, h("label", { for: "distance" }, "From your eyes to the screen"),
        h("span", { class: "with-unit" }, this.#distance, h("span", { class: "unit" }, "cm")),
        h("p", { class: "help", id: "distance-help" }, "Measure this distance, and keep it until the end.")),
      this.#said),
    h("fieldset", {},
      h("legend", {}, "Your screen's greys"),
      patch(),
      h("div", { class: "field" }, h("label", { for: "gamma" }, "Seen from a step further away, or with half-closed eyes"), this.#gamma,
        h("p", { class: "help", id: "gamma-help" }, "Fine lines of black and white give off half as much light as white. On a screen that shows sRGB, so does the grey beside them."))),
    h("p", { class: "note" }, "A browser cannot know your screen's brightness, contrast or colours. Switch off night modes and automatic brightness, set the screen to sRGB if you can, keep lamps and windows from shining on it, and leave the page's zoom as it is."));

  constructor() {
    this.#size.addEventListener("input", () => this.#show());
    this.#distance.addEventListener("input", () => this.#show());
    this.#show();
  }

  /** The screen as the API takes it. */
  get screen() {
    const pitch = CARD_MM.width / (this.#size.valueAsNumber * devicePixelRatio);
    return {
      viewing_distance_cm: this.#distance.valueAsNumber,
      pixel_pitch_mm: Number(pitch.toPrecision(5)),
      gamma_matches: this.#gamma.value === "" ? null : this.#gamma.value === "true",
    };
  }

  #show() {
    const width = this.#size.valueAsNumber;
    this.#card.style.width = `${width}px`;
    this.#card.style.height = `${(width * CARD_MM.height) / CARD_MM.width}px`;
    const { viewing_distance_cm: distance, pixel_pitch_mm: pitch } = this.screen;
    const perDegree = (2 * distance * 10 * Math.tan(Math.PI / 360)) / pitch;
    setText(this.#said, distance > 0 ? `${three(perDegree)} pixels in a degree of your visual field` : "");
  }
}

/** Lines one screen pixel wide, beside the grey that should look equally bright. */
function patch() {
  const canvas = h("canvas", { class: "patch", role: "img", "aria-label": "Fine lines at the left, plain grey at the right" });
  const scale = devicePixelRatio;
  [canvas.width, canvas.height] = [Math.round(PATCH.width * scale), Math.round(PATCH.height * scale)];
  canvas.style.width = `${canvas.width / scale}px`;
  canvas.style.height = `${canvas.height / scale}px`;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const half = Math.round(canvas.width / 2);
  for (let row = 0; row < canvas.height; row += 1) {
    context.fillStyle = row % 2 ? "#fff" : "#000";
    context.fillRect(0, row, half, 1);
  }
  context.fillStyle = `rgb(${HALF_GREY}, ${HALF_GREY}, ${HALF_GREY})`;
  context.fillRect(half, 0, canvas.width - half, canvas.height);
  return canvas;
}
