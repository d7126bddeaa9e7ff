// Pictures of the API in <img> elements: fetched with the key, shown as blobs, let go afterwards.

import { bytes } from "./api.js";
import { h } from "./dom.js";

/**
 * The URL of a picture that is ready to be shown; whoever shows it revokes it.
 * @param {Blob} blob
 */
export async function decoded(blob) {
  const image = h("img", { src: URL.createObjectURL(blob) });
  await image.decode();
  return image.src;
}

/** Shows in an <img> what is at a path; resolves to whether it has changed. */
export class Picture {
  #image;
  /** @type {string | null} */
  #tag = null;
  /** @type {string | null} */
  #path = null;
  #wanted = "";
  /**
   * Samples per pixel of the merged image that is shown, if the API says so.
   * @type {number | null}
   */
  spp = null;

  /** @param {HTMLImageElement} image */
  constructor(image) {
    this.#image = image;
  }

  /** The path of what is shown; null before anything is. */
  get path() {
    return this.#path;
  }

  /**
   * Fetches it and shows it if it is new; the old one stays until the new one is decoded.
   * @param {string} path
   * @param {AbortSignal} signal
   */
  async show(path, signal) {
    this.#wanted = path;
    const { blob, tag, spp } = await bytes(path, signal);
    if (path === this.#path && tag && tag === this.#tag) return false;
    const url = await decoded(blob);
    // Another was asked for meanwhile.
    if (this.#wanted !== path) {
      URL.revokeObjectURL(url);
      return false;
    }
    this.letGo();
    this.#image.src = url;
    this.spp = spp;
    this.#path = path;
    this.#tag = tag;
    return true;
  }

  /** Frees the memory of what is shown. */
  letGo() {
    if (this.#image.src.startsWith("blob:")) URL.revokeObjectURL(this.#image.src);
  }
}
