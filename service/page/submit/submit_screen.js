// Submit a scene: bring it, see what was found in it, say when to stop.

import { get, upload } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { bytes, several, share } from "../shared/figures.js";
import { Field, fieldsOf } from "../shared/form_fields.js";
import { OneJob } from "../shared/job_request.js";
import { say } from "../shared/notices.js";
import { fieldIn, RULES, watchable } from "../shared/rules.js";
import { LIMITS, MORE, VIEW } from "../shared/spec_fields.js";

export function open(main, { signal, go }) {
  document.title = "Submit a scene · Plateau";
  const screen = new Submission(signal, go);
  main.append(screen.element);
}

class Submission {
  #signal;
  #go;
  #file = null;
  #found = null;
  #sending = null;
  #wanted = new OneJob();
  #parameters = [];
  #chosen = RULES.find((rule) => rule.default).name;
  #rules = new Map(RULES.map((rule) => [rule.name, fieldsOf("spec.rule", rule.fields)]));
  #watched = new Map();
  #view = fieldsOf("spec.view", VIEW);
  #limits = fieldsOf("spec", LIMITS);
  #more = fieldsOf("spec", MORE);
  #keep = h("input", { type: "checkbox", id: "keep-slices" });
  #guard = h("input", { type: "checkbox", id: "flicker-guard" });

