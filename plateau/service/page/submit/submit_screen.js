// Submitting a scene: upload it, see what the check found, and choose when to stop.

import { get, isAbort, isProblem, Problem, send, upload } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { bytes, sentence, several, share } from "../shared/figures.js";
import { blame, Field, valuesOf } from "../shared/form_fields.js";
import { OneJob } from "../shared/job_request.js";
import { messageOf, say } from "../shared/notices.js";
import { AGAIN } from "../shared/job_summary.js";
import { maySubmit, metMe } from "../shared/permissions.js";
import { meetRules } from "../shared/rules.js";
import { offer } from "../shared/spec_fields.js";
import { Frames } from "./frames.js";
import { SpecForm } from "./spec_form.js";

/** @import { ScreenContext } from "../main.js" */

const ANY_SCENE = "A scene, or a zip of one with its meshes and textures.";

/**
 * @param {HTMLElement} main
 * @param {ScreenContext} context
 */
export async function open(main, { signal, go }) {
  document.title = "Submit a scene · Plateau";
  const waiting = h("div", { class: "submit" }, h("h1", {}, "Submit a scene"));
  main.append(waiting);
  const scenes = get("/v1/scenes", signal).catch(() => ({ scenes: [], roots: [], formats: {} }));
  try {
    await Promise.all([meetRules(signal), metMe]);
    if (!maySubmit()) {
      waiting.append(h("p", { class: "lead" }, "This key may look at jobs, and submit none."), h("a", { class: "button", href: "/" }, "Show the jobs"));
      return;
    }
    await get("/v1/targets", signal).then(offer, () => {});
    const id = new URLSearchParams(location.search).get(AGAIN);
    const job = id ? await get(`/v1/jobs/${encodeURIComponent(id)}`, signal) : null;
    waiting.replaceWith(new Submission(signal, go, scenes, job).element);
  } catch (error) {
    if (signal.aborted) return;
    waiting.append(h("p", { class: "bad", role: "alert" }, messageOf(error)),
      h("a", { class: "button", href: isProblem(error, "unknown-job") ? "/submit" : location.href }, "Submit a scene"));
  }
}

class Submission {
  #signal;
  #go;
  /** @type {File | null} */
  #file = null;
  /** The name of a scene in a scene root. */
  #path = "";
  /** The SHA-256 of the scene, once the API has stored it. */
  #sha256 = "";
  /** @type {AbortController | null} */
  #sending = null;
  #wanted = new OneJob();
  /** The job that is rendered again, and its spec as the form had it. @type {{ job: Api.JobView, had: object } | null} */
  #again = null;
  /** @type {Field[]} */
  #parameters = [];
  /** The values of parameters that a job had, for the fields of its scene. @type {Api.JobSpec["parameters"]} */
  #given = {};
  #title = h("h1", {}, "Submit a scene");
  #hint = h("p", { class: "lead", hidden: true });
  #frames = new Frames();
  #spec = new SpecForm();

