// A job's image: as it improves, at any exposure, against earlier ones, and where it differs.

import { bytes, get } from "./api.js";
import { h, setAttribute, setText } from "./dom.js";
import { readExr } from "./exr.js";
import { Picture } from "./pictures.js";
import { Stage } from "./stage.js";
import { toned } from "./tone.js";
import { whole } from "./words.js";
import { ZoneMap } from "./zones.js";

const NEWEST = "newest";
const LINEAR_EVERY_MS = 4000;
const MODES = [
  ["image", "Image"],
  ["compare", "Compare"],
  ["difference", "Difference"],
  ["zones", "Zones"],
];

export class Viewer {
  #signal;
  #job = null;
  #mode = "image";
  #base = h("img", { alt: "", class: "layer", draggable: "false" });
  #linear = h("canvas", { class: "layer", hidden: true });
  #over = h("img", { alt: "", class: "layer", draggable: "false", hidden: true });
  #zones = new ZoneMap();
  #lower = new Picture(this.#base);
  #upper = new Picture(this.#over);
  #stage = new Stage([this.#base, this.#linear, this.#over, this.#zones.element], (at) => this.#wipeTo(at));
  #spp = null;
  #listed = "";
  #busy = false;
  #exr = { image: null, finished: null, at: 0 };
  #previews = [];
  #nothing = h("p", { class: "nothing-yet" });
  #caption = h("p", { class: "caption" });
  #panels;
  #exposure;
  #compare;
  #overlay;

