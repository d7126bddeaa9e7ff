// The list of jobs: what runs, how far it is, what came of the rest.

import { get } from "../shared/api.js";
import { h, KeyedList, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { ENDED } from "../shared/job_summary.js";
import { repeat } from "../shared/polling.js";
import { BatchGroup } from "./batch_group.js";
import { JobFeed } from "./job_feed.js";
import { JobRow } from "./job_row.js";

const BUSY_MS = 2000;
const CALM_MS = 3000;
const STATES = ["rendering", "queued", "paused", "converged", "exhausted", "cancelled", "failed"];

export function open(main, { signal, go }) {
  document.title = "Jobs · Plateau";
  const asked = new URLSearchParams(location.search);
  const feed = new JobFeed(asked, signal);
  let workers = [];

  const summary = h("p", { class: "summary", "aria-live": "polite" });
  const states = filter("State", "state", [["", "any state"], ...STATES.map((one) => [one, one])]);
  const batches = filter("Batch", "batch", [["", "any batch"]]);
  const list = h("ul", { class: "jobs", "aria-label": "Jobs" });
  const more = h("button", { class: "more", hidden: true, onclick: () => older().catch(() => {}) }, "Older jobs");
  const nothing = h("div", { class: "nothing", hidden: true });
  main.append(
    h("div", { class: "head" },
      h("div", {}, h("h1", {}, "Jobs"), summary),
      h("div", { class: "filters" }, states.label, batches.label)),
    list, nothing, more);

  const rows = new KeyedList(list, (item) =>
    item.batch ? new BatchGroup(item, { signal, refresh, visible }) : new JobRow({ signal, refresh, visible }));

  // Only rows in sight ask for pictures and curves.
  const inSight = new WeakMap();
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) inSight.get(entry.target)?.(entry.isIntersecting);
  }, { rootMargin: "200px" });
  signal.addEventListener("abort", () => observer.disconnect());
  function visible(element, tell) {
    inSight.set(element, tell);
    observer.observe(element);
  }

  function filter(name, field, options) {
    const select = h("select", { onchange: () => {
      if (select.value) asked.set(field, select.value);
      else asked.delete(field);
      go(`/${asked.size ? `?${asked}` : ""}`);
    } });
    const label = h("label", {}, h("span", {}, name), select);
    const offer = (values) => {
      for (const [value, text] of values) {
        if (![...select.options].some((option) => option.value === value)) {
          select.append(h("option", { value }, text));
        }
      }
      select.value = asked.get(field) ?? "";
    };
    offer(options);
    const wanted = asked.get(field);
    if (wanted) offer([[wanted, wanted]]);
    return { label, offer };
  }

  async function refresh() {
    const [, { workers: alive }] = await Promise.all([feed.refresh(), get("/v1/workers", signal)]);
    workers = alive;
    show();
  }

  async function older() {
    await feed.older();
    show();
  }

  function show() {
    const serving = new Map();
    for (const { job } of workers) if (job) serving.set(job, (serving.get(job) ?? 0) + 1);
    for (const job of feed.jobs) job.serving = serving.get(job.id) ?? 0;
    rows.show(grouped(feed.jobs), (item) => (item.batch ? `batch ${item.batch}` : item.id));
    batches.offer([...new Set(feed.jobs.map((job) => job.spec.batch).filter(Boolean))].map((one) => [one, one]));
    setText(summary, summed(feed, workers));
    more.hidden = !feed.next;
    nothing.hidden = feed.jobs.length > 0;
    if (!nothing.hidden && !nothing.firstChild) nothing.append(...emptiness(asked.size > 0));
  }

  repeat(refresh, () => (feed.jobs.some((job) => !job.finished_at) ? BUSY_MS : CALM_MS), signal);
}

/** The jobs in their order, those of one batch together where its newest one is. */
function grouped(jobs) {
  const groups = new Map();
  const items = [];
  for (const job of jobs) {
    const batch = job.spec.batch;
    if (!batch) items.push(job);
    else if (groups.has(batch)) groups.get(batch).jobs.push(job);
    else {
      groups.set(batch, { batch, jobs: [job] });
      items.push(groups.get(batch));
    }
  }
  return items;
}

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

function emptiness(filtered) {
  if (filtered) return [h("p", {}, "No job matches these filters. "), h("a", { href: "/" }, "Show all jobs")];
  return [
    h("p", { class: "lead" }, "Nothing to see yet."),
    h("p", {}, "Submit a Mitsuba scene, and watch it until more samples change nothing that you could see."),
    h("a", { class: "button primary", href: "/submit" }, "Submit a scene"),
  ];
}
