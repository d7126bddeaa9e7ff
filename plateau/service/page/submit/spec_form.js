// The fields of a job's spec, but for the scene's parameters.

import { h } from "../shared/dom.js";
import { fieldsOf } from "../shared/form_fields.js";
import { say } from "../shared/notices.js";
import { RULES } from "../shared/rules.js";
import { DENOISER, EXR, LIMITS, MORE, NOTICE, PLACES, VIEW, WORKERS, ZONES } from "../shared/spec_fields.js";
import { Alternatives } from "./alternatives.js";
import { presets } from "./presets.js";

/** @type {Record<string, string>} */
const TITLES = {
  screen: "on a desk at 200 %", desk: "on a desk", phone: "on a phone", cinema: "in a cinema", paper: "as in the paper",
};

export class SpecForm {
  #rule = new Alternatives("rule", "The rule that ends it",
    RULES.map((rule) => ({ ...rule, isRare: !rule.featured })), RULES.find((rule) => rule.default)?.name);
  #allocation = new Alternatives("allocation", "Where its samples go", [
    { name: "auto", title: "By itself",
      help: "To zones where the rule is jod, the renderer has them and no slice is kept; else all over the frame." },
    { name: "frame", title: "All over the frame", help: "Every pixel has the same samples." },
    { name: "zones", title: "To the zones that need them", fields: ZONES,
      help: "From the third step on, each step goes to the zones in which more is left to see." },
  ], "auto");
  #denoise = new Alternatives("denoise", "Whether it is denoised", [
    { name: "none", title: "No", help: "The image is the mean of its samples." },
    { name: "oidn", title: "By Open Image Denoise", fields: DENOISER,
      help: "Where that is nearer to the truth, and only there. The rule judges the denoised image." },
  ], "none");
  #view = fieldsOf("spec.view", VIEW);
  #limits = fieldsOf("spec", LIMITS);
  #more = fieldsOf("spec", MORE);
  #workers = fieldsOf("spec", WORKERS);
  #notice = fieldsOf("spec.notice", NOTICE);
  #exr = fieldsOf("spec.exr", EXR);
  /** What of a filled in spec has no field. */
  #kept = {};
  /** Of a filled in spec. @type {Api.JobSpec["watch"] | null} */
  #watched = null;
  elements;
  #details;

  constructor() {
    const part = (/** @type {string} */ legend, /** @type {(Element | Element[])[]} */ ...inside) => h("fieldset", {}, h("legend", {}, legend), ...inside);
    const group = (/** @type {Element[]} */ ...fields) => h("div", { class: "fields" }, fields);
    this.elements = [
      part("When is it done?", presets((one) => this.#take(one)), this.#rule.element),
      part("Where do its samples go?", this.#allocation.element),
      part("Is it denoised?", this.#denoise.element),
      part("How is it viewed?", this.#places(), group(...this.#view.elements)),
      part("Limits", group(...this.#limits.elements)),
      (this.#details = h("details", {}, h("summary", {}, "More"),
        group(...this.#more.elements, ...this.#exr.elements),
        part("Who renders it?", group(...this.#workers.elements)),
        part("Who hears of its end?", group(...this.#notice.elements)))),
    ];
  }

  /** A button for each place where images are seen, which fills in the view there. */
  #places() {
    return h("p", { class: "places", role: "group", "aria-label": "Places" }, "Seen ",
      Object.keys(PLACES).map((name) => h("button", { type: "button", onclick: () => {
        this.#see(name);
        say(`The view below is ${TITLES[name] ?? name}.`);
      } }, TITLES[name] ?? name)));
  }

  /** @param {string} place */
  #see(place) {
    this.#view.fill({ ...this.#view.values(), field_of_view_deg: null, ...PLACES[place] });
  }

  /** @param {{ rule: { name: string }, allocation: string, place: string }} preset */
  #take({ rule, allocation, place }) {
    this.#rule.fill(rule);
    this.#allocation.fill({ name: allocation });
    this.#see(place);
  }

  /**
   * Shows the spec of a job, but for its parameters and the URL of its notice, of which only its owner knows the whole.
   * @param {Api.JobSpec} spec
   */
  fill(spec) {
    const { inputs, pictures, variance, view, watch } = spec;
    this.#kept = { inputs, pictures, variance };
    this.#watched = watch;
    for (const part of [this.#limits, this.#workers]) part.fill(spec);
    this.#more.fill({ ...spec, after: [], watch: watch.map(({ name }) => name) });
    this.#notice.fill({ targets: spec.notice.targets });
    this.#view.fill(view);
    this.#exr.fill(spec.exr);
    this.#allocation.fill(spec.allocation);
    this.#denoise.fill(spec.denoise);
    this.#rule.fill(spec.rule);
    this.#details.open = true;
  }

  get fields() {
    return [this.#rule, this.#allocation, this.#denoise, this.#view, this.#limits, this.#more, this.#workers, this.#notice, this.#exr]
      .flatMap(({ fields }) => fields);
  }

  /** The chosen camera. */
  get sensor() {
    return this.#more.values().sensor ?? 0;
  }

  /** The spec, without parameters. A rule that a filled in spec watches keeps its parameters. */
  values() {
    const { watch, ...more } = this.#more.values();
    const rule = this.#rule.values();
    const watched = [watch ?? []].flat().map((name) => this.#watched?.find((one) => one.name === name) ?? { name });
    return {
      ...this.#kept, ...this.#limits.values(), ...more, ...this.#workers.values(),
      ...this.#allocation.values(), ...this.#denoise.values(), ...rule,
      ...(watch ? { watch: watched } : {}),
      view: this.#view.values(), notice: this.#notice.values(), exr: this.#exr.values(),
    };
  }
}
