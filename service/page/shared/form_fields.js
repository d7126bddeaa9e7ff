// Fields of a form that stand for a spec: a label, an input, a sentence of help, and what is wrong.

import { Problem } from "./api.js";
import { h, setText } from "./dom.js";

/**
 * What a field asks for: a value of the spec, its bounds and what is said of it. The input shows the
 * value divided by `scale`.
 * @typedef {object} FieldAbout
 * @property {string} name
 * @property {string} label
 * @property {"number" | "text"} [type]
 * @property {number | string} [value]
 * @property {string} [unit]
 * @property {string} [help]
 * @property {number} [scale]
 * @property {number} [min]
 * @property {number} [max]
 * @property {number | "any"} [step]
 * @property {number} [maxlength]
 * @property {string} [placeholder]
 * @property {boolean} [optional]
 */

let count = 0;

export class Field {
  #about;
  #wrong;
  input;

  /**
   * @param {string} part - how the API names that part of the spec in its errors
   * @param {FieldAbout} about
   */
  constructor(part, about) {
    this.#about = about;
    this.path = `${part}.${about.name}`;
    this.name = about.name;
    const id = `field-${(count += 1)}`;
    const { type = "number", min, max, step, maxlength, value, placeholder } = about;
    this.input = h("input", {
      id, type, min: this.#shown(min), max: this.#shown(max), step, maxlength, value: this.#shown(value), placeholder, name: this.path,
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

  /**
   * A value of the spec as the input has it.
   * @param {number | string | undefined} value
   */
  #shown(value) {
    return typeof value === "number" ? rounded(value / (this.#about.scale ?? 1)) : value;
  }

  /**
   * Says what is wrong with it; "" where nothing is.
   * @param {string} message
   */
  blame(message) {
    setText(this.#wrong, message);
    this.#wrong.hidden = !message;
    this.input.setAttribute("aria-invalid", String(Boolean(message)));
  }
}

/**
 * Without the digits that 0.01 as a binary number would add.
 * @param {number} value
 */
function rounded(value) {
  return Number(value.toPrecision(12));
}

/**
 * The fields of a part of the spec, and their values together.
 * @param {string} part
 * @param {FieldAbout[]} abouts
 */
export function fieldsOf(part, abouts) {
  const fields = abouts.map((about) => new Field(part, about));
  return { fields, elements: fields.map((field) => field.element), values: () => valuesOf(fields) };
}

/**
 * The values of fields by their names, without those that are empty and may be.
 * @param {Field[]} fields
 * @returns {Record<string, string | number>}
 */
export function valuesOf(fields) {
  return Object.fromEntries(fields.flatMap(({ name, value }) => (value === undefined ? [] : [[name, value]])));
}

/**
 * Shows at each field what the API refused of it; returns the fields that it named.
 * @param {Field[]} fields
 * @param {unknown} error
 */
export function blame(fields, error) {
  const errors = error instanceof Problem ? error.details.errors ?? [] : [];
  const named = new Map(errors.map(({ field, message }) => [field, message]));
  for (const field of fields) field.blame(named.get(field.path) ?? "");
  return fields.filter(({ path }) => named.has(path));
}
