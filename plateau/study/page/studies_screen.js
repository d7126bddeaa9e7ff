// The list of observer studies: method, levels, participation and results.

import { get } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { ago, several, whole } from "../shared/figures.js";
import { repeat } from "../shared/polling.js";

const EVERY_MS = 10_000;

/** @import { Screen } from "../main.js" */

/** @type {Screen} */
export function open(main, { signal }) {
  document.title = "Studies · Plateau";
  const list = h("ul", { class: "studies", "aria-label": "Studies" });
  const nothing = h("div", { class: "nothing", hidden: true },
    h("p", { class: "lead" }, "There are no studies yet."),
    h("p", {}, "A study asks people how many samples it takes until they see no difference. It is made from a finished job that kept its slices: open the job and choose ",
      h("b", {}, "Study…"), "."));
  main.append(h("div", { class: "head" }, h("h1", {}, "Observer studies")), list, nothing);
  repeat(async () => {
    /** @type {Api.StudyList} */
    const { studies } = await get("/v1/studies", signal);
    list.replaceChildren(...studies.map(row));
    nothing.hidden = studies.length > 0;
  }, () => EVERY_MS, signal);
}

/** @param {Api.StudyView} study */
function row(study) {
  const { result, levels } = study;
  return h("li", { class: "study-row" },
    h("div", {},
      h("h2", {}, h("a", { href: study.links.page }, study.name)),
      h("p", { class: "summary" }, `${methodInWords(study)} · ${several(levels.length, "level")}, ${whole(levels[0])} to ${whole(levels[levels.length - 1])} spp · made ${ago(study.created_at)}`)),
    h("p", {}, `${several(result.observers, "observer")}, ${several(result.answers, "answer")}`),
    h("p", {}, halfInWords(result)));
}

/**
 * The method of a study, in words.
 * @param {Api.StudyView} study
 */
export function methodInWords({ method }) {
  return method === "limits" ? "first stage, rising and falling" : "constant stimuli";
}

/**
 * The threshold of 50 %, in words.
 * @param {Api.StudyResult} result
 */
function halfInWords({ thresholds }) {
  const half = thresholds.find(({ probability }) => probability === 0.5);
  return half ? `half see a difference at ${whole(half.spp)} spp` : "no threshold yet";
}
