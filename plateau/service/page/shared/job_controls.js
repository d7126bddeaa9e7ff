// What can be done with jobs, one or many at once: pause, resume, cancel, delete, restore, and a priority.

import { send } from "./api.js";
import { confirmed } from "./dialogs.js";
import { byId, h } from "./dom.js";
import { several } from "./figures.js";
import { ENDED } from "./job_summary.js";
import { complain, messageOf, say } from "./notices.js";
import { maySteer } from "./permissions.js";

/**
 * @typedef {object} Action
 * @property {string} label
 * @property {string} done
 * @property {string} [explanation] - of what it does, for one that is asked for twice
 * @property {(job: Api.JobView) => boolean} fits - whether it can be done with a job
 * @property {(job: Api.JobView) => Promise<unknown>} request
 */

const isOpen = (/** @type {Api.JobView} */ { state }) => !ENDED.has(state);

/** @type {Action[]} */
const ACTIONS = [
  { label: "Pause", done: "paused", fits: ({ state }) => state === "rendering", request: ({ links }) => send("POST", links.pause) },
  { label: "Resume", done: "resumed", fits: ({ state, held }) => state === "paused" || held, request: ({ links }) => send("POST", links.resume) },
  { label: "Cancel", done: "cancelled", fits: isOpen, request: ({ links }) => send("POST", links.cancel),
    explanation: "What has been rendered by then is kept as an image." },
  { label: "Delete", done: "deleted", fits: (job) => !isOpen(job) && !job.deleted_at, request: ({ links }) => send("DELETE", links.self),
    explanation: "The list of jobs shows what is deleted under Show, from where it can be restored for some days." },
  { label: "Restore", done: "restored", fits: (job) => Boolean(job.deleted_at), request: ({ links }) => send("POST", links.restore) },
];
/** How many requests are made at once. */
const AT_ONCE = 4;

export class JobControls {
  /** @type {Api.JobView[]} */
  #jobs = [];
  #changed;
  #shown = "";
  #buttons = ACTIONS.map((action) =>
    h("button", { class: action.explanation ? "danger" : "", onclick: () => this.#ask(action) }, `${action.label}${action.explanation ? "…" : ""}`));
  #input = h("input", { type: "number", step: 1, required: true, "aria-label": "Priority" });
  #priority = h("form", { class: "priority", onsubmit: (event) => {
    event.preventDefault();
    const priority = Number(this.#input.value);
    this.#do(`given priority ${priority}`, this.#jobs.filter(isOpen), ({ links }) => send("PATCH", links.self, { priority }));
  } }, h("label", {}, "Priority ", this.#input), h("button", {}, "Set"));
  elements = [...this.#buttons, this.#priority];

  /** @param {() => unknown} changed - called when jobs were changed */
  constructor(changed) {
    this.#changed = changed;
  }

  /**
   * Offers what can be done with any of these jobs, by this key.
   * @param {Api.JobView[]} jobs
   */
  show(jobs) {
    const focused = this.elements.find((one) => one.contains(document.activeElement));
    this.#jobs = jobs.filter(maySteer);
    ACTIONS.forEach(({ fits }, at) => (this.#buttons[at].hidden = !this.#jobs.some(fits)));
    this.#priority.hidden = !this.#jobs.some(isOpen);
    const priority = String(this.#jobs[0]?.spec.priority ?? 0);
    if (priority !== this.#shown) this.#input.value = this.#shown = priority;
    // What was pressed may be gone now; the focus goes to another of them, which deletes nothing.
    if (focused?.hidden) (this.#buttons.find(({ hidden, className }) => !hidden && !className) ?? byId("main")).focus({ preventScroll: true });
  }

  /** @param {Action} action */
  async #ask({ label, done, fits, explanation, request }) {
    const jobs = this.#jobs.filter(fits);
    const what = jobs.length === 1 ? "the job" : several(jobs.length, "job");
    if (explanation && !(await confirmed(`${label} ${named(jobs)}?`, explanation, `${label} ${what}`))) return;
    await this.#do(done, jobs, request);
  }

  /**
   * Sends a request for each of the jobs, and says for which it was done, and why others were refused.
   * @param {string} done
   * @param {Api.JobView[]} jobs
   * @param {Action["request"]} request
   */
  async #do(done, jobs, request) {
    const queue = jobs.values();
    /** @type {Set<Api.JobView>} */
    const changed = new Set();
    /** @type {string[]} */
    const refused = [];
    await Promise.all(Array.from({ length: AT_ONCE }, async () => {
      for (const job of queue) {
        await request(job).then(() => changed.add(job), (error) => refused.push(`${job.name}: ${messageOf(error)}`));
      }
    }));
    complain(refused.length ? `Refused for ${refused.length} of ${several(jobs.length, "job")}. ${refused[0]}` : "", true);
    if (changed.size) say(`${named([...changed])} ${changed.size === 1 ? "is" : "are"} ${done}`);
    await this.#changed();
  }
}

/** @param {Api.JobView[]} jobs */
function named(jobs) {
  return jobs.length === 1 ? jobs[0].name : several(jobs.length, "job");
}
