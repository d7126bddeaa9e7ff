// Dialogs: a question with two answers, and a form whose request may be refused.

import { h, setText } from "./dom.js";
import { messageOf } from "./notices.js";

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

/**
 * Opens a form whose request may be refused. It closes when `send` resolves; an error is shown in it.
 * @param {string} title
 * @param {string} yes - the label of the button that sends
 * @param {(Child | Child[])[]} inside
 * @param {{ send: () => Promise<() => unknown>, wait?: (waits: boolean, button: HTMLElement) => void }} doing
 *   `send` resolves to what to do once the dialog has closed; `wait` is called when a request begins and ends
 */
export function openForm(title, yes, inside, { send, wait }) {
  const wrong = h("p", { class: "bad", role: "alert" });
  const button = h("button", { type: "submit", class: "primary" }, yes);
  const dialog = openDialog(title, { onsubmit: submit }, ...inside, wrong,
    h("div", { class: "answers" },
      h("button", { type: "button", onclick: () => dialog.close() }, "Close"), button));

  /** @param {SubmitEvent} event */
  async function submit(event) {
    event.preventDefault();
    button.disabled = true;
    setText(wrong, "");
    wait?.(true, button);
    try {
      const next = await send();
      dialog.close();
      next();
    } catch (error) {
      setText(wrong, messageOf(error));
      button.disabled = false;
    }
    wait?.(false, button);
  }
}
