// A job: is it there yet, what does it look like, and why did it stop?

import { extensions } from "../extensions.js";
import { follow, get, isProblem } from "../shared/api.js";
import { h, setAttribute, setText } from "../shared/dom.js";
import { ago, whole } from "../shared/figures.js";
import { JobControls } from "../shared/job_controls.js";
import { AGAIN, deletedSince, ENDED, shortId, took } from "../shared/job_summary.js";
import { complain, messageOf } from "../shared/notices.js";
import { maySteer, maySubmit, metMe } from "../shared/permissions.js";
import { repeat } from "../shared/polling.js";
import { meetRules } from "../shared/rules.js";
import { CostFigures } from "./cost_figures.js";
import { CurveChart } from "./curve/curve_chart.js";
import { reasonInWords } from "./reason.js";
import { Records } from "./story_log_files.js";
import { Viewer } from "./viewer/viewer.js";

const LOOK_MS = 1500;
const CALM_MS = 10_000;

/** @import { Screen } from "../main.js" */

/** @type {Screen} */
export function open(main, { id, signal, go }) {
  document.title = "Plateau";
  const path = `/v1/jobs/${encodeURIComponent(id)}`;
  const name = h("h1");
  const state = h("span", { class: "state", role: "status" });
  const shortened = h("code", { class: "job-id" });
  const about = h("p", { class: "summary" });
  const reason = h("p", { class: "reason" });
  const progress = h("progress", { max: 1, "aria-label": "Samples merged of the cap" });
  const again = h("p", { class: "summary", hidden: true });
  const controls = new JobControls(() => look().catch(() => {}));  // the next look tries again
  const links = h("span", { class: "job-actions" });
  const actions = h("div", { class: "job-actions", role: "group", "aria-label": "Actions" }, links, controls.elements);
  const chart = new CurveChart(signal);
  const viewer = new Viewer(signal);
  const facts = new CostFigures();
  const records = new Records(signal);
  /** @type {Api.CurvePoint[]} */
  const points = [];
  let shown = "";

  const screen = h("article", { class: "one-job", hidden: true },
    h("header", {},
      h("p", { class: "crumb" }, h("a", { href: "/" }, "Jobs")),
      h("div", { class: "head" },
        h("div", {}, h("p", { class: "title" }, name, state, shortened), about, again),
        actions),
      reason, progress),
    h("div", { class: "pair" }, viewer.element, chart.element),
    facts.element, records.element);
  // A heading for screen readers until the job has been fetched.
  const absent = h("div", { class: "nothing" }, h("h1", { class: "unseen" }, "A job"));
  main.append(screen, absent);

  let looks = 0, shownLook = 0;  // an older answer may come after a newer one
  async function look() {
    const now = (looks += 1);
    /** @type {Api.JobView} */
    let job;
    try {
      [job] = await Promise.all([get(path, signal), meetRules(signal), metMe]);
    } catch (error) {
      if (!isProblem(error, "unknown-job")) throw error;
      screen.hidden = true;
      absent.hidden = false;
      if (absent.childElementCount < 2) absent.replaceChildren(h("h1", {}, "There is no such job"), h("p", {}, messageOf(error)), h("a", { href: "/" }, "All jobs"));
      return null;
    }
    /** @type {Api.Curve | null} */
    const curve = job.points > points.length ? await get(job.links.curve, signal) : null;
    if (now < shownLook) return job;
    shownLook = now;
    if (curve) points.splice(0, points.length, ...curve.points);
    show(job);
    await viewer.show(job, points);
    return job;
  }

  /** @param {Api.JobView} job */
  function show(job) {
    screen.hidden = false;
    absent.hidden = true;
    document.title = `${job.title}: ${job.outcome} · Plateau`;
    setText(name, job.name);
    setText(state, job.outcome);
    setAttribute(state, "data-state", job.state);
    setText(shortened, shortId(job));
    controls.show([job]);
    setText(about, [
      job.width && `${job.width} × ${job.height}`,
      job.variant,
      `samples ${job.sampled}`,
      `judged as seen ${job.seen}`,
      job.spec.batch && `batch ${job.spec.batch}`,
      job.owner_name && `by ${job.owner_name}`,
      deletedSince(job),
      ENDED.has(job.state) ? `${took(job)}, ended ${ago(job.ended_at)}` : job.time_left || `submitted ${ago(job.created_at)}`,
    ].filter(Boolean).join(" · "));
    if (again.hidden && job.again) {
      again.hidden = false;
      again.replaceChildren(...againInWords(job.again));
    }
    setText(reason, reasonInWords(job));
    progress.hidden = ENDED.has(job.state);
    // Where it is expected to end, if that is known, is a better goal than the cap.
    const goal = Math.min(job.expected_spp ?? job.spec.max_spp, job.spec.max_spp);
    progress.value = Math.min(1, job.spp / goal);
    setAttribute(progress, "title", `${whole(job.spp)} of ${whole(goal)} spp`);
    const kind = `${job.state} ${job.finished_at ?? ""} ${maySteer(job)} ${maySubmit()}`;
    if (kind !== shown) {
      shown = kind;
      links.replaceChildren(...[againLink(job), ...extensions.flatMap((one) => one.jobButtons).map((make) => make(job, go))].filter((one) => one !== null));
    }
    chart.show(job, points);
    facts.show(job);
    records.show(job);
  }

  /** Null where there is no such job. @type {Api.JobView | null | undefined} */
  let last;
  let wanted = false;
  async function lookSoon() {
    if (wanted) return;
    wanted = true;
    await new Promise((resolve) => setTimeout(resolve, 150));
    wanted = false;
    last = await look().catch(() => last);
  }
  follow(`${path}/events`, (events) => {
    records.tell(events);
    if (events.some(({ type }) => type !== "slice")) lookSoon();
  }, signal).catch(complain);
  // Events announce news; images come slightly later, and rates change between events.
  repeat(async () => (last = await look()), () => (last === null || last?.finished_at ? CALM_MS : LOOK_MS), signal);
}

/**
 * The way to the form with the scene and the spec of an ended job; null if it cannot be rendered again.
 * @param {Api.JobView} job
 */
function againLink(job) {
  if (!ENDED.has(job.state) || (!job.finished_at && job.committed_spp) || !maySteer(job)) return null;
  return h("a", { class: "button", href: `/submit?${AGAIN}=${job.id}` }, "Again…");
}

/**
 * What a job has of the one that it renders again.
 * @param {Api.Again} again
 */
function againInWords({ of, kept_spp: kept, why }) {
  const earlier = h("a", { href: `/jobs/${of}` }, "an earlier job");
  if (kept) return [`It keeps ${whole(kept)} spp of `, earlier, "."];
  return ["It renders ", earlier, ` anew: ${why === "gone" ? "none of its samples are left" : `with this ${why} its samples cannot be kept`}.`];
}
