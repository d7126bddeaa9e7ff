// How good an image is to be, in a word: rules with parameters, and what else goes with them.

import { h } from "../shared/dom.js";
import { say } from "../shared/notices.js";
import { ruleNamed } from "../shared/rules.js";

/** @typedef {{ name: string } & Record<string, string | number>} AskedRule */

/** @typedef {{ title: string, help: string, rule: AskedRule, allocation?: string, place?: string }} Preset */

/** From the least samples to the most, and the paper's. @type {Preset[]} */
const PRESETS = [
  { title: "Draft", help: "Framing and light can be judged: three of four people would prefer the converged image.",
    rule: { name: "jod", target: 9, min_spp: 32 } },
  { title: "Final", help: "What jobs do by default: people hardly find noise, at 200 % on a desk.",
    rule: { name: "jod" } },
  { title: "To the eye's limit", help: "At most a tenth of a JOD from the converged image, by ColorVideoVDP: side by side, people can only guess.",
    rule: { name: "jod", target: 9.9 } },
  { title: "The paper", help: "As Takouachet et al. stopped in 2007: by the slope of the curve, on whole frames.",
    rule: { name: "reverse" }, allocation: "frame", place: "paper" },
];

/**
 * A button for each preset.
 * @param {(preset: Required<Preset>) => void} take
 */
export function presets(take) {
  return h("div", { class: "presets", role: "group", "aria-label": "Presets" },
    PRESETS.filter(({ rule }) => ruleNamed(rule.name)).map((preset) => h("button", { type: "button", onclick: () => {
      take({ allocation: "auto", place: "screen", ...preset });
      say(`${preset.title}: the rule, the samples' places and the view below are set`);
    } }, h("b", {}, preset.title), h("span", { class: "help" }, preset.help))));
}
