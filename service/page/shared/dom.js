// Elements from data. Text is always set as text: nothing here can turn a string into markup.

const SVG = "http://www.w3.org/2000/svg";

/** An element with attributes, listeners (`onclick: …`) and children; null children are left out. */
export function h(tag, attributes = {}, ...children) {
  return dressed(document.createElement(tag), attributes, children);
}

/** The same for SVG. */
export function svg(tag, attributes = {}, ...children) {
  return dressed(document.createElementNS(SVG, tag), attributes, children);
}

function dressed(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child != null && child !== false));
  return element;
}

/** Sets an element's text where it has another: what is not touched does not flicker. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets or, where the value is null or false, removes an attribute. */
export function setAttribute(element, name, value) {
  if (value == null || value === false) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
}

/** Makes a container's children those of the items, in order, moving and making only what differs. */
export class KeyedList {
  #container;
  #make;
  #shown = new Map();

  /** `make(item)` returns an object with `element` and `update(item)`, and perhaps `remove()`. */
  constructor(container, make) {
    this.#container = container;
    this.#make = make;
  }

  show(items, keyOf) {
    const wanted = new Set(items.map(keyOf));
    for (const [key, row] of this.#shown) {
      if (wanted.has(key)) continue;
      row.remove?.();
      row.element.remove();
      this.#shown.delete(key);
    }
    let before = this.#container.firstChild;
    for (const item of items) {
      const key = keyOf(item);
      let row = this.#shown.get(key);
      if (!row) this.#shown.set(key, (row = this.#make(item)));
      row.update(item);
      if (row.element === before) before = before.nextSibling;
      else this.#container.insertBefore(row.element, before);
    }
  }
}
