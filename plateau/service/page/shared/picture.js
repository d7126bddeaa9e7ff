// Pictures of the API in <img> elements: fetched with the key, and shown as blobs.

import { bytes } from "./api.js";
import { h } from "./dom.js";

/**
 * The URL of a decoded picture; the caller revokes it.
 * @param {Blob} blob
 */
export async function decoded(blob) {
  const image = h("img", { src: URL.createObjectURL(blob) });
  await image.decode();
  return image.src;
}

/** An <img> that shows the picture at a path. */
export class Picture {
  #image;
  /** @type {string | null} */
  #tag = null;
  /** @type {string | null} */
  #path = null;
  #wanted = "";
  /**
   * Samples per pixel of the shown image, if the API tells.
   * @type {number | null}
   */
  spp = null;

  /** @param {HTMLImageElement} image */
  constructor(image) {
    this.#image = image;
  }

  /**
   * Fetches a picture and shows it if it is new; resolves to whether it is. The old one stays until
   * the new one is decoded.
   * @param {string} path
   * @param {AbortSignal} signal
   */
  async show(path, signal) {
    this.#wanted = path;
    const { blob, tag, spp } = await bytes(path, signal);
    if (path === this.#path && tag && tag === this.#tag) return false;
    const url = await decoded(blob);
    // Another picture was requested meanwhile.
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

  /** Frees the memory of the shown picture. */
  letGo() {
    if (this.#image.src.startsWith("blob:")) URL.revokeObjectURL(this.#image.src);
  }
}
