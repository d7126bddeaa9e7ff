// A judgement by zones of the image, as a map over it.

import { setText, svg } from "../../shared/dom.js";
import { percent } from "../../shared/figures.js";
import { ruleWith } from "../../shared/job_summary.js";
import { fieldIn, RULES, valueIn } from "../../shared/rules.js";

const BLOCK = 16;
const STRONGEST = 0.75;
const WORDS = {
  estimate_fraction: "noise left in each zone; the colour says how it compares with the target of the whole image",
  visible_fraction: "share of each zone's pixels that have changed since the first image",
};

export class ZoneMap {
  #measure = "estimate_fraction";
  #job = null;
  #point = null;
  element = svg("svg", { class: "layer zones", role: "img", hidden: true });

  show(job, point) {
    this.#job = job;
    this.#point = point;
    this.#draw();
  }

  /** Shows the other measure of a point's zones. */
  measure(name) {
    this.#measure = name;
    this.#draw();
  }

  caption() {
    return this.#fractions() ? WORDS[this.#measure] : "no zone has been judged yet";
  }

  #fractions() {
    return this.#point?.zones?.[this.#measure] ?? null;
  }

  /**
   * How strong a zone's colour is, by its fraction and its number of pixels.
   *
   * Noise is measured by what the target allows the whole image: none is seen below a tenth of that,
   * and the colour is full at ten times it. So a few pixels in an image that may stop are
   * faint, and the map fades as the image converges, which one that is scaled by its own maximum
   * never does.
   */
  #strength() {
    if (this.#measure === "visible_fraction") return (fraction) => STRONGEST * Math.sqrt(fraction);
    const { width, height } = this.#job;
    const rule = ruleWith("noise_target", this.#job);
    // A job without such a rule is measured by what the default rule allows.
    const target = rule ? valueIn("noise_target", rule) : fieldIn("noise_target", RULES.find((one) => one.default)).value;
    const allowed = target * width * height;
    return (fraction, pixels) => {
      const decades = Math.log10((fraction * pixels) / allowed);
      return STRONGEST * Math.min(1, Math.max(0, (decades + 1) / 2));
    };
  }

  #draw() {
    const fractions = this.#fractions();
    const { width, height } = this.#job;
    this.element.replaceChildren();
    if (!fractions || !width) return;
    this.element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.element.setAttribute("preserveAspectRatio", "none");
    const [rows, columns] = [edges(height, fractions.length), edges(width, fractions[0].length)];
    const strength = this.#strength();
    const size = Math.min(height / fractions.length / 4, width / fractions[0].length / 5.5);
    const title = svg("title");
    setText(title, `Zones from the top: ${fractions.map((row) => row.map(percent).join(", ")).join("; ")}`);
    this.element.append(title);
    fractions.forEach((row, r) => row.forEach((fraction, c) => {
      const [x, y] = [columns[c], rows[r]];
      const [w, hgt] = [columns[c + 1] - x, rows[r + 1] - y];
      this.element.append(
        svg("rect", { x, y, width: w, height: hgt, "fill-opacity": strength(fraction, w * hgt).toFixed(3) }),
        svg("text", { x: x + w / 2, y: y + hgt / 2, "font-size": size, "stroke-width": size / 6, "aria-hidden": "true" },
          percent(fraction)));
    }));
  }
}

/** Where zones begin and end along a line of pixels: what metric.zone_edges does. */
function edges(size, zones) {
  const blocks = Math.ceil(size / BLOCK);
  const starts = Array.from({ length: zones }, (_, zone) => Math.floor((blocks * zone) / zones) * BLOCK);
  return [...starts, size];
}
