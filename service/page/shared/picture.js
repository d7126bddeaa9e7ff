// Pictures of the API in <img> elements: fetched with the key, shown as blobs, let go afterwards.

import { bytes } from "./api.js";

/** Shows in an <img> what is at a path; resolves to whether it has changed. */
export class Picture {
  #image;
  #tag = null;
  #path = null;
  #wanted = null;
  /** Samples per pixel of the merged image that is shown, where the API says so. */
  spp = null;

  constructor(image) {
    this.#image = image;
  }

  /** The path of what is shown; null before anything is. */
  get path() {
    return this.#path;
  }

  /** Fetches it and shows it where it is new; the old one stays until the new one is decoded. */
  async show(path, signal) {
    this.#wanted = path;
    const { blob, tag, spp } = await bytes(path, signal);
    if (path === this.#path && tag && tag === this.#tag) return false;
    const url = URL.createObjectURL(blob);
    const next = new Image();
    next.src = url;
    await next.decode();
    // Another was asked for meanwhile.
    if (this.#wanted !== path) {
      URL.revokeObjectURL(url);
      return false;
    }
    this.letGo();
    this.#image.src = url;
    [this.#path, this.#tag, this.spp] = [path, tag, spp];
    return true;
  }

  /** Frees the memory of what is shown. */
  letGo() {
    if (this.#image.src.startsWith("blob:")) URL.revokeObjectURL(this.#image.src);
  }
}
