// A study, for its experimenter: what it compares, the answers and the results.

import { downloadLink, get, isProblem, send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { h } from "../shared/dom.js";
import { percent, several, whole } from "../shared/figures.js";
import { attempt } from "../shared/notices.js";
import { maySteer, maySubmit } from "../shared/permissions.js";
import { repeat } from "../shared/polling.js";
import { methodInWords } from "./studies_screen.js";
import { studyPlot } from "./threshold_plot.js";

const EVERY_MS = 5000;

/** @import { Screen } from "../main.js" */

/** @type {Screen} */
export function open(main, { id, signal, go }) {
  document.title = "Study · Plateau";
  const path = `/v1/studies/${encodeURIComponent(id)}`;
  const screen = h("article", { class: "one-study" }, h("h1", { class: "unseen" }, "A study"));
  main.append(screen);
  let shown = "";

  repeat(async () => {
    /** @type {Api.StudyView} */
    let study;
    try {
      study = await get(path, signal);
    } catch (error) {
      if (!isProblem(error, "unknown-study", "invalid-request")) throw error;
      screen.replaceChildren(h("div", { class: "nothing" },
        h("h1", {}, "There is no such study"), h("a", { href: "/studies" }, "All studies")));
      return;
    }
    const now = JSON.stringify([study, maySubmit()]);
    if (now === shown) return; // unchanged elements keep the focus
    shown = now;
    document.title = `${study.name} · Study · Plateau`;
    screen.replaceChildren(...parts(study));
  }, () => EVERY_MS, signal);

  /** @param {Api.StudyView} study */
  function parts(study) {
    const { result } = study;
    return [
      h("header", {},
        h("p", { class: "crumb" }, h("a", { href: "/studies" }, "Studies")),
        h("div", { class: "head" },
          h("div", {},
            h("h1", {}, study.name),
            h("p", { class: "summary" }, `${methodInWords(study)} · ${study.width} × ${study.height} · ${several(study.trials, "pair")} for each observer`)),
          h("div", { class: "job-actions", role: "group", "aria-label": "Actions" }, ...actions(study)))),
      h("p", {}, "Images of ", h("a", { href: `/jobs/${study.job_id}` }, "a job"), `'s first slices, against ${whole(study.reference_spp)} spp of `,
        study.reference_job_id === study.job_id ? "the same job." : h("a", { href: `/jobs/${study.reference_job_id}` }, "another one.")),
      !study.independent && h("p", { class: "note" },
        "The reference contains the samples of the images that are compared with it, so they seem closer to it than they are. To avoid that, choose a reference job with another seed."),
      h("p", { class: "note" }, "Observers take part at ", h("a", { href: study.links.observe }, `${location.origin}${study.links.observe}`),
        ". They should not see this page first: it tells what others saw."),
      h("h2", {}, `${several(result.finished, "observer")} finished${result.observers > result.finished ? `, ${result.observers - result.finished} under way` : ""} · ${several(result.answers, "answer")}`),
      ...thresholds(result),
      result.answers > 0 && studyPlot(result),
      h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": "The answers at each level" }, h("table", {},
        h("thead", {}, h("tr", {}, ["spp", "shown", "difference seen", "share"].map((name) => h("th", { scope: "col" }, name)))),
        h("tbody", {}, result.levels.map(row)))),
      h("div", { class: "files" },
        downloadLink(study.links.trials_csv, `${study.id}-trials.csv`, "Every answer (CSV)"),
        h("span", {}, h("code", {}, "plateau study fit"), " reads and plots them")),
    ].filter((one) => one !== false);
  }

  /** @param {Api.StudyView} study */
  function actions(study) {
    /** @type {HTMLElement[]} */
    const found = [];
    if (maySubmit()) found.push(h("a", { class: "button primary", href: study.links.observe }, "Take part"));
    if (study.method === "limits" && study.result.suggested_levels.length > 1 && maySubmit()) {
      found.unshift(h("button", { onclick: () => attempt(() => secondStage(study), "The second stage is ready", () => {}) }, "Make the second stage"));
    }
    if (maySteer(study)) found.push(h("button", { class: "danger", onclick: remove }, "Delete"));
    async function remove() {
      if (await confirmed(`Delete ${study.name}?`, `Its ${several(study.result.answers, "answer")} will be gone for good. Save them first.`, "Delete it")) {
        await attempt(() => send("DELETE", path), "The study is deleted", () => go("/studies"));
      }
    }
    return found;
  }

  /** @param {Api.StudyView} study */
  async function secondStage(study) {
    /** @type {Api.StudyView} */
    const next = await send("POST", "/v1/studies", {
      job_id: study.job_id, reference_job_id: study.reference_job_id, name: study.name,
      method: "constant", levels: study.result.suggested_levels,
    });
    if (!signal.aborted) go(next.links.page);
  }
}

/**
 * The thresholds that the answers bound, in words.
 * @param {Api.StudyResult} result
 */
function thresholds({ thresholds: found, answers }) {
  if (!found.length && answers) {
    return [h("p", { class: "note" }, "The answers do not bound a threshold yet. Collect more of them, or show levels at which some see a difference and others do not.")];
  }
  return found.map(({ probability, spp, low_spp: low, high_spp: high }) =>
    h("p", { class: "threshold" }, h("strong", {}, `${whole(spp)} spp`),
      `a difference is seen in ${100 * probability} % of the answers here (95 % interval: ${whole(Math.max(0, low))} to ${whole(high)} spp).`));
}

/** @param {Api.LevelResult} level */
function row({ spp, shown, seen }) {
  const share = shown ? percent(seen / shown) : "–";
  return h("tr", {}, [whole(spp), whole(shown), whole(seen), share].map((text) => h("td", {}, text)));
}