  constructor(signal) {
    this.#signal = signal;
    this.#exposure = slider("Exposure", { min: -6, max: 6, step: 0.1, value: 0 }, () => this.#expose());
    this.#overlay = slider("Overlay", { min: 0, max: 100, step: 1, value: 100 }, () => this.#layers());
    this.#compare = this.#comparison();
    const zones = h("select", { onchange: () => { this.#zones.measure(zones.value); this.#words(); } },
      h("option", { value: "estimate_fraction" }, "what is still visible"),
      h("option", { value: "visible_fraction" }, "what differs from the first image"));
    const reset = h("button", { class: "quiet", onclick: () => { this.#exposure.input.value = 0; this.#expose(); } }, "As judged");
    this.#panels = {
      image: h("div", { class: "panel" }, this.#exposure.label, reset),
      compare: this.#compare.panel,
      difference: h("div", { class: "panel" }, this.#overlay.label,
        h("span", { class: "hint" }, "Orange: a person would see that it differs from the first image.")),
      zones: h("div", { class: "panel" }, h("label", {}, h("span", {}, "By zones"), zones)),
    };
    const modes = h("div", { class: "modes", role: "group", "aria-label": "What is shown" },
      MODES.map(([value, text]) => h("button", {
        "aria-pressed": String(value === this.#mode), "data-mode": value, onclick: () => this.#turn(value),
      }, text)));
    this.#stage.element.hidden = true;
    this.element = h("section", { class: "viewer", "aria-labelledby": "image-title" },
      h("div", { class: "viewer-head" }, h("h2", { id: "image-title" }, "Its image"), modes),
      this.#nothing, this.#stage.element, this.#caption,
      ...Object.values(this.#panels));
    this.#turn("image");
    signal.addEventListener("abort", () => {
      this.#lower.letGo();
      this.#upper.letGo();
    });
  }

  /** Shows the job's newest image and its newest point; at most one look is under way. */
  async show(job, points) {
    this.#job = job;
    this.#zones.show(job, points[points.length - 1]);
    if (!this.#spp) setText(this.#nothing, "Its first image comes with its first step.");
    if (this.#busy || !job.points) return;
    this.#busy = true;
    try {
      await this.#look();
    } catch (error) {
      if (error.slug !== "no-image-yet") throw error;
      if (job.finished_at) setText(this.#nothing, error.message);
    } finally {
      this.#busy = false;
    }
  }

  /** Fetches what the chosen mode shows; what has not changed is not shown again. */
  async #look() {
    const { links, points, finished_at: finished } = this.#job;
    const stamp = `${points} ${finished ?? ""}`;
    if (stamp !== this.#listed) {
      await this.#listPreviews();
      this.#listed = stamp;
    }
    const comparing = this.#mode === "compare";
    const base = comparing ? this.#pathOf(this.#compare.left.value) : links.image_png;
    const over = comparing ? this.#pathOf(this.#compare.right.value)
      : this.#mode === "difference" ? links.difference_png : null;
    await Promise.all([
      this.#lower.show(base, this.#signal),
      over && this.#upper.show(over, this.#signal),
      this.#ev() !== 0 && this.#fetchLinear(),
    ]);
    this.#nothing.hidden = true;
    this.#stage.element.hidden = false;
    this.#stage.fit(this.#base.naturalWidth, this.#base.naturalHeight);
    if (!comparing) this.#spp = this.#lower.spp;
    setAttribute(this.#base, "alt", `The image of ${this.#job.name} at ${whole(this.#spp ?? this.#job.spp)} spp`);
    this.#paint();
  }

  #turn(mode) {
    this.#mode = mode;
    for (const button of this.element.querySelectorAll("[data-mode]")) {
      setAttribute(button, "aria-pressed", String(button.dataset.mode === mode));
    }
    for (const [name, panel] of Object.entries(this.#panels)) panel.hidden = name !== mode;
    this.#zones.element.toggleAttribute("hidden", mode !== "zones");
    this.#layers();
    this.#words();
    this.#choose();
  }

  /** Shows what was just chosen; a look that is under way would show what was chosen before. */
  async #choose() {
    if (!this.#job?.points) return;
    try {
      await this.#look();
    } catch (error) {
      if (!this.#signal.aborted) setText(this.#caption, error.message);
    }
  }

  // Layers.

  #layers() {
    const linear = this.#mode === "image" && this.#ev() !== 0 && this.#exr.image !== null;
    this.#linear.hidden = !linear;
    this.#base.hidden = linear;
    this.#over.hidden = !["compare", "difference"].includes(this.#mode) || !this.#over.src;
    this.#over.style.opacity = this.#mode === "difference" ? this.#overlay.input.value / 100 : 1;
    setText(this.#overlay.output, `${this.#overlay.input.value} %`);
    this.#stage.wipe(this.#mode === "compare" ? Number(this.#compare.input.value) : null, this.#over);
  }

  #pathOf(choice) {
    return choice === NEWEST ? this.#job.links.image_png
      : this.#previews.find(({ spp }) => String(spp) === choice)?.link ?? this.#job.links.image_png;
  }

  // Exposure.

  #ev() {
    return Number(this.#exposure.input.value);
  }

  async #expose() {
    try {
      if (this.#ev() !== 0) await this.#fetchLinear();
      this.#paint();
    } catch (error) {
      setText(this.#caption, `The linear image cannot be shown: ${error.message}`);
    }
  }

  async #fetchLinear() {
    const { links, finished_at: finished } = this.#job;
    const fresh = Date.now() < this.#exr.at + LINEAR_EVERY_MS;
    if (this.#exr.image && ((finished && this.#exr.finished === finished) || (!finished && fresh))) return;
    const { blob } = await bytes(links.image_exr, this.#signal);
    this.#exr = { image: await readExr(await blob.arrayBuffer()), finished, at: Date.now() };
  }

  /** Brings layers, sliders and words up to date with what is chosen and there. */
  #paint() {
    const ev = this.#ev();
    const sign = ev > 0 ? "+" : ev < 0 ? "−" : "";
    setText(this.#exposure.output, `${sign}${Math.abs(ev).toFixed(1)} EV`);
    if (this.#mode === "image" && ev !== 0 && this.#exr.image) {
      const { width, height } = this.#exr.image;
      if (this.#linear.width !== width || this.#linear.height !== height) Object.assign(this.#linear, { width, height });
      const shown = toned(this.#exr.image, this.#job.spec.view.exposure_ev + ev);
      this.#linear.getContext("2d").putImageData(shown, 0, 0);
    }
    this.#layers();
    this.#words();
  }

  // Comparing.

  #comparison() {
    const choose = (name) => {
      const select = h("select", { onchange: () => this.#choose() });
      return { select, label: h("label", {}, h("span", {}, name), select) };
    };
    const [left, right] = [choose("Left"), choose("Right")];
    const wipe = slider("Wipe", { min: 0, max: 100, step: 0.5, value: 50 }, () => this.#layers());
    return { input: wipe.input, left: left.select, right: right.select,
      panel: h("div", { class: "panel" }, wipe.label, left.label, right.label,
        h("span", { class: "hint" }, "Earlier images are kept as they were shown: exposure works on the newest alone.")) };
  }

  async #listPreviews() {
    const { previews } = await get(this.#job.links.previews, this.#signal);
    const changed = previews.map(({ spp }) => spp).join() !== this.#previews.map(({ spp }) => spp).join();
    this.#previews = previews;
    const final = this.#job.finished_at ? "final image" : "newest image";
    for (const [select, start] of [[this.#compare.left, previews[0]?.spp], [this.#compare.right, NEWEST]]) {
      if (changed || !select.options.length) {
        const value = select.value || String(start ?? NEWEST);
        select.replaceChildren(...previews.map(({ spp }) => h("option", { value: spp }, `${whole(spp)} spp`)),
          h("option", { value: NEWEST }, final));
        select.value = value;
        if (select.selectedIndex < 0) select.value = NEWEST;
      } else {
        setText(select.options[select.options.length - 1], final);
      }
    }
  }

  #wipeTo(share) {
    if (this.#mode !== "compare") return;
    this.#compare.input.value = 100 * share;
    this.#layers();
  }

  #words() {
    const job = this.#job;
    if (!job) return;
    const size = job.width ? `${job.width} × ${job.height}` : "";
    const said = {
      image: this.#ev() === 0 ? "as its display shows it" : "from the linear image",
      compare: "drag across the image, or use the slider",
      difference: "on the image in dim grey",
      zones: this.#zones.caption(),
    };
    setText(this.#caption, [size, this.#spp && this.#mode !== "compare" && `${whole(this.#spp)} spp`, said[this.#mode]].filter(Boolean).join(" · "));
  }
}

function slider(name, attributes, act) {
  const input = h("input", { type: "range", ...attributes, oninput: act });
  const output = h("output");
  return { input, output, label: h("label", { class: "slider" }, h("span", {}, name), input, output) };
}
