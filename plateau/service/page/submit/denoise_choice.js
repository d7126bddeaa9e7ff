// The choice whether a job's image is denoised.

import { h } from "../shared/dom.js";
import { choice } from "./choice.js";

export class DenoiseChoice {
  #none = h("input", { type: "radio", name: "denoise", value: "none", checked: true });
  #oidn = h("input", { type: "radio", name: "denoise", value: "oidn" });
  #guides = h("input", { type: "checkbox", checked: true });
  #inside = h("div", { class: "fields small", hidden: true },
    h("label", { class: "toggle" }, this.#guides, "With guides: what the surfaces are"));
  element = h("fieldset", { onchange: () => this.#show() },
    h("legend", {}, "Is it denoised?"),
    h("div", { class: "choices", role: "radiogroup", "aria-label": "Whether it is denoised" },
      choice(this.#none, "No", "The image is the mean of its samples."),
      choice(this.#oidn, "By Open Image Denoise",
        "Where that is nearer to the truth, and only there. The rule judges the denoised image.", this.#inside)));

  #show() {
    this.#inside.hidden = !this.#oidn.checked;
  }

  /** @param {Api.JobSpec["denoise"]} denoise */
  fill(denoise) {
    (denoise.name === "oidn" ? this.#oidn : this.#none).checked = true;
    this.#guides.checked = !("guides" in denoise) || denoise.guides !== false;
    this.#show();
  }

  /** The part of the spec that it is; none where it is the default. */
  values() {
    return this.#oidn.checked ? { denoise: { name: "oidn", guides: this.#guides.checked } } : {};
  }
}
