// Elements from data. Text is always set as text, so no string can become markup.

/** @typedef {Node | string | null | undefined | false} Child  null, undefined and false are left out */
/** @typedef {{ [Name in keyof GlobalEventHandlersEventMap as `on${Name}`]?:
 *   (event: GlobalEventHandlersEventMap[Name]) => unknown }} Listeners */
/** @typedef {Listeners & Record<string,
 *   string | number | boolean | null | undefined | ((event: any) => unknown)>} Attributes */

const SVG = "http://www.w3.org/2000/svg";

/**
 * An element with attributes, listeners (`onclick: …`) and children.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Attributes} attributes
 * @param {(Child | Child[])[]} children
 */
export function h(tag, attributes = {}, ...children) {
  return dressed(document.createElement(tag), attributes, children);
}

/**
 * The same for SVG.
 * @template {keyof SVGElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Attributes} attributes
 * @param {(Child | Child[])[]} children
 */
export function svg(tag, attributes = {}, ...children) {
  return dressed(document.createElementNS(SVG, tag), attributes, children);
}

/**
 * @template {Element} Dressed
 * @param {Dressed} element
 * @param {Attributes} attributes
 * @param {(Child | Child[])[]} children
 */
function dressed(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    else setAttribute(element, name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child != null && child !== false));
  return element;
}

/**
 * A button whose text is a sign; its meaning is the tooltip and the accessible name.
 * @param {string} sign
 * @param {string} meaning
 * @param {() => void} act
 */
export function signButton(sign, meaning, act) {
  return h("button", { class: "quiet", "aria-label": meaning, title: meaning, onclick: act }, sign);
}

/**
 * An element of index.html.
 * @param {string} id
 */
export function byId(id) {
  return /** @type {HTMLElement} */ (document.getElementById(id));
}

/**
 * Sets an element's text if it differs, so that unchanged elements do not flicker.
 * @param {Element} element
 * @param {string} text
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Sets an attribute, or removes it if the value is null or false.
 * @param {Element} element
 * @param {string} name
 * @param {string | number | false | null | undefined} value
 */
export function setAttribute(element, name, value) {
  if (value == null || value === false) element.removeAttribute(name);
  else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, String(value));
}

/**
 * Keeps a container's children in step with a list of items, and makes and moves only what differs.
 * @template Item
 */
export class KeyedList {
  #container;
  #make;
  /** @type {Map<string, Row<Item>>} */
  #shown = new Map();

  /**
   * @template Item
   * @typedef {{ element: Element, update(item: Item): void, remove?(): void }} Row
   */

  /**
   * @param {Element} container
   * @param {(item: Item) => Row<Item>} make
   */
  constructor(container, make) {
    this.#container = container;
    this.#make = make;
  }

  /** Removes all that is shown. */
  clear() {
    this.show([], String);
  }

  /**
   * @param {Item[]} items
   * @param {(item: Item) => string} keyOf
   */
  show(items, keyOf) {
    const wanted = new Set(items.map(keyOf));
    for (const [key, row] of this.#shown) {
      if (wanted.has(key)) continue;
      row.remove?.();
      row.element.remove();
      this.#shown.delete(key);
    }
    /** @type {Node | null} */
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
