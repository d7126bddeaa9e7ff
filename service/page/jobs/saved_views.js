// Saved views: searches, filters and orders of the list under names, which the browser keeps.

import { h } from "../shared/dom.js";
import { say } from "../shared/notices.js";
import { menuButton } from "./menus.js";

const KEPT = "plateau-views";

/** @typedef {{ name: string, query: string }} View */

/** A button with the menu of saved views. */
export function viewsMenu() {
  const menu = menuButton(() => {
    const views = saved();
    const now = location.search.slice(1);
    const name = h("input", { required: true, maxlength: 60, "aria-label": "Name of this view", placeholder: "Name" });
    return [
      h("p", { class: "hint" }, views.length ? "Saved views" : "Views of this list that you save are kept in this browser."),
      ...views.map((view) => h("div", { class: "view" },
        h("a", { href: `/${view.query && `?${view.query}`}`, "aria-current": view.query === now ? "page" : null }, view.name),
        h("button", { class: "quiet", "aria-label": `Remove the view ${view.name}`, onclick: () => {
          keep(saved().filter((one) => one.name !== view.name));
          say(`The view ${view.name} is removed`);
        } }, "✕"))),
      h("form", { class: "view", onsubmit: (event) => {
        event.preventDefault();
        const view = { name: name.value.trim(), query: location.search.slice(1) };
        if (!view.name) return;
        keep([...saved().filter((one) => one.name !== view.name), view].sort((a, b) => a.name.localeCompare(b.name)));
        say(`This view is saved as ${view.name}`);
      } }, name, h("button", {}, "Save this view")),
    ];
  }, "Views");
  return menu.element;
}

/** @returns {View[]} */
function saved() {
  try {
    const views = JSON.parse(localStorage.getItem(KEPT) ?? "[]");
    return Array.isArray(views) ? views.filter(({ name, query }) => typeof name === "string" && typeof query === "string") : [];
  } catch {
    return [];  // of another program, or the browser keeps nothing
  }
}

/** @param {View[]} views */
function keep(views) {
  try {
    localStorage.setItem(KEPT, JSON.stringify(views));
  } catch {
    say("This browser keeps nothing for this page");
  }
}
