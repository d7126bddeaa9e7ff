// The menus of the list: actions on a job, and on a whole batch.

import { send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { h, setAttribute } from "../shared/dom.js";
import { controls } from "../shared/job_controls.js";
import { ENDED } from "../shared/job_summary.js";
import { attempt } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";
import { showGuard } from "./flicker_guard.js";

/**
 * The menu of a job.
 * @param {() => Api.JobView} jobNow
 * @param {() => unknown} refresh
 */
export function jobMenu(jobNow, refresh) {
  return menuButton(() => {
    const found = controls(jobNow, refresh);
    if (found.length) return found;
    const { state, owner_name: owner } = jobNow();
    return [h("p", {}, ENDED.has(state) ? `It has ended: ${state}.` : `It is ${owner ? `${owner}'s` : "nobody's"}, and your key may not change it.`)];
  });
}

/**
 * The menu of a batch.
 * @param {string} batch
 * @param {() => Api.JobView[]} jobsNow
 * @param {(id: string) => string} nameOf - the name of a job
 * @param {() => unknown} refresh
 */
export function batchMenu(batch, jobsNow, nameOf, refresh) {
  const all = (/** @type {string} */ what, /** @type {string} */ done) =>
    attempt(() => send("POST", `/v1/batches/${encodeURIComponent(batch)}/${what}`), done, refresh);
  async function cancel() {
    const kept = "Jobs that are being rendered keep the image that they have by then.";
    if (await confirmed(`Cancel all jobs of ${batch}?`, kept, "Cancel them all", "Keep them")) {
      await all("cancel", `${batch} is cancelled`);
    }
  }
  const menu = menuButton(() => {
    const states = new Set(jobsNow().filter((job) => !ENDED.has(job.state)).map((job) => job.state));
    const guard = h("button", { onclick: () => showGuard(batch, nameOf) }, "Will it flicker?");
    if (!states.size) return [h("p", {}, "All its jobs have ended."), guard];
    if (!maySubmit()) return [guard];
    return [
      states.has("rendering") && h("button", { onclick: () => all("pause", `${batch} is paused`) }, "Pause all"),
      states.has("paused") && h("button", { onclick: () => all("resume", `${batch} is resumed`) }, "Resume all"),
      h("button", { class: "danger", onclick: cancel }, "Cancel all"),
      guard,
    ];
  });
  menu.name(`Actions for the batch ${batch}`);
  return menu;
}

/**
 * A button with a menu that is filled when it opens and closes with a choice: its `element`, and
 * `name(text)`, which sets its accessible name.
 * @param {() => (HTMLElement | false)[]} fill - makes the menu's items
 */
function menuButton(fill) {
  const menu = h("div", { class: "menu", popover: "auto" });
  const button = h("button", { class: "quiet dots", "aria-haspopup": "true", "aria-expanded": "false" }, "⋯");
  button.popoverTargetElement = menu;
  menu.addEventListener("beforetoggle", (event) => {
    button.setAttribute("aria-expanded", String(event.newState === "open"));
    if (event.newState !== "open") return;
    menu.replaceChildren(...fill().filter((one) => one !== false));
    const place = button.getBoundingClientRect();
    menu.style.top = `${place.bottom + scrollY + 4}px`;
    menu.style.right = `${Math.max(8, document.documentElement.clientWidth - place.right)}px`;
  });
  // Closed before the chosen action runs, so that a dialog that it opens keeps the focus.
  menu.addEventListener("submit", () => menu.hidePopover(), { capture: true });
  menu.addEventListener("click", ({ target }) => {
    if (target instanceof HTMLButtonElement && !target.form) menu.hidePopover();
  }, { capture: true });
  return {
    element: h("div", { class: "actions" }, button, menu),
    name: (/** @type {string} */ text) => setAttribute(button, "aria-label", text),
  };
}