  #picker = h("input", { type: "file", id: "scene-file", class: "unseen",
    onchange: () => { this.#bring(this.#picker.files); this.#picker.value = ""; } }); // reset, so that the same file can be chosen again
  #stored = h("select", { class: "stored", "aria-label": "A stored scene", hidden: true, onchange: () => { this.#takeStored(); } }, h("option", { value: "" }, "or take one that is stored…"));
  #placed = h("input", { class: "placed", "aria-label": "A scene in a scene root", hidden: true, maxlength: 4096, spellcheck: false, autocomplete: "off",
    onchange: () => { this.#takePlaced(); },
    onkeydown: (event) => { if (event.key === "Enter") { event.preventDefault(); this.#placed.blur(); } } });
  #progress = h("progress", { max: 1, value: 0, "aria-label": "Upload", hidden: true });
  #said = h("p", { class: "drop-said" }, ANY_SCENE);
  #wrong = h("p", { class: "bad wrong", role: "alert", tabindex: -1, hidden: true });
  #summary = h("dl", { class: "found" });
  #parameterBox = h("fieldset", { hidden: true });
  #rest;
  #button = h("button", { class: "primary large", type: "submit" }, "Render it");

  /**
   * @param {AbortSignal} signal
   * @param {(path: string) => void} go
   * @param {Promise<Api.Scenes>} scenes - those that are stored
   * @param {Api.JobView | null} again - the job whose scene and spec are filled in
   */
  constructor(signal, go, scenes, again) {
    this.#signal = signal;
    this.#go = go;
    const drop = h("label", {
      class: "drop", for: "scene-file",
      ondragover: (event) => { event.preventDefault(); drop.classList.add("over"); },
      ondragleave: () => { drop.classList.remove("over"); },
      ondrop: (event) => {
        event.preventDefault();
        drop.classList.remove("over");
        this.#bring(event.dataTransfer?.files);
      },
    }, h("span", { class: "drop-call" }, "Drop a scene here, or ", h("u", {}, "choose a file")), this.#said, this.#progress);
    this.#rest = h("div", { class: "rest", hidden: true },
      this.#parameterBox, this.#frames.element,
      ...this.#spec.elements,
      h("p", { class: "send" }, this.#button, h("span", { class: "hint" }, "The job can be cancelled at any time; it keeps the image rendered by then.")));
    this.#rest.addEventListener("change", ({ target }) => {
      if (target instanceof HTMLInputElement && target.name === "spec.sensor") this.#check();  // another camera has its own size
    });
    this.element = h("form", { class: "submit", novalidate: true, onsubmit: (event) => { event.preventDefault(); this.#submit(); } },
      this.#title, this.#hint, this.#picker, drop, this.#placed, this.#stored, this.#wrong, this.#summary, this.#rest);
    this.#listStored(scenes);
    if (again) this.#fill(again);
  }

  /**
   * Takes the scene and the spec of a job, to be changed.
   * @param {Api.JobView} job
   */
  #fill(job) {
    const { scene_sha256: sha256, spec } = job;
    const { notice, shot } = spec;
    setText(this.#title, `Render ${job.name} again`);
    this.#spec.fill(spec);
    this.#given = spec.parameters;
    this.#again = { job, had: { ...this.#spec.values(), parameters: spec.parameters, notice: {} } };
    setText(this.#hint, ["A new job renders the same scene, as you ask for it below. It keeps the samples that there are, where your changes allow it; another seed draws others.",
      notice.url ? "The URL of the job's notice is left out: add it, if it is to hear of the new job." : "",
      shot ? "The new job is no frame of the shot." : ""].filter(Boolean).join(" "));
    this.#hint.hidden = false;
    this.#take({ sha256 });
  }

  // The scene.

  /** @param {Promise<Api.Scenes>} stored */
  async #listStored(stored) {
    const { scenes, roots, formats } = await stored;
    const suffixes = Object.keys(formats ?? {});
    if (suffixes.length) this.#picker.accept = [".zip", ...suffixes].join();
    if (suffixes.length && this.#said.textContent === ANY_SCENE) {
      setText(this.#said, sentence(`${Object.values(formats ?? {}).join(", ")}, or a zip of one with its meshes and textures`));
    }
    this.#placed.hidden = !roots?.length;
    this.#placed.placeholder = `or name one where it lies, as {${roots?.[0]}}/shots/walk/scene.xml`;
    this.#stored.hidden = !scenes.length;
    for (const { sha256, name, bytes: size } of scenes) {
      this.#stored.append(h("option", { value: sha256 }, `${name} (${bytes(size)}, ${sha256.slice(0, 6)})`));
    }
  }

  #takeStored() {
    if (!this.#stored.value) return;
    this.#given = {};
    this.#placed.value = "";
    this.#take({ sha256: this.#stored.value });
  }

  #takePlaced() {
    if (!this.#placed.value.trim()) return;
    this.#stored.value = "";
    this.#take({ path: this.#placed.value.trim() });
  }

  /** @param {FileList | null | undefined} files */
  #bring(files) {
    if (!files?.length) return;
    this.#stored.value = this.#placed.value = "";
    this.#take({ file: files[0] });
  }

  /** @param {{ file?: File, path?: string, sha256?: string }} scene */
  #take({ file, path = "", sha256 = "" }) {
    if (sha256 !== this.#again?.job.scene_sha256) {
      this.#again = null;
      this.#hint.hidden = true;
      setText(this.#title, "Submit a scene");
    }
    this.#file = file ?? null;
    this.#path = path;
    this.#sha256 = sha256;
    this.#parameters = [];
    this.#summary.replaceChildren();
    this.#check();
  }

  /** Has the API check the scene with the current parameters; uploads the file if necessary. */
  async #check() {
    this.#sending?.abort();
    const sending = (this.#sending = new AbortController());
    this.#blame(null);
    const name = this.#file?.name ?? (this.#path || "the stored scene");
    setText(this.#said, `Checking ${name} …`);
    const parameters = { ...this.#given, ...valuesOf(this.#parameters) };
    const form = this.#form({ parameters, sensor: this.#spec.sensor });
    this.#progress.hidden = !form.has("scene");
    try {
      this.#showFound(await upload("/v1/scenes", form, {
        signal: AbortSignal.any([this.#signal, sending.signal]),
        onProgress: (done, all) => {
          this.#progress.value = done / all;
          setText(this.#said, done < all ? `Sending ${name}: ${share(done / all)} of ${bytes(all)}` : `Checking ${name} …`);
        },
      }));
    } catch (error) {
      if (isAbort(error)) return;
      // A sweep may have removed the scene while this page was open.
      if (isProblem(error, "unknown-scene") && this.#file) { this.#sha256 = ""; await this.#check(); return; }
      this.#showRefused(error);
    } finally {
      if (this.#sending === sending) this.#progress.hidden = true;
    }
  }

  /** @param {object} spec */
  #form(spec) {
    const form = new FormData();
    // By its name each time: other parameters may choose other files.
    if (this.#path) form.set("scene_path", this.#path);
    else if (this.#sha256) form.set("scene_sha256", this.#sha256);
    else if (this.#file) form.set("scene", this.#file);
    form.set("spec", new Blob([JSON.stringify(spec)], { type: "application/json" }));
    return form;
  }

  /** @param {Api.SceneFound} found */
  #showFound(found) {
    this.#sha256 = found.sha256;
    setText(this.#said, "Another one? Drop it here.");
    const rows = [
      ["Scene", found.name],
      ["Image", found.width ? `${found.width} × ${found.height} pixels` : ""],
      ["Holds", found.kind === "zip" ? `${several(found.files, "file")}, ${bytes(found.bytes_unpacked ?? 0)} unpacked; the scene is ${found.entry}` : bytes(found.bytes)],
      ["Cameras", found.sensors > 1 ? String(found.sensors) : ""],
    ];
    this.#summary.replaceChildren(...rows.filter(([, text]) => text).map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text))));
    const fresh = Object.keys({ ...this.#given, ...found.parameters }).filter((name) => !this.#parameters.some((one) => one.name === name));
    if (fresh.length || !this.#parameters.length) {
      for (const name of fresh) this.#addParameter(name, found.parameters[name] ?? "");
      this.#given = {};
      this.#showParameters("The scene's parameters with their defaults, which your values replace.");
    }
    this.#rest.hidden = false;
    say(`${found.name} is checked${found.width ? `: ${found.width} by ${found.height} pixels` : ""}.`);
  }

  /**
   * @param {string} name
   * @param {string} placeholder
   */
  #addParameter(name, placeholder) {
    const field = new Field("spec.parameters", { name, label: name, type: "text", optional: true, value: String(this.#given[name] ?? ""), placeholder, maxlength: 200 });
    field.input.addEventListener("change", () => this.#check());
    this.#parameters.push(field);
  }

  /** @param {string} help */
  #showParameters(help) {
    this.#frames.offer(this.#parameters.map(({ name }) => name));
    this.#parameterBox.hidden = !this.#parameters.length;
    this.#parameterBox.replaceChildren(h("legend", {}, "Its parameters"), h("p", { class: "help" }, help),
      h("div", { class: "fields small" }, this.#parameters.map(({ element }) => element)));
  }

  /**
   * Shows why the scene was refused, and a field for a parameter if its value is missing.
   * @param {unknown} error
   */
  #showRefused(error) {
    setText(this.#said, "Drop another one here, or choose a file.");
    this.#blame(error);
    const undefinedOne = error instanceof Problem && error.details.code === "undefined-parameter";
    const name = undefinedOne ? /\$(\w+)/.exec(error.message)?.[1] : "";
    if (!name || this.#parameters.some((field) => field.name === name)) return;
    this.#addParameter(name, "");
    this.#showParameters("");
    this.#rest.hidden = false;
  }

  // What is asked of it.

  async #submit() {
    if (!this.#sha256) { (this.#wrong.hidden ? this.#picker : this.#wrong).focus(); return; }
    if (this.#button.disabled) return;
    const shown = this.#fields().filter(({ input }) => input.offsetParent);
    if (!shown.every(({ input }) => input.reportValidity())) return;
    if (this.#frames.isUnclear) { this.#frames.element.open = true; this.#frames.element.querySelector("input")?.focus(); return; }
    this.#blame(null);
    this.#button.disabled = true;
    try {
      const spec = { ...this.#spec.values(), parameters: this.#frames.of(valuesOf(this.#parameters)) };
      const again = Array.isArray(spec.parameters) ? null : this.#again;
      const made = await this.#wanted.make((headers) => again
        ? send("POST", again.job.links.again, patchOf(again.had, spec), headers)
        : upload("/v1/jobs", this.#form(spec), { signal: this.#signal, headers }));
      if (!this.#signal.aborted) this.#go("id" in made ? `/jobs/${made.id}` : `/?batch=${encodeURIComponent(made.name)}`);
    } catch (error) {
      if (isAbort(error)) return;
      this.#blame(error);
    } finally {
      this.#button.disabled = false;
    }
  }

  #fields() {
    return [...this.#spec.fields, ...this.#parameters];
  }

  /**
   * Shows an error at the fields that it names, and moves the focus there.
   * @param {unknown} error - null removes it
   */
  #blame(error) {
    const blamed = blame(this.#fields(), error);
    this.#wrong.hidden = !error;
    setText(this.#wrong, error ? messageOf(error) : "");
    if (!error) return;
    const place = blamed[0]?.input ?? this.#wrong;
    place.closest("details")?.setAttribute("open", "");
    place.focus();
  }
}

/**
 * The JSON merge patch that makes one object of another; one with a name is replaced whole.
 * @param {Record<string, any>} had
 * @param {Record<string, any>} wanted
 */
function patchOf(had, wanted) {
  /** @type {Record<string, any>} */
  const patch = {};
  for (const name of new Set([...Object.keys(had), ...Object.keys(wanted)])) {
    const [from, to] = [had[name] ?? null, wanted[name] ?? null];
    const isMerged = isObject(from) && isObject(to) && !("name" in to);
    // A parameter of the scene may be a number, and its field has it as text.
    if (JSON.stringify(from) === JSON.stringify(to) || (typeof to === "string" && String(from) === to)) continue;
    patch[name] = isMerged ? patchOf(from, to) : to;
  }
  return patch;
}

/** @param {unknown} value */
function isObject(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
