// One of the viewer's two pictures.

import { h } from "../../shared/dom.js";
import { Picture } from "../../shared/picture.js";

/**
 * What an image layer can show.
 * @typedef {object} Source
 * @property {string} [name]
 * @property {string} png
 * @property {string | null} version - distinguishes contents of one path; null if they change all the time
 */

export class ImageLayer {
  #image = h("img", { alt: "", class: "layer", draggable: "false" });
  #picture = new Picture(this.#image);
  /** @type {{ key: string, stop: AbortController, promise: Promise<unknown> } | null} */
  #under = null;
  element = h("div", { class: "side" }, this.#image);

  /** The size of the image in its own pixels. */
  get size() {
    return { width: this.#image.naturalWidth, height: this.#image.naturalHeight };
  }

  get spp() {
    return this.#picture.spp;
  }

  /**
   * Sets the description for screen readers.
   * @param {string} text
   */
  describe(text) {
    this.#image.alt = text;
  }

  /**
   * Shows a source. It aborts a pending request for another one, and waits for one for the same.
   * @param {Source} source
   * @param {AbortSignal} signal
   */
  show({ png, version }, signal) {
    const key = JSON.stringify([png, version]);
    if (this.#under?.key === key) return this.#under.promise;
    this.#under?.stop.abort();
    const stop = new AbortController();
    const promise = this.#picture.show(png, AbortSignal.any([signal, stop.signal])).finally(() => {
      if (this.#under?.stop === stop) this.#under = null;
    });
    this.#under = { key, stop, promise };
    return promise;
  }

  /**
   * Filters the picture.
   * @param {string} filter - of CSS
   */
  filter(filter) {
    this.#image.style.filter = filter;
  }

  /** Aborts a pending request and frees memory. */
  letGo() {
    this.#under?.stop.abort();
    this.#picture.letGo();
  }
}
