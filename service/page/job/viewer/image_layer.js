// One of the two images that can be seen at once: as its display shows it, or at another exposure.

import { bytes } from "../../shared/api.js";
import { h } from "../../shared/dom.js";
import { Picture } from "../../shared/picture.js";
import { readExr } from "./exr.js";
import { linearised, toned } from "./tone_mapping.js";

/** The linear image of a job that still renders is fetched again so often. */
const LINEAR_EVERY_MS = 4000;

export class Side {
  #image = h("img", { alt: "", class: "layer", draggable: "false" });
  #canvas = h("canvas", { class: "layer", hidden: true });
  #picture = new Picture(this.#image);
  #linear = null;
  #under = null;
  element = h("div", { class: "side" }, this.#image, this.#canvas);

  /** How large what is shown is, in its own pixels. */
  get size() {
    return { width: this.#image.naturalWidth, height: this.#image.naturalHeight };
  }

  get spp() {
    return this.#picture.spp;
  }

  /** Says in words what it shows. */
  describe(text) {
    this.#image.alt = text;
    this.#canvas.setAttribute("aria-label", text);
    this.#canvas.setAttribute("role", "img");
  }

  /**
   * Shows a source `{ png, exr, ev, version }` with its light times 2^more.
   *
   * `exr` is the path of the same in linear light, or null where there is none: then the light is
   * that of the picture's 8 bits. `ev` is the exposure of the picture. `version` tells contents at
   * one path apart; null where they change all the time.
   *
   * What was asked for before and has not come yet is given up; the same again is waited for.
   */
  show(source, more, signal) {
    const key = JSON.stringify([source.png, source.version, more !== 0]);
    if (this.#under?.key === key) return this.#under.promise;
    this.#under?.stop.abort();
    const stop = new AbortController();
    const either = AbortSignal.any([signal, stop.signal]);
    const promise = this.#load(source, more !== 0, either).finally(() => {
      if (this.#under?.stop === stop) this.#under = null;
    });
    this.#under = { key, stop, promise };
    return promise;
  }

  /** Draws it with its light times 2^more; with none, or before its light has come, as a picture. */
  expose(more) {
    const linear = more !== 0 && this.#linear?.png === this.#picture.path ? this.#linear : null;
    this.#canvas.hidden = !linear;
    this.#image.hidden = Boolean(linear);
    if (!linear || (linear.shown === more)) return;
    const { width, height } = linear.image;
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    this.#canvas.getContext("2d").putImageData(toned(linear.image, linear.ev + more), 0, 0);
    linear.shown = more;
  }

  /** Frees the memory of what is shown. */
  letGo() {
    this.#under?.stop.abort();
    this.#picture.letGo();
  }

  async #load(source, inLight, signal) {
    const isNew = await this.#picture.show(source.png, signal);
    if (!inLight) return;
    const known = this.#linear;
    if (known?.png === source.png && known.version === source.version) {
      if (source.exr ? source.version !== null || Date.now() < known.at + LINEAR_EVERY_MS : !isNew) return;
    }
    this.#linear = {
      png: source.png, version: source.version, at: Date.now(), shown: null,
      ev: source.exr ? source.ev : 0,
      image: source.exr ? await linearOf(source.exr, signal) : linearised(this.#image),
    };
  }
}

async function linearOf(path, signal) {
  const { blob } = await bytes(path, signal);
  return readExr(await blob.arrayBuffer());
}
