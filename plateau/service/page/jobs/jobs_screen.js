// The list of jobs: their progress and their outcomes.

import { get } from "../shared/api.js";
import { h, KeyedList, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { ENDED, inWords } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";
import { repeat } from "../shared/polling.js";
import { meetRules } from "../shared/rules.js";
import { BatchGroup } from "./batch_group.js";
import { JobFeed } from "./job_feed.js";
import { JobRow } from "./job_row.js";
import { ORDERS } from "./narrowing.js";
import { Selection } from "./selection.js";

const BUSY_MS = 2000;
const CALM_MS = 3000;
/** So many jobs are sorted without a click on the button for older ones. */
const REACH = 1000;
const REACH_PAGE = 200;
/** A search begins when nothing was typed for this long. */
const TYPED_MS = 200;
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
  let loaded = false;
  let reaching = false;
  /** @type {ReturnType<typeof setTimeout>} */
  let typed;

  const summary = h("p", { class: "summary", "aria-live": "polite" });
  const states = filter("State", "state", "any state", inWords);
  states.offer(STATES);
  const batches = filter("Batch", "batch", "any batch");
  const shelves = filter("Show", "show", "current jobs");
  shelves.offer(["deleted"]);
  const search = h("input", { type: "search", "aria-label": "Search the jobs", placeholder: "Search",
    maxlength: 200, value: asked.get("search"), oninput: () => { narrow("search", search.value.trim()); } });
  const order = h("select", { "aria-label": "Order", onchange: () => { narrow("sort", order.value); } },
    h("option", { value: "" }, "newest first"),
    [...ORDERS].map(([value, { words }]) => h("option", { value }, words)));
  const sort = asked.get("sort") ?? "";
  order.value = ORDERS.has(sort) ? sort : "";
  const selection = new Selection(show, refresh, deleted);
  const list = h("ul", { class: "jobs", "aria-label": "Jobs" });
  const more = h("button", { class: "more", hidden: true, onclick: () => older().catch(() => {}) }, "Older jobs");
  const nothing = h("div", { class: "nothing", hidden: true });
  main.append(
    h("div", { class: "head" },
      h("div", {}, h("h1", {}, "Jobs"), summary),
      h("div", { class: "filters" }, search, states.label, batches.label, shelves.label, order)),
    list, nothing, more, selection.element);

  const context = { signal, refresh, deleted, visible, selection };
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
      go(addressWith(field, select.value));
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

  /**
   * The address of this list with a field of its own.
   * @param {string} field
   * @param {string} value
   */
  function addressWith(field, value) {
    if (value) asked.set(field, value);
    else asked.delete(field);
    return `/${asked.size ? `?${asked}` : ""}`;
  }

  /**
   * @param {"search" | "sort"} field
   * @param {string} value
   */
  function narrow(field, value) {
    history.replaceState(null, "", addressWith(field, value));
    if (!loaded) return;
    clearTimeout(typed);
    typed = setTimeout(() => refresh().catch(() => {}), TYPED_MS);  // the next refresh tries again
    if (field === "sort") show();
  }

  /**
   * Jobs were deleted or restored, and so leave the list.
   * @param {string[]} ids
   */
  async function deleted(ids) {
    feed.drop(ids);
    if (!signal.aborted) await refresh();
  }

  /** Whether the jobs to sort are still to be fetched. */
  function reaches() {
    return Boolean(feed.next) && feed.jobs.length < REACH && asked.has("sort");
  }

  async function reach() {
    if (reaching) return;
    reaching = true;
    try {
      while (reaches()) {
        await feed.older(REACH_PAGE);
        show();
      }
    } finally {
      reaching = false;
    }
  }

  async function refresh() {
    const [, { workers: alive }] = await Promise.all([feed.refresh(), get("/v1/workers", signal), meetRules(signal)]);
    workers = alive;
    loaded = true;
    show();
    await reach();
  }

  async function older() {
    await feed.older();
    show();
  }

  function show() {
    const by = ORDERS.get(order.value)?.order;
    const jobs = (by ? [...feed.jobs].sort(by) : feed.jobs)
      .map((job) => ({ ...job, serving: workers.filter((worker) => worker.job === job.id).length }));
    const items = grouped(jobs);
    selection.show(items.flatMap((item) => ("batch" in item ? item.jobs : item)));
    rows.show(items, (item) => ("batch" in item ? `batch ${item.batch}` : item.id));
    batches.offer([...new Set(feed.jobs.flatMap((job) => job.spec.batch ?? []))]);
    setText(summary, summed(jobs, Boolean(feed.next), workers));
    more.hidden = !feed.next || reaches();
    nothing.hidden = jobs.length > 0 || reaches();
    const filtered = ["search", "state", "batch", "show"].some((name) => asked.has(name));
    const shown = `${filtered} ${maySubmit()}`;
    if (!nothing.hidden && nothing.dataset.shown !== shown) {
      nothing.dataset.shown = shown;
      nothing.replaceChildren(...emptiness(filtered));
    }
  }

  let took = 0;  // a search of a large farm is repeated less often
  async function timed() {
    const began = performance.now();
    await refresh();
    took = performance.now() - began;
  }
  repeat(timed, () => Math.max(feed.jobs.some((job) => !job.finished_at) ? BUSY_MS : CALM_MS, 10 * took), signal);
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
 * @param {Api.JobView[]} jobs
 * @param {boolean} more - whether there are older ones
 * @param {Api.Worker[]} workers
 */
function summed(jobs, more, workers) {
  const counts = STATES.slice(0, 3)
    .map((state) => [state, jobs.filter((job) => job.state === state).length])
    .filter(([, count]) => count)
    .map(([state, count]) => `${count} ${state}`);
  const ended = jobs.filter((job) => ENDED.has(job.state)).length;
  if (ended) counts.push(`${ended}${more ? " or more" : ""} ended`);
  const alive = workers.length ? several(workers.length, "worker") : "no worker: nothing is rendered";
  return [counts.join(", "), alive].filter(Boolean).join(" · ");
}

/** @param {boolean} filtered */
function emptiness(filtered) {
  if (filtered) return [h("p", {}, "No job matches."), h("a", { href: "/" }, "Show all jobs")];
  if (!maySubmit()) return [h("p", { class: "lead" }, "Nothing to see yet.")];
  return [
    h("p", { class: "lead" }, "Nothing to see yet."),
    h("p", {}, "Submit a Mitsuba scene, and watch it until more samples change nothing that you could see."),
    h("a", { class: "button primary", href: "/submit" }, "Submit a scene"),
  ];
}
