// Judging the kept slices of an ended job again: by other rules, or under another view.

import { openForm } from "../shared/dialogs.js";
import { h, setText } from "../shared/dom.js";
import { whole } from "../shared/figures.js";
import { blame, fieldsOf } from "../shared/form_fields.js";
import { jobMaker } from "../shared/job_request.js";
import { ENDED } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";
import { RULES, watchable } from "../shared/rules.js";
import { LIMITS, VIEW } from "../shared/spec_fields.js";

/** By zones, each step has decided a later one, so that it cannot change. */
const stepOf = (/** @type {Api.JobView} */ job) =>
  LIMITS.filter(({ name }) => name === "step" && job.spec.allocation.name === "frame");

/** @import { FieldAbout } from "../shared/form_fields.js" */

/**
 * The button for it; null if the slices were not kept.
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
export function rejudgeButton(job, go) {
  if (!ENDED.has(job.state) || !job.finished_at || !job.spec.keep_slices || !job.spp || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Judge again…");
}

/**
 * @param {Api.JobView} job
 * @param {(path: string) => void} go
 */
function ask(job, go) {
  const { spec } = job;
  const rules = RULES.map((rule) => ({
    ...rule, ...fieldsOf("spec.rule", rule.name === spec.rule.name ? asItWas(rule.fields, spec.rule) : rule.fields),
  }));
  let chosen = rules.find(({ name }) => name === spec.rule.name) ?? rules[0];
  const view = fieldsOf("spec.view", asItWas(VIEW, spec.view));
  const step = fieldsOf("spec", asItWas(stepOf(job), spec));
  const choice = h("select", { id: "rejudge-rule", "aria-describedby": "rejudge-help", onchange: () => turn() },
    rules.map(({ name, title: text }) => h("option", { value: name, selected: name === spec.rule.name }, text)));
  const help = h("p", { class: "help", id: "rejudge-help" });
  const ofRule = h("div", { class: "fields small" });
  const watched = watchable(RULES).map(({ name, title: text }) => {
    const box = h("input", { type: "checkbox", checked: spec.watch.some((one) => one.name === name) });
    return { name, box, label: h("label", { class: "toggle" }, box, text) };
  });

  function turn() {
    chosen = rules.find(({ name }) => name === choice.value) ?? chosen;
    setText(help, chosen.help);
    ofRule.replaceChildren(...chosen.elements);
    for (const one of watched) one.box.disabled = one.name === chosen.name;
  }

  function changes() {
    const watch = watched.filter(({ name, box }) => box.checked && name !== chosen.name);
    return {
      rule: { name: chosen.name, ...chosen.values() },
      watch: watch.map(({ name }) => spec.watch.find((rule) => rule.name === name) ?? { name }),
      view: { pixels_per_degree: null, ...view.values() }, ...step.values(),
    };
  }

  turn();
  const dialog = openForm(`Judge ${job.name} again`, "Judge it", [
    h("p", {}, `A new job judges the slices that this one kept, up to ${whole(job.committed_spp)} spp, and shows where it would have stopped. Nothing is rendered; this job stays as it is.`),
    h("div", { class: "field" }, h("label", { for: choice.id }, "The rule that ends it"), choice, help), ofRule,
    h("fieldset", { class: "watch" }, h("legend", {}, "Rules to watch beside it"), watched.map(({ label }) => label)),
    h("div", { class: "fields small" }, view.elements, step.elements),
  ], {
    send: jobMaker(job.links.rejudge, changes, go),
    refused: (error) => blame([...chosen.fields, ...view.fields, ...step.fields], error)[0]?.input.focus(),
  });
  dialog.classList.add("wide");
}

/**
 * Fields with the old job's values.
 * @param {FieldAbout[]} abouts
 * @param {object} had
 * @returns {FieldAbout[]}
 */
function asItWas(abouts, had) {
  const values = new Map(Object.entries(had));
  return abouts.map((about) => ({ ...about, value: values.get(about.name) ?? about.value }));
}
