// One of the viewer's two images, as the job's display shows it or at another exposure.

import { bytes } from "../../shared/api.js";
import { drawing, h } from "../../shared/dom.js";
import { Picture } from "../../shared/picture.js";
import { over, readExr } from "./exr.js";
import { linearised, toned } from "./tone_mapping.js";

/** How long the linear image of a running job is shown before it is fetched again. */
const LINEAR_EVERY_MS = 4000;

/** @import { LinearImage } from "./exr.js" */

/**
 * What an image layer can show.
 * @typedef {object} Source
 * @property {string} [name]
 * @property {string} png
 * @property {string | null} exr - the same in linear light; null: the light comes from the picture's 8 bits
 * @property {number[]} [background] - linear R, G and B behind the linear image; without it, it is over black
 * @property {number} ev - the exposure of the picture
 * @property {string | null} version - distinguishes contents of one path; null if they change all the time
 */

export class ImageLayer {
  #image = h("img", { alt: "", class: "layer", draggable: "false" });
  #canvas = h("canvas", { class: "layer", hidden: true });
  #picture = new Picture(this.#image);
  /** @type {{ png: string, version: string | null, at: number, shown: number | null, ev: number, image: LinearImage } | null} */
  #linear = null;
  /** @type {{ key: string, stop: AbortController, promise: Promise<void> } | null} */
  #under = null;
  element = h("div", { class: "side" }, this.#image, this.#canvas);

  /** The size of the image in its own pixels. */
  get size() {
    return { width: this.#image.naturalWidth, height: this.#image.naturalHeight };
  }

  get spp() {
    return this.#picture.spp;
  }

  /** The file of the shown picture; null before the first. */
  get file() {
    return this.#picture.file;
  }

  /**
   * Sets the description for screen readers.
   * @param {string} text
   */
  describe(text) {
    this.#image.alt = text;
    this.#canvas.setAttribute("aria-label", text);
    this.#canvas.setAttribute("role", "img");
  }

  /**
   * Shows a source with its light times 2^more.
   *
   * It aborts a pending request for another source, and waits for one for the same.
   * @param {Source} source
   * @param {number} more
   * @param {AbortSignal} signal
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

  /**
   * Draws it with its light times 2^more; at 0, or until the light has been fetched, as a picture.
   * @param {number} more
   */
  expose(more) {
    const linear = more !== 0 && this.#linear?.png === this.#picture.path ? this.#linear : null;
    this.#canvas.hidden = !linear;
    this.#image.hidden = Boolean(linear);
    if (!linear || (linear.shown === more)) return;
    const { width, height } = linear.image;
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    drawing(this.#canvas).putImageData(toned(linear.image, linear.ev + more), 0, 0);
    linear.shown = more;
  }

  /** Aborts a pending request and frees memory. */
  letGo() {
    this.#under?.stop.abort();
    this.#picture.letGo();
  }

  /**
   * @param {Source} source
   * @param {boolean} inLight
   * @param {AbortSignal} signal
   */
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
      image: source.exr ? await linearOf(source, source.exr, signal) : linearised(this.#image),
    };
  }
}

/**
 * @param {Source} source
 * @param {string} path - of its linear image
 * @param {AbortSignal} signal
 */
async function linearOf({ background = [0, 0, 0] }, path, signal) {
  const { blob } = await bytes(path, signal);
  return over(await readExr(await blob.arrayBuffer()), background);
}
