// Pictures of the API in <img> elements: fetched with the key, and shown as blobs.

import { bytes } from "./api.js";
import { h } from "./dom.js";

/**
 * The URL of a decoded picture; the caller revokes it.
 * @param {Blob} blob
 */
export async function decoded(blob) {
  const image = h("img", { src: URL.createObjectURL(blob) });
  await image.decode().catch((error) => { URL.revokeObjectURL(image.src); throw error; });
  return image.src;
}

/** An <img> that shows the picture at a path. */
export class Picture {
  #image;
  /** The path and the ETag of the shown picture. */
  #shown = "";
  /** @type {{ path: string, stop: AbortController, promise: Promise<void> } | null} */
  #pending = null;
  /** Samples per pixel of the shown image, if the API tells. @type {number | null} */
  spp = null;

  /** @param {HTMLImageElement} image */
  constructor(image) {
    this.#image = image;
  }

  /**
   * Fetches a picture and shows it if it is new; the old one stays until the new one is decoded. It aborts a pending
   * request for another one, and waits for one for the same.
   * @param {string} path
   * @param {AbortSignal} signal
   */
  show(path, signal) {
    if (this.#pending?.path === path) return this.#pending.promise;
    this.#pending?.stop.abort();
    const stop = new AbortController();
    const promise = this.#fetch(path, AbortSignal.any([signal, stop.signal])).finally(() => {
      if (this.#pending?.stop === stop) this.#pending = null;
    });
    this.#pending = { path, stop, promise };
    return promise;
  }

  /**
   * @param {string} path
   * @param {AbortSignal} signal
   */
  async #fetch(path, signal) {
    const { blob, tag, spp } = await bytes(path, signal);
    const found = `${path} ${tag}`;
    if (tag && found === this.#shown) return;
    const url = await decoded(blob);
    if (signal.aborted) {
      URL.revokeObjectURL(url);
      throw signal.reason;
    }
    this.#free();
    this.#image.src = url;
    this.spp = spp;
    this.#shown = found;
  }

  /** Frees the memory of the shown picture, and awaits no other. */
  letGo() {
    this.#pending?.stop.abort();
    this.#free();
  }

  #free() {
    if (this.#image.src.startsWith("blob:")) URL.revokeObjectURL(this.#image.src);
  }
}
