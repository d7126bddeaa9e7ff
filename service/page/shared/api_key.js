// The API key, where the service wants one: asked for when it does, kept until the tab is closed.

import { h, setText } from "./dom.js";

const NAME = "plateau-key";
let asking = null;

/** The header that proves who we are; empty where no key is known. */
export function authorization() {
  const key = sessionStorage.getItem(NAME);
  return key ? { Authorization: `Bearer ${key}` } : {};
}

/** Whether a key is kept. */
export function hasKey() {
  return sessionStorage.getItem(NAME) !== null;
}

/** Forgets it. */
export function forgetKey() {
  sessionStorage.removeItem(NAME);
}

/**
 * Asks for a key, once however many calls want one; resolves to whether there is a new one.
 * `used` is the header that was refused.
 */
export async function askForKey(used) {
  // Another call has asked meanwhile: try with what it was told.
  if (authorization().Authorization !== used.Authorization) return true;
  asking ??= ask(Boolean(used.Authorization)).finally(() => (asking = null));
  return asking;
}

function ask(refused) {
  return new Promise((resolve) => {
    const input = h("input", {
      id: "key", type: "password", autocomplete: "current-password", required: true, autofocus: true,
      "aria-describedby": "key-help",
    });
    const refusal = h("p", { class: "bad", role: "alert" });
    setText(refusal, refused ? "The service does not know this key, or it was revoked." : "");
    const dialog = h(
      "dialog",
      { class: "ask", "aria-labelledby": "key-title", onclose: close },
      h("form", { method: "dialog", onsubmit: keep },
        h("h2", { id: "key-title" }, "This service asks for a key"),
        h("p", { id: "key-help" },
          "Whoever runs it makes one with ", h("code", {}, "plateau keys create"),
          ". It stays in this tab, and is forgotten when you close it."),
        refusal,
        h("label", { for: "key" }, "API key"), input,
        h("div", { class: "answers" },
          h("button", { type: "submit", class: "primary" }, "Go on"))),
    );
    function keep() {
      sessionStorage.setItem(NAME, input.value.trim());
    }
    function close() {
      dialog.remove();
      document.dispatchEvent(new Event("plateau-key"));
      resolve(input.value.trim() !== "");
    }
    document.body.append(dialog);
    dialog.showModal();
  });
}
