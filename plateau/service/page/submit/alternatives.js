// A part of the spec that is one of several, each with fields of its own: a rule, an allocation, a denoiser.

import { h } from "../shared/dom.js";
import { fieldsOf } from "../shared/form_fields.js";

/** @import { FieldAbout } from "../shared/form_fields.js" */
/** @typedef {{ name: string, title: string, help: string, fields?: FieldAbout[], isRare?: boolean }} Alternative */

export class Alternatives {
  #part;
  #all;
  element;

  /**
   * @param {string} part - the field of the spec
   * @param {string} label
   * @param {Alternative[]} alternatives - the rare ones are folded away
   * @param {string | undefined} chosen
   */
  constructor(part, label, alternatives, chosen) {
    this.#part = part;
    this.#all = alternatives.map(({ name, title, help, fields = [], isRare = false }) => {
      const own = fieldsOf(`spec.${part}`, fields);
      const radio = h("input", { type: "radio", name: part, value: name, checked: name === chosen, onchange: () => this.#show() });
      const inside = h("div", { class: "fields small" }, own.elements);
      const element = h("div", { class: "choice", "data-name": name },
        h("label", {}, radio, h("span", {}, h("b", {}, title), h("span", { class: "help" }, help))), inside);
      return { name, own, radio, inside, element, isRare };
    });
    const rare = this.#all.filter((one) => one.isRare).map(({ element }) => element);
    this.element = h("div", { class: "choices", role: "radiogroup", "aria-label": label },
      this.#all.filter((one) => !one.isRare).map(({ element }) => element),
      rare.length > 0 && h("details", {}, h("summary", {}, "Others"), h("div", { class: "choices" }, rare)));
    this.#show();
  }

  get #chosen() {
    return this.#all.find(({ radio }) => radio.checked) ?? this.#all[0];
  }

  #show() {
    for (const { radio, own, inside } of this.#all) inside.hidden = !radio.checked || !own.fields.length;
  }

  /** The fields of the chosen one. */
  get fields() {
    return this.#chosen.own.fields;
  }

  /** The part of the spec that it is. */
  values() {
    return { [this.#part]: { name: this.#chosen.name, ...this.#chosen.own.values() } };
  }

  /**
   * Takes one with these values; its other fields have their defaults.
   * @param {{ name: string }} wanted
   */
  fill(wanted) {
    for (const { name, radio } of this.#all) radio.checked = name === wanted.name;
    this.#chosen.own.fill(wanted);
    this.#chosen.element.closest("details")?.setAttribute("open", "");
    this.#show();
  }
}
