// The list of living workers: what each does, and its troubles.

import { get, isProblem, send } from "../shared/api.js";
import { confirmed } from "../shared/dialogs.js";
import { h, KeyedList, setAttribute, setText } from "../shared/dom.js";
import { ago, bytes, percent, several, three, whole } from "../shared/figures.js";
import { attempt } from "../shared/notices.js";
import { maySteerWorkers } from "../shared/permissions.js";
import { repeat } from "../shared/polling.js";

const EVERY_MS = 2000;

/** @import { Screen } from "../main.js" */

/** @type {Screen} */
export function open(main, { signal }) {
  document.title = "Workers · Plateau";
  const summary = h("p", { class: "summary" });
  const list = h("ul", { "aria-label": "Workers" });
  const nothing = h("div", { class: "nothing", hidden: true },
    h("p", { class: "lead" }, "There are no workers."),
    h("p", {}, "Start a worker on any machine that reaches Redis and the blob store: ", h("code", {}, "plateau worker")));
  main.append(h("div", { class: "head" }, h("div", {}, h("h1", {}, "Workers"), summary)), list, nothing);
  /** The names of jobs by their ids, once they are known. @type {Map<string, string>} */
  const names = new Map();
  const rows = new KeyedList(list, (/** @type {Api.Worker} */ worker) => new WorkerRow(worker, names, () => refresh().catch(() => {})));  // the next look tries again

  let asked = 0;
  async function refresh() {
    const number = asked += 1;
    /** @type {Api.Workers} */
    const { workers } = await get("/v1/workers", signal);
    const named = workers.flatMap(({ job, left_out_of: left }) => [...(job ? [job] : []), ...left]);
    const unknown = new Set(named.filter((id) => !names.has(id)));
    await Promise.all([...unknown].map((id) => get(`/v1/jobs/${id}`, signal).then(({ name }) => names.set(id, name),
      (error) => isProblem(error, "unknown-job") && names.set(id, id))));
    if (number !== asked) return; // a later question has the newer answer
    workers.sort((a, b) => a.id.localeCompare(b.id));
    rows.show(workers, ({ id }) => id);
    const busy = workers.filter(({ job }) => job).length;
    const rate = workers.reduce((sum, worker) => sum + (worker.job ? worker.samples_per_s ?? 0 : 0), 0);
    setText(summary, workers.length
      ? [several(workers.length, "worker"), `${busy} rendering`, rate ? `${three(rate / 1e6)} million samples a second` : ""].filter(Boolean).join(" · ")
      : "");
    nothing.hidden = workers.length > 0;
  }
  repeat(refresh, () => EVERY_MS, signal);
}

class WorkerRow {
  #name = h("h2");
  #where = h("p", { class: "summary" });
  #job = h("a");
  #rest = h("span");
  #does = h("p", { class: "does" });
  #rate = h("p", { class: "figure" });
  #done = h("p", { class: "figure" });
  #machine = h("p", { class: "summary machine" });
  #trouble = h("p", { class: "bad" });
  #leftOut = h("p", { class: "summary left-out" });
  #drain = h("button");
  #worker;
  #names;
  element = h("li", { class: "worker" },
    h("div", {}, this.#name, this.#where), this.#does, this.#rate, this.#done, this.#drain, this.#trouble, this.#machine, this.#leftOut);

  /**
   * @param {Api.Worker} worker
   * @param {Map<string, string>} names - of jobs
   * @param {() => Promise<void>} refresh
   */
  constructor(worker, names, refresh) {
    this.#worker = worker;
    this.#names = names;
    this.#drain.addEventListener("click", async () => {
      const { id, drained } = this.#worker;
      const tell = (/** @type {string} */ what, /** @type {string} */ done) => attempt(() => send("POST", `/v1/workers/${encodeURIComponent(id)}/${what}`), done, refresh);
      if (drained) await tell("resume", `${id} is resumed`);
      else if (await confirmed(`Drain ${id}?`,
        "It finishes its slice and takes no more, so that it can be stopped without a loss.", "Drain it", "Keep it working")) {
        await tell("drain", `${id} takes no more work`);
      }
    });
  }

  /** @param {Api.Worker} worker */
  update(worker) {
    this.#worker = worker;
    this.#drain.hidden = !maySteerWorkers();
    setText(this.#drain, worker.drained ? "Resume" : "Drain");
    setAttribute(this.#drain, "aria-label", `${worker.drained ? "Resume" : "Drain"} ${worker.id}`);
    const { id, host, pid, variants, threads, pool, tags, plateau, job, slice, samples_per_s: rate, last_error: error, trouble } = worker;
    setAttribute(this.element, "data-worker", id);
    setText(this.#name, id);
    setText(this.#where, [
      `${host}, process ${pid}`, variants[0], several(threads, "thread"), pool !== "default" && `pool ${pool}`,
      tags.length > 0 && `tags ${tags.join(", ")}`, plateau && `Plateau ${plateau}`, `started ${ago(worker.started_at)}`,
    ].filter(Boolean).join(" · "));
    setAttribute(this.#does, "data-busy", String(Boolean(job)));
    if (job) {
      setAttribute(this.#job, "href", `/jobs/${job}`);
      setText(this.#job, this.#names.get(job) ?? job);
      const text = [slice == null ? "" : `, slice ${slice}`, worker.drained ? ", its last" : ""].join("");
      if (this.#does.firstChild !== this.#job) this.#does.replaceChildren(this.#job, this.#rest);
      setText(this.#rest, text);
    } else {
      setText(this.#does, worker.drained ? "drained: it may be stopped" : trouble ? "takes no work" : "idle");
    }
    show(this.#rate, rate ? `${three(rate / 1e6)} M` : "–", "samples a second");
    show(this.#done, whole(worker.slices_done), "slices done");
    setText(this.#trouble, trouble ?? (error ? `Last error: ${error}` : ""));
    this.#trouble.hidden = !(trouble || error);
    setText(this.#machine, used(worker));
    this.#machine.hidden = !this.#machine.textContent;
    this.#showLeftOut(worker);
  }

  /** @param {Api.Worker} worker */
  #showLeftOut(worker) {
    const { left_out_of: left } = worker;
    this.#leftOut.hidden = !left.length;
    if (this.#leftOut.dataset.shown === left.join()) return;
    this.#leftOut.dataset.shown = left.join();
    this.#leftOut.replaceChildren("Left out for a while of ", ...left.flatMap((one, at) => [at ? ", " : "", h("a", { href: `/jobs/${one}` }, this.#names.get(one) ?? one)]));
  }

}

/**
 * What its machine does, and what it has rendered.
 * @param {Api.Worker} worker
 */
function used({ machine, core_hours: hours }) {
  const free = machine?.disk_free_bytes;
  return [
    machine && `${percent(machine.load)} of ${several(machine.cores, "core")} in use`,
    machine && `${bytes(machine.memory_used_bytes)} of ${bytes(machine.memory_bytes)} memory`,
    free != null && `${bytes(free)} of disk left`,
    machine?.temperature_c != null && `${whole(machine.temperature_c)} °C`,
    hours && `${three(hours)} core hours rendered`,
  ].filter(Boolean).join(" · ");
}

/**
 * @param {Element} place
 * @param {string} figure
 * @param {string} name
 */
function show(place, figure, name) {
  if (!place.firstChild) place.append(h("strong"), h("span"));
  setText(place.children[0], figure);
  setText(place.children[1], name);
}
