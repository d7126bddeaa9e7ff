// The menus of the list: what can be done to a job, and to a whole batch.

import { send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { h, setAttribute } from "../shared/dom.js";
import { controls } from "../shared/job_controls.js";
import { ENDED } from "../shared/job_summary.js";
import { attempt } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";
import { showGuard } from "./flicker_guard.js";

/**
 * A menu of what can be done to a job of the list.
 * @param {() => Api.JobView} jobNow
 * @param {() => unknown} refresh
 */
export function jobMenu(jobNow, refresh) {
  return menuButton(
    (close) => {
      const found = controls(jobNow, refresh, close);
      if (found.length) return found;
      const { state, owner_name: owner } = jobNow();
      return [h("p", {}, ENDED.has(state) ? `It has ended: ${state}.` : `It is ${owner ? `${owner}'s` : "nobody's"}, and your key may not change it.`)];
    });
}

/**
 * A menu of what can be done to a whole batch.
 * @param {string} batch
 * @param {() => Api.JobView[]} jobsNow
 * @param {(id: string) => string} nameOf - what a job is called
 * @param {() => unknown} refresh
 */
export function batchMenu(batch, jobsNow, nameOf, refresh) {
  const menu = menuButton(
    (close) => {
      const states = new Set(jobsNow().filter((job) => !ENDED.has(job.state)).map((job) => job.state));
      const guard = h("button", { onclick: () => { close(); showGuard(batch, nameOf); } }, "Will it flicker?");
      if (!states.size) return [h("p", {}, "All its jobs have ended."), guard];
      if (!maySubmit()) return [guard];
      const all = (/** @type {string} */ what) => send("POST", `/v1/batches/${encodeURIComponent(batch)}/${what}`);
      const button = (/** @type {string} */ text, /** @type {string} */ what, /** @type {string} */ done) => h("button", { onclick: () => {
        close();
        return attempt(() => all(what), done, refresh);
      } }, text);
      return [
        states.has("rendering") && button("Pause all", "pause", `${batch} is paused`),
        states.has("paused") && button("Resume all", "resume", `${batch} goes on`),
        h("button", { class: "danger", onclick: async () => {
          close();
          const kept = "Jobs that are being rendered keep the image that they have by then.";
          if (await confirmed(`Cancel all jobs of ${batch}?`, kept, "Cancel them all", "Keep them")) {
            await attempt(() => all("cancel"), `${batch} is cancelled`, refresh);
          }
        } }, "Cancel all"),
        guard,
      ];
    });
  menu.name(`Actions for the batch ${batch}`);
  return menu;
}

/**
 * A button with a menu that is filled when it opens: its `element`, and `name(text)` to say whose it is.
 * @param {(close: () => void) => (HTMLElement | false)[]} fill - makes what the menu holds
 */
function menuButton(fill) {
  const menu = h("div", { class: "menu", popover: "auto" });
  const button = h("button", { class: "quiet dots", "aria-haspopup": "true", "aria-expanded": "false" }, "⋯");
  button.popoverTargetElement = menu;
  menu.addEventListener("beforetoggle", (event) => {
    button.setAttribute("aria-expanded", String(event.newState === "open"));
    if (event.newState !== "open") return;
    menu.replaceChildren(...fill(() => menu.hidePopover()).filter((one) => one !== false));
    const place = button.getBoundingClientRect();
    menu.style.top = `${place.bottom + scrollY + 4}px`;
    menu.style.right = `${Math.max(8, document.documentElement.clientWidth - place.right)}px`;
  });
  return {
    element: h("div", { class: "actions" }, button, menu),
    name: (/** @type {string} */ text) => setAttribute(button, "aria-label", text),
  };
}
