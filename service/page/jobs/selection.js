// The selected jobs, and the bar of actions on all of them.

import { send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { byId, h, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { mayControl, priorityForm } from "../shared/job_controls.js";
import { title } from "../shared/job_summary.js";
import { complain, messageOf, say } from "../shared/notices.js";

/** How many requests are made at once. */
const AT_ONCE = 4;

export class Selection {
  #changed;
  #refresh;
  /** @type {Set<string>} */
  #ids = new Set();
  /**
   * The listed jobs that may be selected, from top to bottom.
   * @type {Api.JobView[]}
   */
  #jobs = [];
  /** The job that was selected last, from which the Shift key selects a range. */
  #last = "";
  #count = h("strong");
  #pause = h("button", { onclick: () => this.#steer("rendering", "pause", "Paused") }, "Pause");
  #resume = h("button", { onclick: () => this.#steer("paused", "resume", "Resumed") }, "Resume");
  #every = h("button", { class: "quiet", onclick: () => this.#select(this.#jobs.map(({ id }) => id)) });
  #bar = [
    this.#count, this.#pause, this.#resume,
    h("button", { class: "danger", onclick: () => this.#cancel() }, "Cancel…"),
    priorityForm(0, (priority) => this.#send(this.#selected(), `Priority ${priority}`,
      ({ links }) => send("PATCH", links.self, { priority }))),
    this.#every,
    h("button", { class: "quiet", onclick: () => this.#select([]) }, "Clear"),
  ];
  element = h("div", { class: "selected", role: "region", "aria-label": "Selected jobs", hidden: true });

  /**
   * @param {() => void} changed - called when jobs are selected or not any more
   * @param {() => unknown} refresh - called when jobs were changed
   */
  constructor(changed, refresh) {
    this.#changed = changed;
    this.#refresh = refresh;
  }

  /**
   * Takes the listed jobs; one that is listed no more, or has ended, is selected no more.
   * @param {Api.JobView[]} jobs - from top to bottom
   */
  show(jobs) {
    this.#jobs = jobs.filter(mayControl);
    const selected = this.#selected();
    this.#ids = new Set(selected.map(({ id }) => id));
    const states = new Set(selected.map(({ state }) => state));
    setText(this.#count, `${several(selected.length, "job")} selected`);
    setText(this.#every, `Select all ${this.#jobs.length}`);
    this.#pause.hidden = !states.has("rendering");
    this.#resume.hidden = !states.has("paused");
    this.#every.hidden = selected.length === this.#jobs.length;
    if (!selected.length && this.element.contains(document.activeElement)) byId("main").focus({ preventScroll: true });
    if (this.element.hidden === !selected.length) return;
    this.element.hidden = !selected.length;
    this.element.replaceChildren(...(selected.length ? this.#bar : []));
  }

  /** @param {string} id */
  has(id) {
    return this.#ids.has(id);
  }

  /**
   * Selects a job, or all from the one before to this; or removes it from the selection.
   * @param {string} id
   * @param {{ checked: boolean, range: boolean }} how
   */
  toggle(id, { checked, range }) {
    const ids = this.#jobs.map((job) => job.id);
    const [from, to] = [ids.indexOf(range && this.#last ? this.#last : id), ids.indexOf(id)].sort((a, b) => a - b);
    const meant = from < 0 ? [id] : ids.slice(from, to + 1);
    this.#last = id;
    this.#select(checked ? [...this.#ids, ...meant] : [...this.#ids].filter((one) => !meant.includes(one)));
  }

  /** @param {string[]} ids */
  #select(ids) {
    this.#ids = new Set(ids);
    this.#changed();
  }

  #selected() {
    return this.#jobs.filter(({ id }) => this.#ids.has(id));
  }

  /**
   * @param {Api.JobState} state - of the jobs that it is for
   * @param {"pause" | "resume"} what
   * @param {string} done
   */
  #steer(state, what, done) {
    return this.#send(this.#selected().filter((job) => job.state === state), done, ({ links }) => send("POST", links[what]));
  }

  async #cancel() {
    const jobs = this.#selected();
    const these = several(jobs.length, "job");
    const kept = "Jobs that are being rendered keep the image that they have by then.";
    if (await confirmed(`Cancel ${these}?`, kept, `Cancel ${these}`, "Keep them")) {
      await this.#send(jobs, "Cancelled", ({ links }) => send("POST", links.cancel));
    }
  }

  /**
   * Sends a request for each of the jobs, and says how many were done, and which were refused.
   * @param {Api.JobView[]} jobs
   * @param {string} done
   * @param {(job: Api.JobView) => Promise<unknown>} request
   */
  async #send(jobs, done, request) {
    /** @type {string[]} */
    const refused = [];
    const queue = jobs.values();
    await Promise.all(Array.from({ length: AT_ONCE }, async () => {
      for (const job of queue) {
        await request(job).catch((error) => refused.push(`${title(job)}: ${messageOf(error)}`));
      }
    }));
    if (refused.length < jobs.length) say(`${done}: ${several(jobs.length - refused.length, "job")}`);
    complain(refused.length ? `Refused for ${refused.length} of ${several(jobs.length, "job")}. ${refused[0]}` : "", true);
    await this.#refresh();
  }
}
