// The jobs of the list, newest first, kept up to date. Each refresh fetches the newest page, the
// rendering jobs, and one of the older pages in turn.

import { get } from "../shared/api.js";
import { ENDED } from "../shared/job_summary.js";

const PAGE = 50;
/** The most jobs that a refresh fetches one by one. */
const SINGLE = 20;

export class JobFeed {
  #asked;
  #signal;
  /**
   * The older page whose turn is next, and the job before it.
   * @type {{ cursor: string | null, after: string } | null}
   */
  #turn = null;
  #wantsOlder = false;
  /** What the jobs were asked for with. */
  #had = "";
  /**
   * The jobs, newest first.
   * @type {Api.JobView[]}
   */
  jobs = [];
  /**
   * The cursor of older jobs; null if there are none.
   * @type {string | null}
   */
  next = null;

  /**
   * @param {URLSearchParams} asked - `state`, `batch`, `search` and `show`, if given, at any time
   * @param {AbortSignal} signal
   */
  constructor(asked, signal) {
    this.#asked = asked;
    this.#signal = signal;
  }

  /** Brings the jobs up to date. */
  async refresh() {
    const before = new Map(this.jobs.map((job) => [job.id, job]));
    const wanted = this.#wanted();
    const first = await this.#page({ limit: PAGE });
    if (wanted !== this.#wanted()) return;  // another refresh asks for what is wanted now
    const seen = new Set(first.jobs.map(({ id }) => id));
    const older = this.jobs.filter(({ id }) => !seen.has(id));
    if (!this.#wantsOlder || !older.length || !first.next_cursor || wanted !== this.#had) {
      this.jobs = first.jobs;
      this.next = first.next_cursor;
      this.#turn = null;
      this.#wantsOlder = false;
      this.#had = wanted;
      return;
    }
    this.jobs = [...first.jobs, ...older];
    const [rendering, page] = await Promise.all([this.#rendering(), this.#inTurn(first)]);
    for (const job of [...page, ...rendering]) seen.add(job.id);
    const now = new Map([...rendering, ...await this.#single(before, seen)].map((job) => [job.id, job]));
    this.jobs = this.jobs.map((job) => now.get(job.id) ?? job);
  }

  /** Adds a page of older jobs. */
  async older(limit = PAGE) {
    const wanted = this.#wanted();
    const { jobs, next_cursor: next } = await this.#page({ limit, cursor: this.next });
    if (wanted !== this.#wanted() || wanted !== this.#had) return;
    const known = new Set(this.jobs.map(({ id }) => id));
    this.jobs = [...this.jobs, ...jobs.filter(({ id }) => !known.has(id))];
    this.next = next;
    this.#wantsOlder = true;
  }

  /**
   * Drops jobs that are listed no more.
   * @param {string[]} ids
   */
  drop(ids) {
    this.jobs = this.jobs.filter(({ id }) => !ids.includes(id));
  }

  #wanted() {
    return ["state", "batch", "search", "show"].map((name) => this.#asked.get(name) ?? "").join("\n");
  }

  /**
   * A page of the filtered jobs.
   * @param {{ cursor?: string | null, limit: number, state?: string | null }} query
   * @returns {Promise<Api.JobPage>}
   */
  #page(query) {
    const [batch, search, show] = ["batch", "search", "show"].map((name) => this.#asked.get(name));
    const asked = { state: this.#asked.get("state"), batch, search, deleted: show === "deleted", ...query };
    const given = Object.entries(asked).filter(([, value]) => value).map(([name, value]) => [name, String(value)]);
    return get(`/v1/jobs?${new URLSearchParams(given)}`, this.#signal);
  }

  /** The filtered jobs that are rendering, which change all the time. */
  async #rendering() {
    const state = this.#asked.get("state") || "rendering";
    return state === "rendering" && !this.#asked.has("show") ? (await this.#page({ state, limit: 200 })).jobs : [];
  }

  /**
   * Fetches the next of the older pages, and drops the jobs that it no longer has.
   * @param {Api.JobPage} first
   */
  async #inTurn(first) {
    const turn = this.#turn ?? { cursor: first.next_cursor, after: first.jobs[first.jobs.length - 1].id };
    const { jobs: found, next_cursor: next } = await this.#page({ limit: PAGE, cursor: turn.cursor });
    // A page that reaches further back than the list adds nothing to it.
    const end = found.findIndex(({ id }) => id === this.jobs.at(-1)?.id);
    const jobs = end < 0 ? found : found.slice(0, end + 1);
    const start = this.jobs.findIndex(({ id }) => id === turn.after) + 1;
    const oldest = jobs.at(-1);
    const last = oldest ? this.jobs.findIndex(({ id }) => id === oldest.id) : -1;
    this.#turn = null;
    if (!start) return [];  // the job before the page is gone: the next refresh starts anew
    const rest = last < 0 || !next ? [] : this.jobs.slice(last + 1);  // nothing follows the last page
    this.jobs = [...this.jobs.slice(0, start), ...jobs, ...rest];
    if (oldest && rest.length) this.#turn = { cursor: next, after: oldest.id };
    else if (end < 0) this.next = next;
    return jobs;
  }

  /**
   * The jobs that have just stopped rendering, or whose images were still being written.
   * @param {Map<string, Api.JobView>} before
   * @param {Set<string>} seen
   * @returns {Promise<Api.JobView[]>}
   */
  #single(before, seen) {
    const open = [...before.values()].filter(({ id, state, finished_at: finished }) =>
      !seen.has(id) && !finished && (state === "rendering" || ENDED.has(state)));
    return Promise.all(open.slice(0, SINGLE).map((job) => get(job.links.self, this.#signal).catch(() => job)));
  }
}
