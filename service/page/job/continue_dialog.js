// Going on with a job that has ended: to a stricter rule or a higher cap, as a new job.

import { send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { whole } from "../shared/figures.js";
import { fieldsOf } from "../shared/form_fields.js";
import { OneJob } from "../shared/job_request.js";
import { ENDED, title } from "../shared/job_summary.js";
import { maySubmit } from "../shared/permissions.js";
import { fieldIn } from "../shared/rules.js";
import { LIMITS } from "../shared/spec_fields.js";

/** A button that asks how far; null where there is nothing to go on with. */
export function goOnButton(job, go) {
  if (!ENDED.has(job.state) || !job.finished_at || !job.spp || job.state === "failed" || !maySubmit()) return null;
  return h("button", { onclick: () => ask(job, go) }, "Go on…");
}

function ask(job, go) {
  const { rule, max_spp: cap } = job.spec;
  const most = LIMITS.find(({ name }) => name === "max_spp");
  const limits = fieldsOf("spec", [{
    ...most, value: Math.min(most.max, Math.max(cap, 2 * job.spp)), min: Math.min(most.max, job.spp + 1),
    help: `It has ${whole(job.spp)} by now, and keeps them all.`,
  }]);
  const asked = fieldIn("noise_target", rule);
  const stricter = fieldsOf("spec.rule", !asked ? [] : [{
    ...asked, help: "The smaller, the stricter.",
    value: Number(Math.max(asked.min, rule[asked.name] / (job.state === "converged" ? 2 : 1)).toPrecision(3)),
  }]);
  const wanted = new OneJob();
  const wrong = h("p", { class: "bad", role: "alert" });
  const start = h("button", { type: "submit", class: "primary" }, "Go on");
  const dialog = h("dialog", { class: "ask", "aria-labelledby": "go-on", onclose: () => dialog.remove() },
    h("form", { onsubmit: submit },
      h("h2", { id: "go-on" }, `Go on with ${title(job)}`),
      h("p", {}, "A new job takes over its samples; this one stays as it is."),
      ...limits.elements, ...stricter.elements, wrong,
      h("div", { class: "answers" },
        h("button", { type: "button", onclick: () => dialog.close() }, "Leave it"), start)));
  async function submit(event) {
    event.preventDefault();
    start.disabled = true;
    try {
      const changes = { ...limits.values(), ...(asked ? { rule: stricter.values() } : {}) };
      const next = await wanted.make((headers) => send("POST", job.links.continue, changes, headers));
      dialog.close();
      go(`/jobs/${next.id}`);
    } catch (error) {
      setText(wrong, error.message);
      start.disabled = false;
    }
  }
  document.body.append(dialog);
  dialog.showModal();
}
