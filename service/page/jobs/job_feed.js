// Which jobs the list knows, newest first, and how they are kept up to date however many there are:
// with every look the newest page, those that render, and one of the older pages in turn.

import { get } from "../shared/api.js";
import { ENDED } from "../shared/job_summary.js";

const PAGE = 50;
/** So many jobs are asked for by themselves with a look. */
const SINGLE = 20;

export class JobFeed {
  #asked;
  #signal;
  #turn = null;
  #wantsOlder = false;
  /** The jobs, newest first. */
  jobs = [];
  /** From where older ones would come; null where there are none. */
  next = null;

  /** `asked` has the `state` and the `batch` that are wanted, where any are. */
  constructor(asked, signal) {
    this.#asked = asked;
    this.#signal = signal;
  }

  /** Brings the jobs up to date. */
  async refresh() {
    const before = new Map(this.jobs.map((job) => [job.id, job]));
    const first = await this.#page({ limit: PAGE });
    const seen = new Set(first.jobs.map(({ id }) => id));
    const older = this.jobs.filter(({ id }) => !seen.has(id));
    if (!this.#wantsOlder || !older.length || !first.next_cursor) {
      this.jobs = first.jobs;
      this.next = first.next_cursor;
      this.#turn = null;
      this.#wantsOlder = false;
      return;
    }
    this.jobs = [...first.jobs, ...older];
    const [rendering, page] = await Promise.all([this.#rendering(), this.#inTurn(first)]);
    for (const job of [...page, ...rendering]) seen.add(job.id);
    const now = new Map([...rendering, ...await this.#single(before, seen)].map((job) => [job.id, job]));
    this.jobs = this.jobs.map((job) => now.get(job.id) ?? job);
  }

  /** Adds a page of older ones. */
  async older() {
    const { jobs, next_cursor: next } = await this.#page({ limit: PAGE, cursor: this.next });
    const known = new Set(this.jobs.map(({ id }) => id));
    this.jobs = [...this.jobs, ...jobs.filter(({ id }) => !known.has(id))];
    this.next = next;
    this.#wantsOlder = true;
  }

  async #page(query) {
    const wanted = ["state", "batch"].filter((name) => this.#asked.get(name)).map((name) => [name, this.#asked.get(name)]);
    return get(`/v1/jobs?${new URLSearchParams([...wanted, ...Object.entries(query)])}`, this.#signal);
  }

  /** What renders, among all that is wanted: it changes with every look. */
  async #rendering() {
    const state = this.#asked.get("state");
    if (state && state !== "rendering") return [];
    const query = new URLSearchParams({ state: "rendering", limit: 200 });
    if (this.#asked.get("batch")) query.set("batch", this.#asked.get("batch"));
    return (await get(`/v1/jobs?${query}`, this.#signal)).jobs;
  }

  /** Looks at the next of the older pages; what is gone from it is left out. */
  async #inTurn(first) {
    const turn = this.#turn ?? { cursor: first.next_cursor, after: first.jobs.at(-1).id };
    const { jobs: found, next_cursor: next } = await this.#page({ limit: PAGE, cursor: turn.cursor });
    // Of a page that reaches further back than the list only what the list has.
    const end = found.findIndex(({ id }) => id === this.jobs.at(-1).id);
    const jobs = end < 0 ? found : found.slice(0, end + 1);
    const start = this.jobs.findIndex(({ id }) => id === turn.after) + 1;
    const last = jobs.length ? this.jobs.findIndex(({ id }) => id === jobs.at(-1).id) : -1;
    this.#turn = null;
    if (!start) return [];  // that one has gone meanwhile: it begins anew with the next look
    const rest = last < 0 || !next ? [] : this.jobs.slice(last + 1);  // after the last page there is nothing
    this.jobs = [...this.jobs.slice(0, start), ...jobs, ...rest];
    if (rest.length) this.#turn = { cursor: next, after: jobs.at(-1).id };
    else if (end < 0) this.next = next;
    return jobs;
  }

  /** Those that have just stopped rendering, or whose images were still being written. */
  async #single(before, seen) {
    const open = [...before.values()].filter(({ id, state, finished_at: finished }) =>
      !seen.has(id) && !finished && (state === "rendering" || ENDED.has(state)));
    return Promise.all(open.slice(0, SINGLE).map((job) => get(job.links.self, this.#signal).catch(() => job)));
  }
}
