// Fields of a form that stand for a spec: a label, an input, a sentence of help, and what is wrong.

import { h, setText } from "./dom.js";

let count = 0;

export class Field {
  #about;
  #wrong;
  input;

  /** `path` is how the API names the field in its errors. */
  constructor(path, about) {
    this.#about = about;
    this.path = path;
    const id = `field-${(count += 1)}`;
    const { type = "number", min, max, step, maxlength, value, placeholder } = about;
    this.input = h("input", {
      id, type, min: this.#shown(min), max: this.#shown(max), step, maxlength, value: this.#shown(value), placeholder, name: path,
      required: !about.optional, autocomplete: "off",
      "aria-describedby": `${id}-help ${id}-wrong`,
    });
    this.#wrong = h("p", { class: "bad", id: `${id}-wrong`, hidden: true });
    this.element = h("div", { class: "field" },
      h("label", { for: id }, about.label),
      h("span", { class: "with-unit" }, this.input, about.unit && h("span", { class: "unit" }, about.unit)),
      about.help && h("p", { class: "help", id: `${id}-help` }, about.help), this.#wrong);
    this.input.addEventListener("input", () => this.blame(""));
  }

  /** Its value as the spec has it; undefined where it is empty and may be. */
  get value() {
    const { type, scale = 1, optional } = this.#about;
    const text = this.input.value.trim();
    if (optional && text === "") return undefined;
    return type === "text" ? text : rounded(Number(text) * scale);
  }

  /** A value of the spec as the input has it. */
  #shown(value) {
    return typeof value === "number" ? rounded(value / (this.#about.scale ?? 1)) : value;
  }

  /** Says what is wrong with it. */
  blame(message) {
    setText(this.#wrong, message);
    this.#wrong.hidden = !message;
    this.input.setAttribute("aria-invalid", String(Boolean(message)));
  }
}

/** Without the digits that 0.01 as a binary number would add. */
function rounded(value) {
  return Number(value.toPrecision(12));
}

/** The fields of a part of the spec, and their values together. */
export function fieldsOf(path, abouts) {
  const fields = abouts.map((about) => [about.name, new Field(`${path}.${about.name}`, about)]);
  return {
    fields: fields.map(([, field]) => field),
    elements: fields.map(([, field]) => field.element),
    values: () => Object.fromEntries(fields.map(([name, field]) => [name, field.value]).filter(([, value]) => value !== undefined)),
  };
}
