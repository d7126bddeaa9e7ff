// The choice of where a job's samples go.

import { h } from "../shared/dom.js";
import { fieldsOf } from "../shared/form_fields.js";
import { ZONES } from "../shared/spec_fields.js";
import { choice } from "./choice.js";

export class AllocationChoice {
  #zones = fieldsOf("spec.allocation", ZONES);
  #inside = h("div", { class: "fields small", hidden: true }, this.#zones.elements);
  #byZones = h("input", { type: "radio", name: "allocation", value: "zones" });
  #byFrame = h("input", { type: "radio", name: "allocation", value: "frame", checked: true });
  fields = this.#zones.fields;
  element = h("fieldset", { onchange: () => this.#show() },
    h("legend", {}, "Where do its samples go?"),
    h("div", { class: "choices", role: "radiogroup", "aria-label": "Where its samples go" },
      choice(this.#byFrame, "All over the frame", "Every pixel has the same samples."),
      choice(this.#byZones, "To the zones that need them",
        "From the third step on, each step goes to the zones in which more is left to see.", this.#inside)));

  #show() {
    this.#inside.hidden = !this.#byZones.checked;
  }

  /** @param {Api.JobSpec["allocation"]} allocation */
  fill(allocation) {
    (allocation.name === "zones" ? this.#byZones : this.#byFrame).checked = true;
    this.#zones.fill(allocation);
    this.#show();
  }

  /** The part of the spec that it is; none where it is the default. */
  values() {
    return this.#byZones.checked ? { allocation: { name: "zones", ...this.#zones.values() } } : {};
  }
}
