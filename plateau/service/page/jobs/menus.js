// The menus of the list: actions on a job, and on a whole batch.

import { send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { h, setAttribute } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { controls } from "../shared/job_controls.js";
import { deleteOrRestore, deletionButtons, deletions, restore } from "../shared/job_deletion.js";
import { ENDED } from "../shared/job_summary.js";
import { attempt, complain, offerUndo, say } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";
import { showShot } from "./shot_dialog.js";

/** @import { Deletion } from "../shared/job_deletion.js" */

/**
 * The menu of a job.
 * @param {() => Api.JobView} jobNow
 * @param {() => unknown} refresh
 * @param {(ids: string[]) => unknown} deleted
 */
export function jobMenu(jobNow, refresh, deleted) {
  return menuButton(() => {
    const found = [...controls(jobNow, refresh),
      ...deletionButtons(deletions(jobNow()), (what) => deleteOrRestore([jobNow()], what, deleted))];
    if (found.length) return found;
    const { owner_name: owner } = jobNow();
    return [h("p", {}, `It is ${owner ? `${owner}'s` : "nobody's"}, and your key may not change it.`)];
  });
}

/**
 * The menu of a batch.
 * @param {string} batch
 * @param {() => Api.JobView[]} jobsNow
 * @param {(id: string) => string} nameOf - the name of a job
 * @param {() => unknown} refresh
 * @param {(ids: string[]) => unknown} deleted
 */
export function batchMenu(batch, jobsNow, nameOf, refresh, deleted) {
  const path = `/v1/batches/${encodeURIComponent(batch)}`;
  const all = (/** @type {string} */ what, /** @type {string} */ done) =>
    attempt(() => send("POST", `${path}/${what}`), done, refresh);
  /** @param {Deletion} what */
  async function deleteAll(what) {
    try {
      /** @type {Api.BatchSteered} */
      const { jobs } = await (what === "delete" ? send("DELETE", path) : send("POST", `${path}/restore`));
      const ids = jobs.filter(({ done }) => done).map(({ job }) => job);
      complain("");
      if (what === "restore") say(`The jobs of ${batch} are restored`);
      else offerUndo(`${several(ids.length, "job")} of ${batch} ${ids.length === 1 ? "is" : "are"} deleted`, async () => {
        await restore(ids);
        say(`The jobs of ${batch} are put back`);
        await deleted([]);
      });
      await deleted(ids);
    } catch (error) {
      complain(error, true);
    }
  }
  async function cancel() {
    const kept = "Jobs that are being rendered keep the image that they have by then.";
    if (await confirmed(`Cancel all jobs of ${batch}?`, kept, "Cancel them all", "Keep them")) {
      await all("cancel", `${batch} is cancelled`);
    }
  }
  const menu = menuButton(() => {
    const states = new Set(jobsNow().filter((job) => !ENDED.has(job.state)).map((job) => job.state));
    const shot = jobsNow().some((job) => job.in_shot) && h("button", { onclick: () => showShot(batch, nameOf) }, "Look at the shot");
    if (!maySubmit()) return [shot || h("p", {}, "Your key may not change it.")];
    const ended = new Set(jobsNow().flatMap(deletions));
    return [
      states.has("rendering") && h("button", { onclick: () => all("pause", `${batch} is paused`) }, "Pause all"),
      states.has("paused") && h("button", { onclick: () => all("resume", `${batch} is resumed`) }, "Resume all"),
      states.size > 0 && h("button", { class: "danger", onclick: cancel }, "Cancel all"),
      shot,
      ended.size > 0 && h("p", { class: "hint" }, states.size ? "Those that have ended:" : "All its jobs have ended."),
      ...deletionButtons([...ended], deleteAll),
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
  menu.addEventListener("toggle", () => {
    const beyond = 8 - menu.getBoundingClientRect().left;  // the left edge of a narrow window
    if (beyond > 0) menu.style.right = `${Math.max(8, parseFloat(menu.style.right) - beyond)}px`;
  });
  // Closed before the chosen action runs, so that a dialog that it opens keeps the focus.
  menu.addEventListener("click", ({ target }) => {
    if (target instanceof HTMLButtonElement) menu.hidePopover();
  }, { capture: true });
  return {
    element: h("div", { class: "actions" }, button, menu),
    name: (/** @type {string} */ text) => setAttribute(button, "aria-label", text),
  };
}
