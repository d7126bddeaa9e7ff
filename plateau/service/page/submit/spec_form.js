// The fields of a job's spec, but for the scene's parameters.

import { h } from "../shared/dom.js";
import { Field, fieldsOf } from "../shared/form_fields.js";
import { say } from "../shared/notices.js";
import { AOVS, EXR, LIMITS, MORE, NOTICE, PLACES, VIEW, WORKERS } from "../shared/spec_fields.js";
import { AllocationChoice } from "./allocation_choice.js";
import { DenoiseChoice } from "./denoise_choice.js";
import { RuleChoice } from "./rule_choice.js";

/** @type {Record<string, string>} */
const TITLES = { desk: "on a desk", phone: "on a phone", cinema: "in a cinema" };

export class SpecForm {
  rule = new RuleChoice();
  #allocation = new AllocationChoice();
  #denoise = new DenoiseChoice();
  #view = fieldsOf("spec.view", VIEW);
  #limits = fieldsOf("spec", LIMITS);
  #more = fieldsOf("spec", MORE);
  #workers = fieldsOf("spec", WORKERS);
  #notice = fieldsOf("spec.notice", NOTICE);
  #exr = fieldsOf("spec.exr", EXR);
  #aovs = Object.keys(AOVS).map((name) => h("input", { type: "checkbox", value: name }));
  #background = new Field("spec.view", { name: "background", label: "Background", type: "text", value: "", placeholder: "0, 0, 0", optional: true,
    help: "Linear red, green and blue behind an image with alpha, where it is judged and shown." });
  #keep = h("input", { type: "checkbox", id: "keep-slices" });
  /** What of a filled in spec has no field. */
  #kept = {};
  /** @type {Partial<Api.JobSpec["view"]>} */
  #keptView = {};
  elements;
  #details;

  /** @param {HTMLElement} presets - shown above the rules */
  constructor(presets) {
    this.elements = [
      h("fieldset", {}, h("legend", {}, "When is it done?"), presets, this.rule.element),
      this.#allocation.element,
      this.#denoise.element,
      h("fieldset", {}, h("legend", {}, "How is it viewed?"), this.#places(), h("div", { class: "fields" }, this.#view.elements)),
      h("fieldset", {}, h("legend", {}, "Limits"), h("div", { class: "fields" }, this.#limits.elements)),
      (this.#details = h("details", {}, h("summary", {}, "More"),
        h("div", { class: "fields" }, this.#more.elements, this.#background.element),
        h("fieldset", {}, h("legend", {}, "Who renders it?"), h("div", { class: "fields small" }, this.#workers.elements)),
        h("fieldset", {}, h("legend", {}, "Who hears of its end?"), h("div", { class: "fields" }, this.#notice.elements)),
        h("fieldset", { class: "watch" }, h("legend", {}, "Besides colour, image.exr has"),
          Object.values(AOVS).map((title, place) => h("label", { class: "toggle" }, this.#aovs[place], title))),
        h("div", { class: "fields small" }, this.#exr.elements),
        h("p", { class: "check" }, this.#keep, h("label", { for: "keep-slices" },
          "Keep every slice, to compare any two points of the curve and to judge the job again (a few MB each)")),
        this.rule.watched)),
    ];
  }

  /** A button for each place where images are seen pixel by pixel, which fills in the view there. */
  #places() {
    return h("p", { class: "places", role: "group", "aria-label": "Places" }, "Pixel by pixel ",
      Object.entries(PLACES).map(([name, view]) => h("button", { type: "button", onclick: () => {
        for (const field of this.#view.fields) if (field.name in view) field.fill(view[field.name]);
        say(`The view below is that of a ${name}.`);
      } }, TITLES[name] ?? name)));
  }

  /**
   * Shows the spec of a job, but for its parameters and the URL of its notice, of which only its owner knows the whole.
   * @param {Api.JobSpec} spec
   */
  fill(spec) {
    const { frame_seed, view, aovs } = spec;
    this.#kept = { frame_seed };
    this.#keptView = view.focus ? { focus: view.focus } : {};
    for (const part of [this.#limits, this.#more, this.#workers]) part.fill(spec);
    this.#notice.fill({ targets: spec.notice.targets });
    this.#view.fill(view);
    this.#exr.fill(spec.exr);
    this.#background.fill(view.background.some(Boolean) ? view.background : "");
    this.#allocation.fill(spec.allocation);
    this.#denoise.fill(spec.denoise);
    this.rule.fill(spec);
    for (const one of this.#aovs) one.checked = aovs.some((name) => name === one.value);
    this.#keep.checked = spec.keep_slices;
    this.#details.open = true;
  }

  get fields() {
    const groups = [this.#view, this.#limits, this.#more, this.#workers, this.#notice, this.#exr];
    return [...this.rule.fields, ...this.#allocation.fields, ...groups.flatMap(({ fields }) => fields), this.#background];
  }

  /** The chosen camera. */
  get sensor() {
    return this.#more.values().sensor ?? 0;
  }

  /** The spec, without parameters. */
  values() {
    const background = this.#background.value;
    return {
      ...this.#kept, ...this.#limits.values(), ...this.#more.values(), ...this.#workers.values(), notice: this.#notice.values(),
      ...this.#allocation.values(), ...this.#denoise.values(), ...this.rule.values(),
      view: { ...this.#keptView, ...this.#view.values(), ...(background === undefined ? {} : { background: String(background).split(",").map(Number) }) },
      aovs: this.#aovs.filter(({ checked }) => checked).map(({ value }) => value),
      exr: this.#exr.values(), keep_slices: this.#keep.checked,
    };
  }
}
