// One of the choices of a question, with its help.

import { h } from "../shared/dom.js";

/**
 * @param {HTMLInputElement} radio
 * @param {string} title
 * @param {string} help
 * @param {HTMLElement} [inside]
 */
export function choice(radio, title, help, inside) {
  return h("div", { class: "choice" },
    h("label", {}, radio, h("span", {}, h("b", {}, title), h("span", { class: "help" }, help))), inside);
}
