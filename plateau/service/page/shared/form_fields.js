// Fields of a form for a spec: a label, an input, a sentence of help, and an error.

import { Problem } from "./api.js";
import { h, setText } from "./dom.js";

/**
 * A field's value in the spec, its bounds and its texts. The input shows the value divided by `scale`;
 * `choices` have their titles, the names of a list are separated by commas, and a flag is a box to tick.
 * @typedef {object} FieldAbout
 * @property {string} name
 * @property {string} label
 * @property {"number" | "text" | "names" | "choice" | "flag"} [type]
 * @property {Record<string, string>} [choices]
 * @property {number | string | boolean} [value]
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

/** @typedef {number | string | boolean | (string | number)[] | null | undefined} FieldValue */

let count = 0;

export class Field {
  #about;
  #wrong;
  input;

  /**
   * @param {string} part - the API's name for the part of the spec, in its errors
   * @param {FieldAbout} about
   */
  constructor(part, about) {
    this.#about = about;
    this.path = `${part}.${about.name}`;
    this.name = about.name;
    const id = `field-${(count += 1)}`;
    const { type = "number", choices, min, max, step, maxlength, value, placeholder } = about;
    const named = { id, name: this.path, "aria-describedby": `${id}-help ${id}-wrong` };
    /** @type {HTMLInputElement | HTMLSelectElement} */
    this.input = choices
      ? h("select", named, Object.entries(choices).map(([one, title]) => h("option", { value: one, selected: one === value }, title)))
      : type === "flag" ? h("input", { ...named, type: "checkbox", checked: value === true }) : h("input", {
        ...named, type: type === "number" ? type : "text", min: this.#shown(min), max: this.#shown(max), step, maxlength,
        value: this.#shown(value), placeholder, required: !about.optional, autocomplete: "off",
      });
    this.#wrong = h("p", { class: "bad", id: `${id}-wrong`, hidden: true });
    this.element = h("div", { class: "field" },
      h("label", { for: id }, about.label),
      h("span", { class: "with-unit" }, this.input, about.unit && h("span", { class: "unit" }, about.unit)),
      about.help && h("p", { class: "help", id: `${id}-help` }, about.help), this.#wrong);
    this.input.addEventListener("input", () => this.blame(""));
  }

  /** The value for the spec; undefined if the field is optional and empty. */
  get value() {
    const { type, scale = 1, optional } = this.#about;
    if (type === "flag") return /** @type {HTMLInputElement} */ (this.input).checked;
    const text = this.input.value.trim();
    if (optional && text === "") return undefined;
    if (type === "names") return text.split(",").map((one) => one.trim()).filter(Boolean);
    return type === "text" || type === "choice" ? text : rounded(Number(text) * scale);
  }

  /**
   * Shows another value of the spec; undefined is the default.
   * @param {FieldValue} value
   */
  fill(value = this.#about.value) {
    this.blame("");
    if (this.#about.type === "flag") /** @type {HTMLInputElement} */ (this.input).checked = value === true;
    else this.input.value = String(Array.isArray(value) ? value.join(", ") : this.#shown(value ?? ""));
  }

  /**
   * A value of the spec as the input shows it.
   * @param {number | string | boolean | undefined} value
   */
  #shown(value) {
    return typeof value === "number" ? rounded(value / (this.#about.scale ?? 1)) : value;
  }

  /**
   * Shows an error; "" removes it.
   * @param {string} message
   */
  blame(message) {
    setText(this.#wrong, message);
    this.#wrong.hidden = !message;
    this.input.setAttribute("aria-invalid", String(Boolean(message)));
  }
}

/**
 * The number without the rounding errors of binary fractions.
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
  return {
    fields,
    elements: fields.map((field) => field.element),
    values: () => valuesOf(fields),
    /** Shows the values of a part of a spec; fields without one have their defaults. @param {object} spec */
    fill: (spec) => {
      for (const field of fields) field.fill(/** @type {Record<string, FieldValue>} */ (spec)[field.name]);
    },
  };
}

/**
 * The values of fields by name, without empty optional ones.
 * @param {Field[]} fields
 * @returns {Record<string, string | number | boolean | string[]>}
 */
export function valuesOf(fields) {
  return Object.fromEntries(fields.flatMap(({ name, value }) => (value === undefined ? [] : [[name, value]])));
}

/**
 * Shows the API's errors at their fields; returns those fields.
 * @param {Field[]} fields
 * @param {unknown} error
 */
export function blame(fields, error) {
  const errors = error instanceof Problem ? error.details.errors ?? [] : [];
  const named = new Map(errors.map(({ field, message }) => [field, message]));
  // An error of a list names the place in it.
  const wrong = (/** @type {Field} */ { path }) => named.get(path) ?? [...named].find(([name]) => name.startsWith(`${path}.`))?.[1];
  for (const field of fields) field.blame(wrong(field) ?? "");
  return fields.filter(wrong);
}
