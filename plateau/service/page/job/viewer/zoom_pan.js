// The stage for layers of images: zoom, pan, and a wipe between two layers.

import { h, signButton } from "../../shared/dom.js";

/** @typedef {{ x: number, y: number }} Place  in shares of the frame, from its middle */
/**
 * What a stage tells: the pointer's share of the width while it wipes, and the key that flips.
 * @typedef {{ wipe: (share: number) => void, flip: () => void }} Listener
 */

const MOST = 64;
/** @type {Record<string, Place>} */
const ARROWS = { ArrowLeft: { x: 0.1, y: 0 }, ArrowRight: { x: -0.1, y: 0 }, ArrowUp: { x: 0, y: 0.1 }, ArrowDown: { x: 0, y: -0.1 } };

export class Stage {
  #sheet;
  #line = h("div", { class: "wipe", hidden: true });
  #zoomText = h("output", { class: "zoom" });
  #size = { width: 1, height: 1 };
  #view = { scale: 1, x: 0, y: 0 };
  #listener;
  #wiping = false;
  /** @type {HTMLElement} */
  #frame;
  /** @type {Map<number, PointerEvent>} */
  #pointers = new Map();

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
      ondblclick: (event) => this.#toggle(event),
      onpointerdown: (event) => this.#down(event),
      onpointermove: (event) => this.#move(event),
      onpointerup: (event) => this.#pointers.delete(event.pointerId),
      onpointercancel: (event) => this.#pointers.delete(event.pointerId),
    }, this.#sheet);
    this.element = h("div", { class: "stage" }, this.#frame,
      h("div", { class: "zooms" },
        signButton("−", "Zoom out of the image", () => this.#zoom(1 / 1.5)), this.#zoomText,
        signButton("+", "Zoom into the image", () => this.#zoom(1.5)),
        signButton("Fit", "Fit the image", () => this.#set({ scale: 1, x: 0, y: 0 })),
        signButton("1:1", "Show the image's own pixels", () => this.#own())));
    new ResizeObserver(() => this.#set(this.#view)).observe(this.#frame);
  }

  /**
   * Sets the size of the image.
   * @param {number} width
   * @param {number} height
   */
  fit(width, height) {
    if (width === this.#size.width && height === this.#size.height) return;
    this.#size = { width, height };
    this.#frame.style.aspectRatio = `${width} / ${height}`;
    this.#frame.style.maxWidth = `calc(72vh * ${width / height})`;
    this.#set({ scale: 1, x: 0, y: 0 });
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

  // The view: its scale relative to the fitted image, and its middle in shares of the frame.

  /** @param {Place & { scale: number }} view */
  #set({ scale, x, y }) {
    const most = Math.max(0, (scale - 1) / 2);
    const bound = (/** @type {number} */ value) => Math.min(most, Math.max(-most, value));
    this.#view = { scale, x: bound(x), y: bound(y) };
    const { left, top, width, height } = this.#frame.getBoundingClientRect();
    // Its corner lies between no two pixels of the display, so that at 1:1 it is not blurred.
    const snapped = (/** @type {number} */ start, /** @type {number} */ length, /** @type {number} */ middle) => {
      const corner = start + length / 2 + middle * length - (scale * length) / 2;
      return middle * length + Math.round(corner * devicePixelRatio) / devicePixelRatio - corner;
    };
    const [right, down] = [snapped(left, width, this.#view.x), snapped(top, height, this.#view.y)];
    this.#sheet.style.transform = `translate(${right}px, ${down}px) scale(${scale})`;
    this.#line.style.width = `${2 / scale}px`;
    const shown = (scale * width * devicePixelRatio) / this.#size.width;
    this.#sheet.classList.toggle("large", shown >= 2 || Math.abs(shown - 1) < 1e-6);
    this.#frame.classList.toggle("zoomed", scale > 1);
    this.#zoomText.value = width ? `${Math.round(shown * 100)} %` : "";
  }

  /** The scale at which a pixel of the image is one of the display. */
  #ownScale() {
    return this.#size.width / devicePixelRatio / this.#frame.getBoundingClientRect().width;
  }

  /** @param {number} factor */
  #zoom(factor, at = { x: 0, y: 0 }) {
    const { scale, x, y } = this.#view;
    const next = Math.min(MOST, Math.max(Math.min(1, this.#ownScale()), scale * factor));
    const grown = next / scale;
    this.#set({ scale: next, x: at.x - (at.x - x) * grown, y: at.y - (at.y - y) * grown });
  }

  #own() {
    const { x, y } = this.#view;
    this.#set({ scale: this.#ownScale(), x, y });
  }

  /**
   * The position of an event in the frame.
   * @param {MouseEvent} event
   */
  #place(event) {
    const box = this.#frame.getBoundingClientRect();
    return { x: (event.clientX - box.left) / box.width - 0.5, y: (event.clientY - box.top) / box.height - 0.5 };
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    // Over a fitted image, the wheel scrolls the page.
    if (!event.ctrlKey && this.#view.scale === 1) return;
    event.preventDefault();
    this.#zoom(2 ** (-event.deltaY / 200), this.#place(event));
  }

  /** @param {MouseEvent} event */
  #toggle(event) {
    if (this.#view.scale > 1) this.#set({ scale: 1, x: 0, y: 0 });
    else this.#zoom(Math.max(2, 2 * this.#ownScale()), this.#place(event));
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button) return;
    this.#pointers.set(event.pointerId, event);
    this.#frame.setPointerCapture(event.pointerId);
    this.#drag(event, event);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const other = [...this.#pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
    if (other) this.#pinch(before, event, other);
    else this.#drag(before, event);
    this.#pointers.set(event.pointerId, event);
  }

  /**
   * A place in shares of the image, from its corner.
   * @param {Place} place
   */
  #onSheet(place) {
    const { scale, x, y } = this.#view;
    return { x: (place.x - x) / scale + 0.5, y: (place.y - y) / scale + 0.5 };
  }

  /**
   * @param {PointerEvent} before
   * @param {PointerEvent} event
   */
  #drag(before, event) {
    const { scale, x, y } = this.#view;
    const [from, to] = [this.#place(before), this.#place(event)];
    if (this.#wiping) this.#listener.wipe(Math.min(1, Math.max(0, this.#onSheet(to).x)));
    else this.#set({ scale, x: x + to.x - from.x, y: y + to.y - from.y });
  }

  /**
   * @param {PointerEvent} before
   * @param {PointerEvent} event
   * @param {PointerEvent} other
   */
  #pinch(before, event, other) {
    const apart = (/** @type {PointerEvent} */ one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
    const [here, there] = [this.#place(event), this.#place(other)];
    this.#zoom(apart(event) / Math.max(1, apart(before)), { x: (here.x + there.x) / 2, y: (here.y + there.y) / 2 });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { scale, x, y } = this.#view;
    const moved = ARROWS[event.key];
    if (moved && scale > 1) this.#set({ scale, x: x + moved.x, y: y + moved.y });
    else if (event.key === "+" || event.key === "=") this.#zoom(1.5);
    else if (event.key === "-") this.#zoom(1 / 1.5);
    else if (event.key === "0") this.#set({ scale: 1, x: 0, y: 0 });
    else if (event.key === "1") this.#own();
    else if (event.key === "f") this.#listener.flip();
    else return;
    event.preventDefault();
  }
}
