// The list of jobs: their progress and their outcomes.

import { get } from "../shared/api.js";
import { h, KeyedList, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { ENDED, inWords } from "../shared/job_summary.js";
import { repeat } from "../shared/polling.js";
import { meetRules } from "../shared/rules.js";
import { BatchGroup } from "./batch_group.js";
import { JobFeed } from "./job_feed.js";
import { JobRow } from "./job_row.js";

const BUSY_MS = 2000;
const CALM_MS = 3000;
/** @type {Api.JobState[]} */
const STATES = ["rendering", "queued", "paused", "converged", "exhausted", "cancelled", "failed"];

/** @import { Screen } from "../main.js" */
/** @import { Group } from "./batch_group.js" */
/** @import { ListedJob } from "./job_row.js" */

/** @type {Screen} */
export function open(main, { signal, go }) {
  document.title = "Jobs · Plateau";
  const asked = new URLSearchParams(location.search);
  const feed = new JobFeed(asked, signal);
  /** @type {Api.Worker[]} */
  let workers = [];

  const summary = h("p", { class: "summary", "aria-live": "polite" });
  const states = filter("State", "state", "any state", inWords);
  states.offer(STATES);
  const batches = filter("Batch", "batch", "any batch");
  const list = h("ul", { class: "jobs", "aria-label": "Jobs" });
  const more = h("button", { class: "more", hidden: true, onclick: () => older().catch(() => {}) }, "Older jobs");
  const nothing = h("div", { class: "nothing", hidden: true });
  main.append(
    h("div", { class: "head" },
      h("div", {}, h("h1", {}, "Jobs"), summary),
      h("div", { class: "filters" }, states.label, batches.label)),
    list, nothing, more);

  const context = { signal, refresh, visible };
  const rows = new KeyedList(list, (/** @type {ListedJob | Group} */ item) =>
    /** @type {{ element: Element, update(item: ListedJob | Group): void }} */
    ("batch" in item ? new BatchGroup(item, context) : new JobRow(item, context)));

  // Only visible rows fetch pictures and curves.
  /** @type {WeakMap<Element, (seen: boolean) => void>} */
  const inSight = new WeakMap();
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) inSight.get(entry.target)?.(entry.isIntersecting);
  }, { rootMargin: "200px" });
  signal.addEventListener("abort", () => observer.disconnect());
  /**
   * @param {Element} element
   * @param {(seen: boolean) => void} tell
   */
  function visible(element, tell) {
    inSight.set(element, tell);
    observer.observe(element);
  }

  /**
   * @param {string} name
   * @param {string} field
   * @param {string} any
   * @param {(value: any) => string} words - what an option is called
   */
  function filter(name, field, any, words = String) {
    const select = h("select", {}, h("option", { value: "" }, any));
    select.addEventListener("change", () => {
      if (select.value) asked.set(field, select.value);
      else asked.delete(field);
      go(`/${asked.size ? `?${asked}` : ""}`);
    });
    const label = h("label", {}, h("span", {}, name), select);
    const wanted = asked.get(field) ?? "";
    const offer = (/** @type {string[]} */ values) => {
      for (const value of values) {
        if (![...select.options].some((option) => option.value === value)) select.append(h("option", { value }, words(value)));
      }
      select.value = wanted;
    };
    offer([wanted]);
    return { label, offer };
  }

  async function refresh() {
    const [, { workers: alive }] = await Promise.all([feed.refresh(), get("/v1/workers", signal), meetRules(signal)]);
    workers = alive;
    show();
  }

  async function older() {
    await feed.older();
    show();
  }

  function show() {
    const jobs = feed.jobs.map((job) => ({ ...job, serving: workers.filter((worker) => worker.job === job.id).length }));
    rows.show(grouped(jobs), (item) => ("batch" in item ? `batch ${item.batch}` : item.id));
    batches.offer([...new Set(jobs.flatMap((job) => job.spec.batch ?? []))]);
    setText(summary, summed(feed, workers));
    more.hidden = !feed.next;
    nothing.hidden = feed.jobs.length > 0;
    if (!nothing.hidden && !nothing.firstChild) nothing.append(...emptiness(asked.size > 0));
  }

  repeat(refresh, () => (feed.jobs.some((job) => !job.finished_at) ? BUSY_MS : CALM_MS), signal);
}

/**
 * The jobs in their order; those of one batch are together at the place of its newest job.
 * @param {ListedJob[]} jobs
 */
function grouped(jobs) {
  /** @type {Map<string, Group>} */
  const groups = new Map();
  /** @type {(ListedJob | Group)[]} */
  const items = [];
  for (const job of jobs) {
    const batch = job.spec.batch;
    const group = groups.get(batch ?? "");
    if (!batch) items.push(job);
    else if (group) group.jobs.push(job);
    else {
      const first = { batch, jobs: [job] };
      groups.set(batch, first);
      items.push(first);
    }
  }
  return items;
}

/**
 * @param {JobFeed} feed
 * @param {Api.Worker[]} workers
 */
function summed({ jobs, next }, workers) {
  const counts = STATES.slice(0, 3)
    .map((state) => [state, jobs.filter((job) => job.state === state).length])
    .filter(([, count]) => count)
    .map(([state, count]) => `${count} ${state}`);
  const ended = jobs.filter((job) => ENDED.has(job.state)).length;
  if (ended) counts.push(`${ended}${next ? " or more" : ""} ended`);
  const alive = workers.length ? several(workers.length, "worker") : "no worker: nothing is rendered";
  return [counts.join(", "), alive].filter(Boolean).join(" · ");
}

/** @param {boolean} filtered */
function emptiness(filtered) {
  if (filtered) return [h("p", {}, "No job matches these filters. "), h("a", { href: "/" }, "Show all jobs")];
  return [
    h("p", { class: "lead" }, "Nothing to see yet."),
    h("p", {}, "Submit a Mitsuba scene, and watch it until more samples change nothing that you could see."),
    h("a", { class: "button primary", href: "/submit" }, "Submit a scene"),
  ];
}
