// The selected jobs, and the bar of actions on all of them.

import { downloadLink, send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { byId, h, setAttribute, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { mayControl, priorityForm } from "../shared/job_controls.js";
import { deleteOrRestore, deletionButtons, deletions, each } from "../shared/job_deletion.js";
import { say } from "../shared/notices.js";
import { comparisonOf } from "../shared/job_summary.js";
import { maySteer } from "../shared/permissions.js";

/** @import { Deletion } from "../shared/job_deletion.js" */

/** @type {Deletion[]} */
const DELETIONS = ["restore", "delete"];
/** Jobs whose results the API sends in one zip. */
const MOST_DOWNLOADED = 200;

export class Selection {
  #changed;
  #refresh;
  #deleted;
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
  #stop = h("button", { class: "danger", onclick: () => this.#cancel() }, "Cancel…");
  #priority = priorityForm(0, (priority) => this.#send(this.#selected().filter(mayControl), `Priority ${priority}`,
    ({ links }) => send("PATCH", links.self, { priority })));
  #compare = h("a", { class: "button", hidden: true }, "Compare");
  #download = downloadLink("", "results.zip", "Download");
  #deletions = deletionButtons(DELETIONS, (what) => deleteOrRestore(this.#fit(what), what, this.#deleted));
  #every = h("button", { class: "quiet", onclick: () => this.#select(this.#jobs.map(({ id }) => id)) });
  #clear = h("button", { class: "quiet", onclick: () => this.#select([]) }, "Clear");
  #bar = [
    this.#count, this.#compare, this.#download, this.#pause, this.#resume, this.#stop, this.#priority, ...this.#deletions, this.#every, this.#clear,
  ];
  element = h("div", { class: "selected", role: "region", "aria-label": "Selected jobs", hidden: true });

  /**
   * @param {() => void} changed - called when jobs are selected or not any more
   * @param {() => unknown} refresh - called when jobs were changed
   * @param {(ids: string[]) => unknown} deleted - called when jobs were deleted or restored
   */
  constructor(changed, refresh, deleted) {
    this.#changed = changed;
    this.#refresh = refresh;
    this.#deleted = deleted;
  }

  /**
   * Takes the listed jobs; one that is listed no more is selected no more.
   * @param {Api.JobView[]} jobs - from top to bottom
   */
  show(jobs) {
    const focused = this.element.contains(document.activeElement) ? document.activeElement : null;
    this.#jobs = jobs.filter(maySteer);
    const selected = this.#selected();
    this.#ids = new Set(selected.map(({ id }) => id));
    const states = new Set(selected.map(({ state }) => state));
    setText(this.#count, `${several(selected.length, "job")} selected`);
    setText(this.#every, `Select all ${this.#jobs.length}`);
    this.#pause.hidden = !states.has("rendering");
    this.#resume.hidden = !states.has("paused");
    this.#stop.hidden = this.#priority.hidden = !selected.some(mayControl);
    const compared = selected.length === 2 ? comparisonOf(selected[0], selected[1]) : null;
    this.#compare.hidden = !compared;
    setAttribute(this.#compare, "href", compared);
    const images = selected.filter(({ image_spp: spp }) => spp).slice(0, MOST_DOWNLOADED);
    this.#download.hidden = !images.length;
    this.#download.className = "button";
    setText(this.#download, images.length < selected.length ? `Download ${images.length}` : "Download");
    setAttribute(this.#download, "href", `/v1/results.zip?${images.map(({ id }) => `job=${id}`).join("&")}`);
    DELETIONS.forEach((what, at) => (this.#deletions[at].hidden = !this.#fit(what).length));
    this.#every.hidden = selected.length === this.#jobs.length;
    if (this.element.hidden === Boolean(selected.length)) {
      this.element.hidden = !selected.length;
      this.element.replaceChildren(...(selected.length ? this.#bar : []));
    }
    if (!focused || (selected.length && !focused.closest("[hidden]"))) return;
    // What had the focus is gone.
    if (selected.length) this.#clear.focus();
    else byId("main").focus({ preventScroll: true });
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
   * The selected jobs with which this can be done.
   * @param {Deletion} what
   */
  #fit(what) {
    return this.#selected().filter((job) => deletions(job).includes(what));
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
    const jobs = this.#selected().filter(mayControl);
    const these = several(jobs.length, "job");
    const kept = "Jobs that are being rendered keep the image that they have by then.";
    if (await confirmed(`Cancel ${these}?`, kept, `Cancel ${these}`, "Keep them")) {
      await this.#send(jobs, "Cancelled", ({ links }) => send("POST", links.cancel));
    }
  }

  /**
   * Sends a request for each of the jobs, and says for how many it was done.
   * @param {Api.JobView[]} jobs
   * @param {string} done
   * @param {(job: Api.JobView) => Promise<unknown>} request
   */
  async #send(jobs, done, request) {
    const { length } = await each(jobs, request);
    if (length) say(`${done}: ${several(length, "job")}`);
    await this.#refresh();
  }
}
