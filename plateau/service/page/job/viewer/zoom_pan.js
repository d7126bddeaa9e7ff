// The stage for layers of images: zoom, pan by scrolling, and a wipe between two layers.

import { h, signButton } from "../../shared/dom.js";

/** @typedef {{ x: number, y: number }} Place  in shares of the frame */
/**
 * What a stage tells: the pointer's share of the width while it wipes, the key that flips, and how many pixels of
 * the display a pixel of the image is wide.
 * @typedef {{ wipe: (share: number) => void, flip: () => void, sized: (shown: number) => void }} Listener
 */

const MOST = 64;
/** @type {Place} */
const MIDDLE = { x: 0.5, y: 0.5 };

export class Stage {
  #sheet;
  #line = h("div", { class: "wipe", hidden: true });
  #zoomText = h("output", { class: "zoom" });
  #size = { width: 1, height: 1 };
  /** Relative to the fitted image. */
  #scale = 1;
  #listener;
  #wiping = false;
  /** @type {HTMLElement} */
  #frame;
  /** @type {PointerEvent | null} */
  #dragged = null;

  /**
   * @param {Element[]} layers - the last one is on top
   * @param {Listener} listener
   */
  constructor(layers, listener) {
    this.#listener = listener;
    this.#sheet = h("div", { class: "sheet" }, layers, this.#line);
    this.#frame = h("div", {
      class: "frame", tabindex: 0, role: "group",
      "aria-label": "Image. Plus and minus zoom, arrows move, 0 fits it, 1 shows its own pixels, F flips two that are compared.",
      onkeydown: (event) => this.#key(event),
      onwheel: (event) => this.#wheel(event),
      ondblclick: (event) => this.#set(this.#scale > 1 ? 1 : Math.max(2, 2 * this.#ownScale()), this.#place(event)),
      onpointerdown: (event) => this.#down(event),
      onpointermove: (event) => this.#move(event),
      onpointerup: () => (this.#dragged = null),
      onpointercancel: () => (this.#dragged = null),
    }, this.#sheet);
    this.element = h("div", { class: "stage" }, this.#frame,
      h("div", { class: "zooms" },
        signButton("−", "Zoom out of the image", () => this.#zoom(1 / 1.5)), this.#zoomText,
        signButton("+", "Zoom into the image", () => this.#zoom(1.5)),
        signButton("Fit", "Fit the image", () => this.#set(1)),
        signButton("1:1", "Show the image's own pixels", () => this.#set(this.#ownScale()))));
    new ResizeObserver(() => this.#say()).observe(this.#sheet);
  }

  /**
   * Sets the size of the image.
   * @param {number} width
   * @param {number} height
   */
  fit(width, height) {
    if (width === this.#size.width && height === this.#size.height) return;
    this.#size = { width, height };
    this.#frame.style.aspectRatio = this.#sheet.style.aspectRatio = `${width} / ${height}`;
    this.#frame.style.maxWidth = `calc(72vh * ${width / height})`;
    this.#set(1);
  }

  /**
   * Shows a layer to the right of this percentage of the width; with null, all of it.
   * @param {number | null} percent
   * @param {HTMLElement} layer
   */
  wipe(percent, layer) {
    this.#wiping = percent !== null;
    this.#line.hidden = !this.#wiping;
    layer.style.clipPath = this.#wiping ? `inset(0 0 0 ${percent}%)` : "none";
    this.#line.style.left = `${percent ?? 0}%`;
    this.#frame.classList.toggle("wiping", this.#wiping);
  }

  /**
   * Shows the image at a scale; what is at a place stays there.
   * @param {number} scale
   */
  #set(scale, at = MIDDLE) {
    const { clientWidth: width, clientHeight: height, scrollLeft, scrollTop } = this.#frame;
    const grown = scale / this.#scale;
    this.#scale = Math.abs(scale - 1) < 1e-6 ? 1 : scale;  // and then the wheel scrolls the page
    this.#sheet.style.width = `${100 * scale}%`;
    this.#frame.classList.toggle("zoomed", scale > 1);
    this.#frame.scrollTo((scrollLeft + at.x * width) * grown - at.x * width, (scrollTop + at.y * height) * grown - at.y * height);
    this.#say();
  }

  #say() {
    this.#sheet.style.translate = "none";
    const { left, top, width } = this.#sheet.getBoundingClientRect();
    // Its corner lies between no two pixels of the display, so that at 1:1 it is not blurred.
    const [right, down] = [left, top].map((corner) => Math.round(corner * devicePixelRatio) / devicePixelRatio - corner);
    this.#sheet.style.translate = `${right}px ${down}px`;
    const shown = (width * devicePixelRatio) / this.#size.width;
    this.#sheet.classList.toggle("crisp", shown >= 2 || Math.abs(shown - 1) < 1e-3);
    this.#zoomText.value = width ? `${Math.round(shown * 100)} %` : "";
    this.#listener.sized(shown);
  }

  /** The scale at which a pixel of the image is one of the display. */
  #ownScale() {
    return this.#size.width / devicePixelRatio / this.#frame.getBoundingClientRect().width;
  }

  /** @param {number} factor */
  #zoom(factor, at = MIDDLE) {
    this.#set(Math.min(MOST, Math.max(Math.min(1, this.#ownScale()), this.#scale * factor)), at);
  }

  /**
   * The position of an event in the frame.
   * @param {MouseEvent} event
   */
  #place(event) {
    const box = this.#frame.getBoundingClientRect();
    return { x: (event.clientX - box.left) / box.width, y: (event.clientY - box.top) / box.height };
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    // Over a fitted image, the wheel scrolls the page.
    if (!event.ctrlKey && this.#scale === 1) return;
    event.preventDefault();
    this.#zoom(2 ** (-event.deltaY / 200), this.#place(event));
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button) return;
    this.#dragged = event;
    this.#frame.setPointerCapture(event.pointerId);
    this.#move(event);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = this.#dragged;
    if (!before) return;
    this.#dragged = event;
    const { left, width } = this.#sheet.getBoundingClientRect();
    if (this.#wiping) this.#listener.wipe(Math.min(1, Math.max(0, (event.clientX - left) / width)));
    // A finger scrolls by itself.
    else if (event.pointerType === "mouse") this.#frame.scrollBy(before.clientX - event.clientX, before.clientY - event.clientY);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "+" || event.key === "=") this.#zoom(1.5);
    else if (event.key === "-") this.#zoom(1 / 1.5);
    else if (event.key === "0") this.#set(1);
    else if (event.key === "1") this.#set(this.#ownScale());
    else if (event.key.toLowerCase() === "f") this.#listener.flip();
    else return; // arrows scroll
    event.preventDefault();
  }
}