  #picker = h("input", { type: "file", accept: ".zip,.xml,application/zip,text/xml", id: "scene-file", class: "unseen",
    onchange: () => { this.#bring(this.#picker.files[0]); this.#picker.value = ""; } }); // so that the same may be brought again
  #drop;
  #stored = h("select", { class: "stored", "aria-label": "A stored scene", hidden: true, onchange: () => this.#takeStored() }, h("option", { value: "" }, "or take one that is stored…"));
  #progress = h("progress", { max: 1, value: 0, "aria-label": "Upload", hidden: true });
  #said = h("p", { class: "drop-said" }, "A Mitsuba XML, or a zip of one with its meshes and textures");
  #wrong = h("p", { class: "bad wrong", role: "alert", tabindex: -1, hidden: true });
  #summary = h("dl", { class: "found" });
  #parameterBox = h("fieldset", { hidden: true });
  #rest;
  #button = h("button", { class: "primary large", type: "submit" }, "Render it");
  element;

  constructor(signal, go) {
    this.#signal = signal;
    this.#go = go;
    this.#drop = h("label", {
      class: "drop", for: "scene-file",
      ondragover: (event) => { event.preventDefault(); this.#drop.classList.add("over"); },
      ondragleave: () => this.#drop.classList.remove("over"),
      ondrop: (event) => {
        event.preventDefault();
        this.#drop.classList.remove("over");
        this.#bring(event.dataTransfer.files[0]);
      },
    }, h("span", { class: "drop-call" }, "Drop a scene here, or ", h("u", {}, "choose a file")), this.#said, this.#progress);
    this.#rest = h("div", { class: "rest", hidden: true },
      this.#parameterBox,
      h("fieldset", {}, h("legend", {}, "When is it done?"),
        h("div", { class: "choices", role: "radiogroup", "aria-label": "The rule that ends it" }, RULES.filter((rule) => rule.featured).map((rule) => this.#choice(rule)),
          h("details", {}, h("summary", {}, "Other rules"), h("div", { class: "choices" }, RULES.filter((rule) => !rule.featured).map((rule) => this.#choice(rule)))))),
      h("fieldset", {}, h("legend", {}, "How is it looked at?"), h("div", { class: "fields" }, this.#view.elements)),
      h("fieldset", {}, h("legend", {}, "And no further than"), h("div", { class: "fields" }, this.#limits.elements)),
      h("details", {}, h("summary", {}, "More"),
        h("div", { class: "fields" }, this.#more.elements),
        h("p", { class: "check" }, this.#keep, h("label", { for: "keep-slices" },
          "Keep every slice, to compare any two points of the curve and to judge the job again (some MB each)")),
        h("p", { class: "check" }, this.#guard, h("label", { for: "flicker-guard" },
          "Guard it against flicker: only jobs that stop alike may join")),
        h("fieldset", { class: "watch" }, h("legend", {}, "Rules to watch beside it: they stop nothing, and mark the curve where they would have"),
          watchable().map((rule) => this.#watch(rule)))),
      h("p", { class: "send" }, this.#button, h("span", { class: "hint" }, "The job can be cancelled at any time; what is rendered by then is kept.")));
    this.element = h("form", { class: "submit", novalidate: true, onsubmit: (event) => { event.preventDefault(); this.#submit(); } },
      h("h1", {}, "Submit a scene"), this.#picker, this.#drop, this.#stored, this.#wrong, this.#summary, this.#rest);
    this.#listStored();
  }

  // The scene.

  async #listStored() {
    const { scenes } = await get("/v1/scenes", this.#signal).catch(() => ({ scenes: [] }));
    this.#stored.hidden = !scenes.length;
    for (const { sha256, name, bytes: size } of scenes) {
      this.#stored.append(h("option", { value: sha256 }, `${name} (${bytes(size)}, ${sha256.slice(0, 6)})`));
    }
  }

  #takeStored() {
    if (!this.#stored.value) return;
    this.#file = null;
    this.#parameters = [];
    this.#found = { sha256: this.#stored.value };
    this.#check();
  }

  #bring(file) {
    if (!file) return;
    this.#file = file;
    this.#found = null;
    this.#parameters = [];
    this.#stored.value = "";
    this.#check();
  }

  /** Has the API look at the scene with the parameters as they are; brings the file where it has to. */
  async #check() {
    this.#sending?.abort();
    const sending = (this.#sending = new AbortController());
    this.#signal.addEventListener("abort", () => sending.abort(), { once: true });
    this.#blame(null);
    const name = this.#file?.name ?? "the stored scene";
    setText(this.#said, `Checking ${name} …`);
    const form = this.#form({ parameters: this.#values(), sensor: this.#sensor() });
    this.#progress.hidden = !form.has("scene");
    try {
      this.#found = await upload("/v1/scenes", form, {
        signal: sending.signal,
        onProgress: (done, all) => {
          this.#progress.value = done / all;
          setText(this.#said, done < all ? `Sending ${name}: ${share(done / all)} of ${bytes(all)}` : `Checking ${name} …`);
        },
      });
      this.#showFound();
    } catch (error) {
      if (error.name === "AbortError") return;
      // It may have gone while this page lay open.
      if (error.slug === "unknown-scene" && this.#file) { this.#found = null; await this.#check(); return; }
      this.#showRefused(error);
    } finally {
      if (this.#sending === sending) this.#progress.hidden = true;
    }
  }

  #form(spec) {
    const form = new FormData();
    if (this.#found?.sha256) form.set("scene_sha256", this.#found.sha256);
    else form.set("scene", this.#file);
    form.set("spec", new Blob([JSON.stringify(spec)], { type: "application/json" }));
    return form;
  }

  #sensor() {
    return this.#more.values().sensor ?? 0;
  }

  #showFound() {
    const found = this.#found;
    setText(this.#said, "Another one? Drop it here.");
    const rows = [
      ["Scene", found.name],
      ["Image", `${found.width} × ${found.height} pixels`],
      ["Holds", found.kind === "zip" ? `${several(found.files, "file")}, ${bytes(found.bytes_unpacked)} unpacked; the scene is ${found.entry}` : bytes(found.bytes)],
      ["Cameras", found.sensors > 1 ? String(found.sensors) : ""],
    ];
    this.#summary.replaceChildren(...rows.filter(([, text]) => text).map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text))));
    if (!this.#parameters.length) this.#showParameters(found.parameters);
    this.#rest.hidden = false;
    say(`${found.name} is checked: ${found.width} by ${found.height} pixels.`);
  }

  #showParameters(defaults) {
    this.#parameters = Object.entries(defaults).map(([name, value]) =>
      [name, new Field(`spec.parameters.${name}`, { label: name, type: "text", optional: true, value: "", placeholder: value, maxlength: 200 })]);
    for (const [, field] of this.#parameters) field.input.addEventListener("change", () => this.#check());
    this.#parameterBox.hidden = !this.#parameters.length;
    this.#parameterBox.replaceChildren(h("legend", {}, "Its parameters"),
      h("p", { class: "help" }, "The scene's parameters with their defaults; what you write replaces them."),
      h("div", { class: "fields small" }, this.#parameters.map(([, field]) => field.element)));
  }

  /** The scene was refused: says why, and asks for a parameter's value where that is what is missing. */
  #showRefused(error) {
    setText(this.#said, "Drop another one here, or choose a file.");
    const missing = error.details?.code === "undefined-parameter" && /\$(\w+)/.exec(error.message);
    this.#blame(error);
    if (missing && !this.#parameters.some(([name]) => name === missing[1])) {
      const field = new Field(`spec.parameters.${missing[1]}`, { label: missing[1], type: "text", optional: true, value: "", maxlength: 200 });
      field.input.addEventListener("change", () => this.#check());
      this.#parameters.push([missing[1], field]);
      this.#parameterBox.hidden = false;
      this.#parameterBox.replaceChildren(h("legend", {}, "Its parameters"),
        h("div", { class: "fields small" }, this.#parameters.map(([, one]) => one.element)));
      this.#rest.hidden = false;
    }
    if (!this.#found?.name) this.#summary.replaceChildren();
  }

  #values() {
    return Object.fromEntries(this.#parameters.map(([name, field]) => [name, field.value]).filter(([, value]) => value !== undefined));
  }

  // When it is done.

  #choice(rule) {
    const fields = this.#rules.get(rule.name);
    const inside = h("div", { class: "fields small", hidden: rule.name !== this.#chosen }, fields.elements);
    const radio = h("input", { type: "radio", name: "rule", value: rule.name, checked: rule.name === this.#chosen, onchange: () => {
      this.#chosen = rule.name;
      for (const choice of this.element.querySelectorAll(".choice")) {
        choice.querySelector(".fields").hidden = choice.dataset.rule !== rule.name;
      }
      for (const [name, box] of this.#watched) box.disabled = name === rule.name;
    } });
    return h("div", { class: "choice", "data-rule": rule.name },
      h("label", {}, radio, h("span", {}, h("b", {}, rule.title), h("span", { class: "help" }, rule.help))), inside);
  }

  #watch(rule) {
    const box = h("input", { type: "checkbox", checked: Boolean(fieldIn("slope", rule)), disabled: rule.name === this.#chosen });
    this.#watched.set(rule.name, box);
    return h("label", { class: "toggle" }, box, rule.title);
  }

  #spec() {
    const watch = [...this.#watched].filter(([name, box]) => box.checked && name !== this.#chosen).map(([name]) => ({ name }));
    return {
      ...this.#limits.values(), ...this.#more.values(),
      rule: { name: this.#chosen, ...this.#rules.get(this.#chosen).values() },
      watch, view: this.#view.values(), parameters: this.#values(), keep_slices: this.#keep.checked, flicker_guard: this.#guard.checked,
    };
  }

  async #submit() {
    if (!this.#found?.sha256 || this.#button.disabled) return;
    const invalid = [...this.element.elements].find((one) => one.offsetParent && !one.checkValidity());
    if (invalid) { invalid.reportValidity(); return; }
    this.#blame(null);
    this.#button.disabled = true;
    try {
      const job = await this.#wanted.make((headers) => upload("/v1/jobs", this.#form(this.#spec()), { signal: this.#signal, headers }));
      this.#go(`/jobs/${job.id}`);
    } catch (error) {
      if (error.name === "AbortError") return;
      this.#blame(error);
    } finally {
      this.#button.disabled = false;
    }
  }

  /** Shows what the API refused, at the fields that it names, and goes there. */
  #blame(error) {
    const fields = [...this.#rules.get(this.#chosen).fields, ...this.#view.fields, ...this.#limits.fields, ...this.#more.fields,
      ...this.#parameters.map(([, field]) => field)];
    for (const field of fields) field.blame("");
    this.#wrong.hidden = !error;
    setText(this.#wrong, error?.message ?? "");
    if (!error) return;
    const named = new Map((error.details?.errors ?? []).map(({ field, message }) => [field, message]));
    const blamed = fields.filter(({ path }) => named.has(path));
    for (const field of blamed) field.blame(named.get(field.path));
    const place = blamed[0]?.input ?? this.#wrong;
    place.closest("details")?.setAttribute("open", "");
    place.focus();
  }
}
