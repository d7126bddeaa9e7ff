// Judging the kept slices of an ended job again: by other rules, or as another display shows them.

import { send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { whole } from "../shared/figures.js";
import { fieldsOf } from "../shared/form_fields.js";
import { OneJob } from "../shared/job_request.js";
import { ENDED, title } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";
import { RULES, ruleNamed, watchable } from "../shared/rules.js";
import { LIMITS, VIEW } from "../shared/spec_fields.js";

const STEP = LIMITS.filter(({ name }) => name === "step");

/** A button that asks how; null where the slices were not kept. */
export function rejudgeButton(job, go) {
  if (!ENDED.has(job.state) || !job.finished_at || !job.spec.keep_slices || !job.spp || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Judge again…");
}

function ask(job, go) {
  const { spec } = job;
  const rules = new Map(RULES.map((rule) =>
    [rule.name, fieldsOf("spec.rule", rule.name === spec.rule.name ? asItWas(rule.fields, spec.rule) : rule.fields)]));
  const view = fieldsOf("spec.view", asItWas(VIEW, spec.view));
  const step = fieldsOf("spec", asItWas(STEP, spec));
  const choice = h("select", { id: "rejudge-rule", "aria-describedby": "rejudge-help", onchange: turn },
    RULES.map(({ name, title: text }) => h("option", { value: name, selected: name === spec.rule.name }, text)));
  const help = h("p", { class: "help", id: "rejudge-help" });
  const ofRule = h("div", { class: "fields small" });
  const watched = watchable().map(({ name, title: text }) => {
    const box = h("input", { type: "checkbox", checked: spec.watch.some((one) => one.name === name) });
    return { name, box, label: h("label", { class: "toggle" }, box, text) };
  });
  const wanted = new OneJob();
  const wrong = h("p", { class: "bad", role: "alert" });
  const start = h("button", { type: "submit", class: "primary" }, "Judge it");
  const dialog = h("dialog", { class: "ask wide", "aria-labelledby": "rejudge-title", onclose: () => dialog.remove() },
    h("form", { onsubmit: submit },
      h("h2", { id: "rejudge-title" }, `Judge ${title(job)} again`),
      h("p", {}, `A new job looks at the slices that this one kept, up to ${whole(job.committed_spp)} spp, and says where it would have stopped. Nothing is rendered; this one stays as it is.`),
      h("div", { class: "field" }, h("label", { for: choice.id }, "The rule that ends it"), choice, help), ofRule,
      h("fieldset", { class: "watch" }, h("legend", {}, "Rules to watch beside it"), watched.map(({ label }) => label)),
      h("div", { class: "fields small" }, view.elements, step.elements), wrong,
      h("div", { class: "answers" },
        h("button", { type: "button", onclick: () => dialog.close() }, "Leave it"), start)));

  function turn() {
    const { name, help: text } = ruleNamed(choice.value);
    setText(help, text);
    ofRule.replaceChildren(...rules.get(name).elements);
    for (const one of watched) one.box.disabled = one.name === name;
  }

  function changes() {
    const before = new Map(spec.watch.map((rule) => [rule.name, rule]));
    return {
      rule: { name: choice.value, ...rules.get(choice.value).values() },
      watch: watched.filter(({ name, box }) => box.checked && name !== choice.value).map(({ name }) => before.get(name) ?? { name }),
      view: view.values(), ...step.values(),
    };
  }

  async function submit(event) {
    event.preventDefault();
    start.disabled = true;
    setText(wrong, "");
    try {
      const next = await wanted.make((headers) => send("POST", job.links.rejudge, changes(), headers));
      dialog.close();
      go(`/jobs/${next.id}`);
    } catch (error) {
      setText(wrong, error.message);
      const named = new Map((error.details?.errors ?? []).map(({ field, message }) => [field, message]));
      const fields = [...rules.get(choice.value).fields, ...view.fields, ...step.fields];
      for (const field of fields) field.blame(named.get(field.path) ?? "");
      fields.find(({ path }) => named.has(path))?.input.focus();
      start.disabled = false;
    }
  }

  turn();
  document.body.append(dialog);
  dialog.showModal();
}

/** Fields with the values that a job had. */
function asItWas(abouts, had) {
  return abouts.map((about) => ({ ...about, value: had[about.name] ?? about.value }));
}
