// The dialog of a batch's flicker guard: it says whether the frames stop at the same noise, and guards them.

import { get, send } from "../shared/api.js";
import { openDialog } from "../shared/dialogs.js";
import { h, setText } from "../shared/dom.js";
import { percent, several, whole } from "../shared/figures.js";
import { messageOf, say } from "../shared/notices.js";
import { maySubmit } from "../shared/permissions.js";

/**
 * Names of the fields that determine how much noise is left.
 * @type {Record<string, string>}
 */
const NAMES = {
  "rule.name": "rule", "rule.target": "target", "rule.min_spp": "rule's least spp", min_spp: "least spp", step: "step",
  "view.exposure_ev": "exposure", "view.white_luminance": "display white", "view.contrast": "contrast",
  "view.ambient_lux": "light on the display", "view.field_of_view_deg": "field of view", "view.pixels_per_degree": "pixels per degree",
  "view.background": "background", "view.focus": "focus",
};
/** Fields whose values are shares of an image's pixels. */
const SHARES = new Set(["rule.target"]);

/**
 * Opens the dialog.
 * @param {string} batch
 * @param {(id: string) => string} nameOf - the name of a job
 */
export async function showGuard(batch, nameOf) {
  const path = `/v1/batches/${encodeURIComponent(batch)}`;
  const words = h("div", { class: "guard" }, h("p", {}, "Looking …"));
  const wrong = h("p", { class: "bad", role: "alert" });
  const close = h("button", { type: "button", autofocus: true, onclick: () => { dialog.close(); } }, "Close");
  const guard = h("button", { type: "submit", class: "primary", hidden: true }, "Guard it");
  const dialog = openDialog(`Will ${batch} flicker?`, { onsubmit: switchOn }, words, wrong,
    h("div", { class: "answers" }, close, guard));
  const show = (/** @type {Api.BatchView} */ { guard: found }) => {
    words.replaceChildren(...told(found, nameOf, () => dialog.close()));
    guard.hidden = found.guarded || !maySubmit() || found.differs.some(({ field }) => field !== "film");
  };

  /** @param {SubmitEvent} event */
  async function switchOn(event) {
    event.preventDefault();
    guard.disabled = true;
    setText(wrong, "");
    try {
      show(await send("POST", `${path}/guard`));
      say(`${batch} is guarded`);
      close.focus();
    } catch (error) {
      setText(wrong, messageOf(error));
    }
    guard.disabled = false;
  }

  try {
    show(await get(path));
  } catch (error) {
    words.replaceChildren();
    setText(wrong, messageOf(error));
  }
}

/**
 * @param {Api.Guard} guard
 * @param {(id: string) => string} nameOf
 * @param {() => void} close
 */
function told(guard, nameOf, close) {
  const link = (/** @type {string} */ id) => h("a", { href: `/jobs/${id}`, onclick: close }, nameOf(id));
  const named = guard.missed.flatMap((id, at) => (at ? [", ", link(id)] : [link(id)]));
  return [
    h("p", {}, "Frames that stop with different amounts of noise flicker. ", guard.guarded
      ? "This batch is guarded: it takes only jobs that stop as its others do."
      : "This batch is not guarded: a job that joins it may stop with another amount of noise."),
    guard.even
      ? h("p", {}, `All its jobs stop alike: ${alike(guard)}.`)
      : h("p", { class: "bad" }, `Not all of its jobs stop alike. Most do so ${alike(guard)}, but`),
    !guard.even && h("ul", {}, guard.differs.map(({ job, field, value, others }) =>
      h("li", {}, link(job), `: its ${NAMES[field] ?? field} is ${shown(field, value)}, most have ${shown(field, others)}`))),
    guard.missed_jobs > 0 && h("p", { class: "bad" },
      `${several(guard.missed_jobs, "job")} ended short of what the rule asks: `, ...named,
      ". Render them again with a higher cap."),
    guard.spp && guard.estimate_fraction && h("p", {}, `Those that converged did so at ${range(guard.spp, whole)} spp, with noise left in ${range(guard.estimate_fraction, percent)} of their pixels.`),
    guard.jump && h("p", {}, "The largest change between neighbours: from ",
      link(guard.jump.jobs[0]), ` with ${percent(guard.jump.estimate_fraction[0])} to `,
      link(guard.jump.jobs[1]), ` with ${percent(guard.jump.estimate_fraction[1])}.`),
    h("p", { class: "help" }, "The guard evens out noise, and judges each frame as a still. It does nothing about fireflies and shimmering textures."),
  ].filter((one) => one != null && one !== false);
}

/** @param {Api.Guard} guard */
function alike({ rule, target, min_spp: least }) {
  const at = target == null ? "" : ` at ${percent(target)}`;
  return `by the rule ${rule}${at}${least ? `, not before ${whole(least)} spp` : ""}`;
}

/**
 * @param {string} field
 * @param {unknown} value
 */
function shown(field, value) {
  if (value == null) return "none";
  // The target of the rule jod is no share, and never below 1.
  return SHARES.has(field) && Number(value) < 1 ? percent(Number(value)) : String(value);
}

/**
 * @param {Api.Extent} extent
 * @param {(value: number) => string} words
 */
function range({ least, most }, words) {
  return least === most ? words(least) : `${words(least)} to ${words(most)}`;
}
