// A slider with its name and its value.

import { h } from "../../shared/dom.js";

/**
 * @param {string} name
 * @param {{ min: number, max: number, step: number, value: number }} attributes
 * @param {() => void} act
 */
export function slider(name, attributes, act) {
  const input = h("input", { type: "range", ...attributes, oninput: act });
  const output = h("output");
  return { input, output, label: h("label", { class: "slider" }, h("span", {}, name), input, output) };
}
