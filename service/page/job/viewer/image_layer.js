// One of the viewer's two images, as the job's display shows it or from its linear light.

import { bytes } from "../../shared/api.js";
import { drawing, h } from "../../shared/dom.js";
import { Picture } from "../../shared/picture.js";
import { layerOf, shownOf } from "./channels.js";
import { readExr } from "./exr.js";
import { isAsJudged } from "./look.js";
import { linearised, pictureOf } from "./tone_mapping.js";

/** How long the linear image of a running job is shown before it is fetched again. */
const LINEAR_EVERY_MS = 4000;

/** @import { Shown } from "./channels.js" */
/** @import { LinearImage } from "./exr.js" */
/** @import { Look } from "./look.js" */

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
  /**
   * The linear image, whose `layer` was read beside its light.
   * @type {{ png: string, version: string | null, layer: string, at: number, ev: number, background: number[], image: LinearImage } | null}
   */
  #linear = null;
  /** What of which linear image is on the canvas. @type {{ of: LinearImage, look: string, shown: Shown } | null} */
  #drawn = null;
  /** @type {{ key: string, stop: AbortController, promise: Promise<void> } | null} */
  #under = null;
  element = h("div", { class: "side" }, this.#image, this.#canvas);

  /** The linear image of the shown picture; null unless it was fetched. */
  get linear() {
    return this.#linear?.png === this.#picture.path ? this.#linear : null;
  }

  /** What its canvas shows; null while it shows the picture. */
  get shown() {
    return this.#canvas.hidden ? null : this.#drawn?.shown ?? null;
  }

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
   * Shows a source, and fetches its linear image where a layer of it is wanted; "" is its light alone.
   *
   * It aborts a pending request for another source, and waits for one for the same.
   * @param {Source} source
   * @param {string | null} layer
   * @param {AbortSignal} signal
   */
  show(source, layer, signal) {
    const key = JSON.stringify([source.png, source.version, layer]);
    if (this.#under?.key === key) return this.#under.promise;
    this.#under?.stop.abort();
    const stop = new AbortController();
    const either = AbortSignal.any([signal, stop.signal]);
    const promise = this.#load(source, layer, either).finally(() => {
      if (this.#under?.stop === stop) this.#under = null;
    });
    this.#under = { key, stop, promise };
    return promise;
  }

  /**
   * Draws it as it is looked at; as judged, or until the light has been fetched, as a picture.
   * @param {Look} look
   */
  draw(look) {
    const linear = isAsJudged(look) ? null : this.linear;
    this.#canvas.hidden = !linear;
    this.#image.hidden = Boolean(linear);
    const key = JSON.stringify(look);
    if (!linear || (this.#drawn?.of === linear.image && this.#drawn.look === key)) return;
    const { image, background, ev } = linear;
    const { width, height } = image;
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    const shown = shownOf(image, look.choice, background);
    drawing(this.#canvas).putImageData(pictureOf(shown, image, ev + look.ev, look.palette), 0, 0);
    this.#drawn = { of: image, look: key, shown };
  }

  /** Aborts a pending request and frees memory. */
  letGo() {
    this.#under?.stop.abort();
    this.#picture.letGo();
  }

  /**
   * @param {Source} source
   * @param {string | null} layer
   * @param {AbortSignal} signal
   */
  async #load(source, layer, signal) {
    const isNew = await this.#picture.show(source.png, signal);
    if (layer === null) return;
    const known = this.#linear;
    if (known?.png === source.png && known.version === source.version && (!layer || known.layer === layer)) {
      if (source.exr ? source.version !== null || Date.now() < known.at + LINEAR_EVERY_MS : !isNew) return;
    }
    const { png, version, background = [0, 0, 0] } = source;
    const image = source.exr ? await linearOf(source.exr, layer, signal) : linearised(this.#image);
    this.#linear = { png, version, layer, at: Date.now(), ev: source.exr ? source.ev : 0, background, image };
  }
}

/**
 * @param {string} path - of a linear image
 * @param {string} layer
 * @param {AbortSignal} signal
 */
async function linearOf(path, layer, signal) {
  const { blob } = await bytes(path, signal);
  return readExr(await blob.arrayBuffer(), (channel) => ["", layer].includes(layerOf(channel)));
}
