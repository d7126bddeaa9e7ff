// The flicker guard of a batch: whether its frames stop at the same noise, in words, and switching it on.

import { get, send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { percent, several, whole } from "../shared/figures.js";
import { say } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";

/** What the fields are called that decide how much noise is left; others by their own names. */
const NAMES = {
  "rule.name": "rule", "rule.target": "target", "rule.min_spp": "rule's least spp", min_spp: "least spp", step: "step",
  "view.exposure_ev": "exposure", "view.white_luminance": "display white", "view.field_of_view_deg": "field of view",
};
/** Fields whose values are shares of an image's pixels. */
const SHARES = new Set(["rule.target"]);

/** Says in a dialog what the guard of a batch says; `nameOf(id)` is what its jobs are called. */
export async function showGuard(batch, nameOf) {
  const path = `/v1/batches/${encodeURIComponent(batch)}`;
  const words = h("div", { class: "guard" }, h("p", {}, "Looking …"));
  const wrong = h("p", { class: "bad", role: "alert" });
  const close = h("button", { type: "button", autofocus: true, onclick: () => dialog.close() }, "Close");
  const guard = h("button", { type: "submit", class: "primary", hidden: true }, "Guard it");
  const dialog = h("dialog", { class: "ask", "aria-labelledby": "guard-title", onclose: () => dialog.remove() },
    h("form", { onsubmit: switchOn },
      h("h2", { id: "guard-title" }, `Will ${batch} flicker?`), words, wrong,
      h("div", { class: "answers" }, close, guard)));
  const show = ({ guard: found }) => {
    words.replaceChildren(...told(found, nameOf));
    guard.hidden = found.guarded || !maySubmit() || found.differs.some(({ field }) => field !== "film");
  };

  async function switchOn(event) {
    event.preventDefault();
    guard.disabled = true;
    setText(wrong, "");
    try {
      show(await send("POST", `${path}/guard`));
      say(`${batch} is guarded`);
      close.focus();
    } catch (error) {
      setText(wrong, error.message);
    }
    guard.disabled = false;
  }

  document.body.append(dialog);
  dialog.showModal();
  try {
    show(await get(path));
  } catch (error) {
    words.replaceChildren();
    setText(wrong, error.message);
  }
}

function told(guard, nameOf) {
  const link = (id) => h("a", { href: `/jobs/${id}`, onclick: (event) => event.target.closest("dialog").close() }, nameOf(id));
  const list = (items) => h("ul", {}, items.map((item) => h("li", {}, ...item)));
  const named = guard.missed.flatMap((id, at) => (at ? [", ", link(id)] : [link(id)]));
  return [
    h("p", {}, "Frames that stop with different amounts of noise flicker. ", guard.guarded
      ? "This batch is guarded: it takes only jobs that stop as its others do."
      : "This batch is not guarded: a job that joins it may stop with another amount of noise."),
    guard.even
      ? h("p", {}, `All its jobs stop alike: ${alike(guard)}.`)
      : h("p", { class: "bad" }, `Not all of its jobs stop alike. Most do so ${alike(guard)}, but`),
    !guard.even && list(guard.differs.map(({ job, field, value, others }) =>
      [link(job), `: its ${NAMES[field] ?? field} is ${shown(field, value)}, most have ${shown(field, others)}`])),
    guard.missed_jobs > 0 && h("p", { class: "bad" },
      `${several(guard.missed_jobs, "job")} ended short of what the rule asks: `, ...named,
      ". Render them again with a higher cap."),
    guard.estimate_fraction && h("p", {}, `Those that converged did so at ${range(guard.spp, whole)} spp, and have ${range(guard.estimate_fraction, percent)} of their pixels left to see.`),
    guard.jump && h("p", {}, "The largest change between neighbours: from ",
      link(guard.jump.jobs[0]), ` with ${percent(guard.jump.estimate_fraction[0])} to `,
      link(guard.jump.jobs[1]), ` with ${percent(guard.jump.estimate_fraction[1])}.`),
    h("p", { class: "help" }, "The guard evens out noise, and judges each frame as a still. It does nothing about fireflies and shimmering textures."),
  ].filter(Boolean);
}

function alike({ rule, target, min_spp: least }) {
  const at = target == null ? "" : ` at ${percent(target)}`;
  return `by the rule ${rule}${at}${least ? `, not before ${whole(least)} spp` : ""}`;
}

function shown(field, value) {
  if (value == null) return "none";
  return SHARES.has(field) ? percent(value) : String(value);
}

function range({ least, most }, words) {
  return least === most ? words(least) : `${words(least)} to ${words(most)}`;
}
