// A job's id, which a click copies.

import { h, setAttribute, setText } from "./dom.js";
import { complain, say } from "./notices.js";

/** How many letters are shown; every command takes a shortened id. */
const SHOWN = 8;
const COPIED_MS = 1500;

export class JobId {
  #id = "";
  element = h("button", { class: "job-id", type: "button", onclick: () => this.#copy() });

  /** @param {string} id */
  show(id) {
    if (id === this.#id) return;
    this.#id = id;
    setText(this.element, id.slice(0, SHOWN));
    setAttribute(this.element, "aria-label", `Copy the job's id, ${id}`);
    setAttribute(this.element, "title", "Copy the job's id");
  }

  async #copy() {
    try {
      await navigator.clipboard.writeText(this.#id);
    } catch {  // a browser lets pages copy over https and on this machine alone
      complain(`The browser does not let this page copy. The job's id is ${this.#id}.`, true);
      return;
    }
    say(`The job's id ${this.#id} is copied.`);
    setText(this.element, "copied");
    setTimeout(() => setText(this.element, this.#id.slice(0, SHOWN)), COPIED_MS);
  }
}
