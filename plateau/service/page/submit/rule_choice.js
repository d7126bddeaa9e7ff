// The choice of the rule that ends a job, and of those that are watched beside it.

import { h } from "../shared/dom.js";
import { fieldsOf } from "../shared/form_fields.js";
import { fieldIn, parametersOf, RULES, watchable } from "../shared/rules.js";

/** @import { RuleAbout } from "../shared/rules.js" */

export class RuleChoice {
  #rules = RULES.map((rule) => this.#choice(rule));
  /** @type {Api.JobSpec["watch"]} */
  #watch = [];
  #chosen = this.#rules.find((rule) => rule.default) ?? this.#rules[0];
  element = h("div", { class: "choices", role: "radiogroup", "aria-label": "The rule that ends it" },
    this.#rules.filter(({ featured }) => featured).map(({ element }) => element),
    h("details", {}, h("summary", {}, "Other rules"),
      h("div", { class: "choices" }, this.#rules.filter(({ featured }) => !featured).map(({ element }) => element))));
  watched = h("fieldset", { class: "watch" },
    h("legend", {}, "Rules to watch beside it: they stop nothing, and mark the curve where they would have"),
    watchable(this.#rules).map(({ watch, title }) => h("label", { class: "toggle" }, watch, title)));

  constructor() {
    this.#choose(this.#chosen.name);
  }

  /** The fields of the chosen rule. */
  get fields() {
    return this.#chosen.fields;
  }

  /** The parts of the spec that it is. A rule that a filled in spec watches keeps its parameters. */
  values() {
    const { name, values } = this.#chosen;
    const watched = this.#rules.filter(({ watch }) => watch.checked && !watch.disabled);
    return {
      rule: { name, ...values() },
      watch: watched.map((one) => this.#watch.find((had) => had.name === one.name) ?? { name: one.name }),
    };
  }

  /**
   * Takes the rules of a job.
   * @param {Api.JobSpec} spec
   */
  fill({ rule, watch }) {
    this.take({ ...parametersOf(rule), name: rule.name });
    this.#watch = watch;
    for (const one of this.#rules) one.watch.checked = watch.some(({ name }) => name === one.name);
  }

  /**
   * Takes a rule with these parameters; the others have their defaults.
   * @param {{ name: string } & Record<string, string | number>} rule
   */
  take({ name, ...parameters }) {
    this.#choose(name);
    for (const field of this.#chosen.fields) {
      const about = this.#chosen.abouts.find((one) => one.name === field.name);
      field.fill(Number(parameters[field.name] ?? about?.value));
    }
    this.#chosen.element.closest("details")?.setAttribute("open", "");
  }

  /**
   * A rule with its radio button and fields, and the checkbox that watches it.
   * @param {RuleAbout} rule
   */
  #choice(rule) {
    const { name, title, help } = rule;
    const { fields, elements, values } = fieldsOf("spec.rule", rule.fields);
    const inside = h("div", { class: "fields small" }, elements);
    const radio = h("input", { type: "radio", name: "rule", value: name, onchange: () => this.#choose(name) });
    const watch = h("input", { type: "checkbox", checked: Boolean(fieldIn("slope", rule)) });
    const element = h("div", { class: "choice", "data-rule": name },
      h("label", {}, radio, h("span", {}, h("b", {}, title), h("span", { class: "help" }, help))), inside);
    return { ...rule, abouts: rule.fields, fields, values, inside, radio, watch, element };
  }

  /** @param {string} name */
  #choose(name) {
    for (const choice of this.#rules) {
      const isChosen = choice.name === name;
      if (isChosen) this.#chosen = choice;
      choice.radio.checked = isChosen;
      choice.inside.hidden = !isChosen;
      choice.watch.disabled = isChosen;
    }
  }
}
