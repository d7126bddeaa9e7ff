// One job for each value of a parameter of the scene: the frames of a sequence.

import { h, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { Field, valuesOf } from "../shared/form_fields.js";

/** @import { FieldAbout } from "../shared/form_fields.js" */

/** @type {FieldAbout} */
const NUMBER = { name: "", label: "", value: "", step: "any", optional: true };

/** The most jobs of a batch. */
const MOST = 1000;

export class Frames {
  #name = h("select", { id: "frames-of", onchange: () => this.#say() });
  #fields = [
    new Field("frames", { ...NUMBER, name: "first", label: "From" }),
    new Field("frames", { ...NUMBER, name: "last", label: "To, included" }),
    new Field("frames", { ...NUMBER, name: "by", label: "In steps of", value: 1 }),
  ];
  #said = h("p", { class: "hint", role: "status" });
  element = h("details", { class: "frames", hidden: true, oninput: () => this.#say() }, h("summary", {}, "Frames: a job for each value of one of them"),
    h("div", { class: "fields small" },
      h("div", { class: "field" }, h("label", { for: this.#name.id }, "Parameter"), h("span", { class: "with-unit" }, this.#name)),
      this.#fields.map(({ element }) => element)),
    this.#said);

  /**
   * Offers the parameters of a scene.
   * @param {string[]} names
   */
  offer(names) {
    const chosen = this.#name.value;
    this.element.hidden = !names.length;
    this.#name.replaceChildren(h("option", { value: "" }, "none: one job"), ...names.map((name) => h("option", { value: name }, name)));
    this.#name.value = names.includes(chosen) ? chosen : "";
    this.#say();
  }

  /**
   * The parameters of each job; of one job, where no frames are asked for.
   * @param {Record<string, unknown>} parameters
   */
  of(parameters) {
    const values = this.#values();
    return values ? values.map((value) => ({ ...parameters, [this.#name.value]: value })) : parameters;
  }

  /** The values of the parameter; null where there are no frames. */
  #values() {
    const { first, last, by } = /** @type {Record<string, number>} */ (valuesOf(this.#fields));
    if (!this.#name.value || first === undefined || last === undefined || !(by > 0) || last < first) return null;
    const count = Math.floor((last - first) / by + 1e-9) + 1;
    if (count > MOST) return null;
    return Array.from({ length: count }, (_, at) => Number((first + at * by).toPrecision(12)));
  }

  #say() {
    const values = this.#values();
    const asked = this.#name.value ? `Say where the values begin and end, upwards: at most ${MOST} of them.` : "";
    setText(this.#said, values ? `${several(values.length, "job")}, in one batch.` : asked);
  }

  /** Whether frames are asked for, and cannot be counted. */
  get isUnclear() {
    return Boolean(this.#name.value) && !this.#values();
  }
}
