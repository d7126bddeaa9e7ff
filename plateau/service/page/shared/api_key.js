// The API key: the page asks for it when the service demands one, and keeps it until the tab closes.

import { openDialog } from "./dialogs.js";
import { h } from "./dom.js";

const NAME = "plateau-key";
/** @type {Promise<boolean> | null} */
let asking = null;

/** The header with the key; empty without a key. @returns {Record<string, string>} */
export function authorization() {
  const key = sessionStorage.getItem(NAME);
  return key ? { Authorization: `Bearer ${key}` } : {};
}

/** Whether the page has a key. */
export function hasKey() {
  return sessionStorage.getItem(NAME) !== null;
}

/** Forgets the key. */
export function forgetKey() {
  sessionStorage.removeItem(NAME);
}

/**
 * Asks for a key, once for all waiting calls; resolves to whether there is a new one.
 * @param {Record<string, string>} used - the header that was refused
 */
export async function askForKey(used) {
  // Another call has asked meanwhile: try its key.
  if (authorization().Authorization !== used.Authorization) return true;
  asking ??= ask(Boolean(used.Authorization)).finally(() => (asking = null));
  return await asking;
}

/**
 * @param {boolean} refused
 * @returns {Promise<boolean>}
 */
function ask(refused) {
  const input = h("input", {
    id: "key", type: "password", autocomplete: "current-password", required: true, autofocus: true,
    "aria-describedby": "key-help", pattern: "\\s*[\\x21-\\x7e]+\\s*", title: "Letters, digits and signs, without spaces",
  });
  const keep = () => sessionStorage.setItem(NAME, input.value.trim());
  const dialog = openDialog("This service asks for a key", { method: "dialog", onsubmit: keep },
    h("p", { id: "key-help" },
      "Whoever runs it makes one with ", h("code", {}, "plateau keys create"),
      ". It stays in this tab, and is forgotten when you close it."),
    h("p", { class: "bad", role: "alert" }, refused && "The service does not know this key, or it was revoked."),
    h("label", { for: "key" }, "API key"), input,
    h("div", { class: "answers" },
      h("button", { type: "submit", class: "primary" }, "Continue")));
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      document.dispatchEvent(new Event("plateau-key"));
      resolve(input.value.trim() !== "");
    });
  });
}
