// How good an image is to be, in a word: rules with parameters.

import { h } from "../shared/dom.js";
import { say } from "../shared/notices.js";
import { ruleNamed } from "../shared/rules.js";

/** @typedef {{ name: string } & Record<string, string | number>} AskedRule */

/** From the least samples to the most. @type {{ title: string, help: string, rule: AskedRule }[]} */
const PRESETS = [
  { title: "Draft", help: "Framing and light can be judged: noise may be seen in 1 % of the pixels.",
    rule: { name: "visible", target: 0.01, min_spp: 32 } },
  { title: "Final", help: "What jobs do by default: hardly a pixel has noise that a person could see.",
    rule: { name: "visible" } },
  { title: "To the eye's limit", help: "At most a tenth of a JOD from the converged image, by ColorVideoVDP: side by side, people can only guess.",
    rule: { name: "jod", target: 9.9 } },
];

/**
 * A button for each preset.
 * @param {(rule: AskedRule) => void} take - called with the rule of a preset
 */
export function presets(take) {
  return h("div", { class: "presets", role: "group", "aria-label": "Presets" },
    PRESETS.filter(({ rule }) => ruleNamed(rule.name)).map(({ title, help, rule }) =>
      h("button", { type: "button", onclick: () => { take(rule); say(`${title}: the rule below is set`); } },
        h("b", {}, title), h("span", { class: "help" }, help))));
}
