// The controls of a job: pause, resume, cancel, and priority.

import { send } from "./api.js";
import { confirmed } from "./dialogs.js";
import { h } from "./dom.js";
import { whole } from "./figures.js";
import { ENDED } from "./job_summary.js";
import { attempt } from "./notices.js";
import { maySteer } from "./permissions.js";

/**
 * Whether a job may still be paused, cancelled or given another priority, with this key.
 * @param {Api.JobView} job
 */
export function mayControl(job) {
  return !ENDED.has(job.state) && maySteer(job);
}

/**
 * A form that sets a priority.
 * @param {number} value
 * @param {(priority: number) => unknown} set
 */
export function priorityForm(value, set) {
  const input = h("input", { type: "number", step: 1, value, "aria-label": "Priority" });
  return h("form", { class: "priority", onsubmit: (event) => {
    event.preventDefault();
    set(Number(input.value));
  } }, h("label", {}, "Priority ", input), h("button", {}, "Set"));
}

/**
 * The controls for a job in its state; none for an ended job.
 * @param {() => Api.JobView} jobNow - the job at the time of a click
 * @param {() => unknown} refresh
 */
export function controls(jobNow, refresh) {
  const job = jobNow();
  if (!mayControl(job)) return [];
  const move = (/** @type {string} */ path, /** @type {string} */ done) => () =>
    attempt(() => send("POST", path), done, refresh);
  const name = job.name;
  /** @type {HTMLElement[]} */
  const found = [];
  if (job.state === "rendering") {
    found.push(h("button", { onclick: move(job.links.pause, `${name} is paused`) }, "Pause"));
  }
  if (job.state === "paused") {
    found.push(h("button", { onclick: move(job.links.resume, `${name} is resumed`) }, "Resume"));
  }
  found.push(h("button", { class: "danger", onclick: cancel }, "Cancel"));
  async function cancel() {
    const { committed_spp: spp } = jobNow();
    const kept = spp
      ? `It keeps the image that it has by then, at ${whole(spp)} spp or a little more.`
      : "No slice of it has been rendered yet, so it will have no image.";
    if (await confirmed(`Cancel ${name}?`, kept, "Cancel the job")) {
      await attempt(() => send("POST", job.links.cancel), `${name} is cancelled`, refresh);
    }
  }
  found.push(priorityForm(job.spec.priority, (priority) =>
    attempt(() => send("PATCH", job.links.self, { priority }), `${name} has priority ${priority}`, refresh)));
  return found;
}
