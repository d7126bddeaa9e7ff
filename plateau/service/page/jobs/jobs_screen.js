// The list of jobs: their progress and their outcomes.

import { get } from "../shared/api.js";
import { h, KeyedList, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { ENDED, inWords } from "../shared/job_summary.js";
import { maySubmit, metMe } from "../shared/permissions.js";
import { repeat } from "../shared/polling.js";
import { meetRules } from "../shared/rules.js";
import { BatchGroup } from "./batch_group.js";
import { JobRow } from "./job_row.js";
import { Selection } from "./selection.js";

const BUSY_MS = 2000;
const CALM_MS = 3000;
/** How many jobs are listed at first, and how many more with each click. */
const PAGE = 50;
/** The most that the API sends at once. */
const MOST = 200;
/** A search begins when nothing was typed for this long. */
const TYPED_MS = 200;
/** @type {Api.JobState[]} */
const STATES = ["rendering", "queued", "paused", "converged", "exhausted", "cancelled", "failed"];

/** @import { Screen } from "../main.js" */
/** @import { Group } from "./batch_group.js" */
/** @import { ListedJob } from "./job_row.js" */

/** @type {Screen} */
export function open(main, { signal }) {
  document.title = "Jobs · Plateau";
  const asked = new URLSearchParams(location.search);
  /** The listed jobs, newest first. @type {Api.JobView[]} */
  let jobs = [];
  let areMore = false;
  /** Where one was on this list, when one comes back to it. */
  let left = history.state ?? {};
  let wanted = left.wanted ?? PAGE;
  /** Of the refreshes: only the last one is shown. */
  let turn = 0;
  /** @type {Api.Worker[]} */
  let workers = [];
  /** @type {ReturnType<typeof setTimeout>} */
  let typed;

  const summary = h("p", { class: "summary", "aria-live": "polite" });
  const states = filter("State", "state", "any state", inWords);
  states.offer(STATES);
  const batches = filter("Batch", "batch", "any batch");
  const shelves = filter("Show", "show", "current jobs");
  shelves.offer(["deleted"]);
  const search = h("input", { type: "search", "aria-label": "Search the jobs", placeholder: "Search",
    maxlength: 200, value: asked.get("search"), oninput: () => {
      history.replaceState(history.state, "", addressWith("search", search.value.trim()));
      clearTimeout(typed);
      typed = setTimeout(refreshed, TYPED_MS);
    } });
  const selection = new Selection(show, refreshed);
  const list = h("ul", { class: "jobs", "aria-label": "Jobs" });
  const more = h("button", { class: "more", hidden: true, onclick: () => {
    wanted = jobs.length + PAGE;
    history.replaceState({ ...history.state, wanted }, "");
    refreshed();
  } }, "Older jobs");
  const nothing = h("div", { class: "nothing", hidden: true });
  main.append(
    h("div", { class: "head" },
      h("div", {}, h("h1", {}, "Jobs"), summary),
      h("div", { class: "filters" }, search, states.label, batches.label, shelves.label)),
    list, nothing, more, selection.element);

  const context = { signal, selection, isPart: () => areMore || [...asked.keys()].some((name) => name !== "batch") };
  const rows = new KeyedList(list, (/** @type {ListedJob | Group} */ item) =>
    /** @type {{ element: Element, update(item: ListedJob | Group): void }} */
    ("batch" in item ? new BatchGroup(item, context) : new JobRow(item, context)));
  signal.addEventListener("abort", () => rows.clear());  // frees their pictures

  /**
   * @param {string} name
   * @param {string} field
   * @param {string} any
   * @param {(value: any) => string} words - what an option is called
   */
  function filter(name, field, any, words = String) {
    const select = h("select", { onchange: () => {
      history.pushState(null, "", addressWith(field, select.value));
      wanted = PAGE;
      refreshed();
    } }, h("option", { value: "" }, any));
    const label = h("label", {}, h("span", {}, name), select);
    const offer = (/** @type {string[]} */ values) => {
      for (const value of values) {
        if (![...select.options].some((option) => option.value === value)) select.append(h("option", { value }, words(value)));
      }
      select.value = asked.get(field) ?? "";
    };
    offer([asked.get(field) ?? ""]);
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

  async function refresh() {
    const now = (turn += 1);
    const [found, { workers: alive }] = await Promise.all([fetched(), get("/v1/workers", signal), meetRules(signal), metMe]);
    if (now !== turn) return;
    jobs = found.jobs;
    areMore = found.areMore;
    workers = alive;
    show();
    if ((left.top || left.focus) && document.activeElement === main) {
      scrollTo(0, left.top);
      /** @type {HTMLElement | null} */ (list.querySelector(`a[href="${left.focus}"]`))?.focus({ preventScroll: true });
    }
    left = {};
  }

  /** Refreshes at once; where that fails, the next refresh tries again. */
  async function refreshed() {
    await refresh().catch(() => {});
  }

  /** The newest jobs that are asked for, as many as are wanted. */
  async function fetched() {
    const query = new URLSearchParams([...asked].filter(([name]) => name !== "show"));
    query.set("deleted", String(asked.get("show") === "deleted"));
    /** @type {Api.JobView[]} */
    const found = [];
    for (;;) {
      query.set("limit", String(Math.min(MOST, wanted - found.length)));
      /** @type {Api.JobPage} */
      const page = await get(`/v1/jobs?${query}`, signal);
      found.push(...page.jobs);
      if (!page.next_cursor || found.length >= wanted) return { jobs: found, areMore: Boolean(page.next_cursor) };
      query.set("cursor", page.next_cursor);
    }
  }

  function show() {
    const items = grouped(jobs.map((job) => ({ ...job, serving: workers.filter((worker) => worker.job === job.id).length })));
    selection.show(items.flatMap((item) => ("batch" in item ? item.jobs : item)));
    rows.show(items, (item) => ("batch" in item ? `batch ${item.batch}` : item.id));
    batches.offer([...new Set(jobs.flatMap((job) => job.spec.batch ?? []))]);
    setText(summary, summed(jobs, areMore, workers));
    if (!areMore && document.activeElement === more) main.focus({ preventScroll: true });
    more.hidden = !areMore;
    nothing.hidden = jobs.length > 0;
    const shown = `${asked.size > 0} ${maySubmit()}`;
    if (!nothing.hidden && nothing.dataset.shown !== shown) {
      nothing.dataset.shown = shown;
      nothing.replaceChildren(...emptiness(asked.size > 0));
    }
  }

  let took = 0;  // a search of a large farm is repeated less often, but one that waited for a key is not
  const metAt = metMe.then(() => performance.now());
  async function timed() {
    const began = performance.now();
    await refresh();
    took = Math.min(performance.now() - Math.max(began, await metAt), CALM_MS);
  }
  repeat(timed, () => Math.max(jobs.some((job) => !job.finished_at) ? BUSY_MS : CALM_MS, 10 * took), signal);
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
    .map(([state, count]) => `${count}${more ? " or more" : ""} ${state}`);
  const ended = jobs.filter((job) => ENDED.has(job.state)).length;
  if (ended) counts.push(`${ended}${more ? " or more" : ""} ended`);
  const alive = workers.length ? several(workers.length, "worker") : "no worker: nothing is rendered";
  return [counts.join(", "), alive].filter(Boolean).join(" · ");
}

/** @param {boolean} filtered */
function emptiness(filtered) {
  if (filtered) return [h("p", {}, "No job matches."), h("a", { href: "/" }, "Show all jobs")];
  const lead = h("p", { class: "lead" }, "Nothing to see yet.");
  if (!maySubmit()) return [lead];
  return [lead,
    h("p", {}, "Submit a scene, and watch it until more samples change nothing that you could see. "
      + "One to try, in a terminal: ", h("code", {}, `plateau submit scenes:box --url ${location.origin}`)),
    h("a", { class: "button primary", href: "/submit" }, "Submit a scene")];
}
