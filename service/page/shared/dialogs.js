// Questions in a dialog.

import { h } from "./dom.js";

/** Asks a question with two answers; resolves to whether it was confirmed. */
export function confirmed(question, explanation, yes, no = "Keep it") {
  return new Promise((resolve) => {
    const dialog = h(
      "dialog",
      { class: "ask", "aria-labelledby": "question", onclose: close },
      h("form", { method: "dialog" },
        h("h2", { id: "question" }, question),
        h("p", {}, explanation),
        h("div", { class: "answers" },
          h("button", { value: "no", autofocus: true }, no),
          h("button", { value: "yes", class: "primary" }, yes))),
    );
    function close() {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    }
    document.body.append(dialog);
    dialog.showModal();
  });
}
