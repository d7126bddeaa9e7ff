// Dialogs that hold a form, such as a question with two answers.

import { h } from "./dom.js";

/** @import { Attributes, Child } from "./dom.js" */

let count = 0;

/**
 * Opens a dialog that holds a form; it is removed when it closes.
 * @param {string} title
 * @param {Attributes} attributes - of the form
 * @param {(Child | Child[])[]} inside
 */
export function openDialog(title, attributes, ...inside) {
  const id = `dialog-${(count += 1)}`;
  const dialog = h("dialog", { class: "ask", "aria-labelledby": id, onclose: () => { dialog.remove(); } },
    h("form", attributes, h("h2", { id }, title), ...inside));
  document.body.append(dialog);
  dialog.showModal();
  return dialog;
}

/**
 * Asks a question with two answers; resolves to whether it was confirmed.
 * @param {string} question
 * @param {string} explanation
 * @param {string} yes
 * @returns {Promise<boolean>}
 */
export function confirmed(question, explanation, yes, no = "Keep it") {
  const dialog = openDialog(question, { method: "dialog" },
    h("p", {}, explanation),
    h("div", { class: "answers" },
      h("button", { value: "no", autofocus: true }, no),
      h("button", { value: "yes", class: "primary" }, yes)));
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"));
  });
}
