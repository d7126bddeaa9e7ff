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

/** Tells screen readers something, politely. */
export function say(text) {
  setText(document.getElementById("said"), text);
}

/** Whether what is wrong is what somebody asked for: they may not have read it as the next look goes well. */
let lasting = false;

/** Shows what is wrong at the foot of the window; "" when all is well again. */
export function complain(text, lasts = false) {
  lasting = lasts;
  const place = document.getElementById("trouble");
  setText(place, text);
  place.hidden = !text;
}

/** Asks a question with two answers; resolves to whether it was confirmed. */
export function confirmed(question, explanation, yes, no = "Keep it") {
  return new Promise((resolve) => {
    const dialog = h(
      "dialog",
      { class: "ask", "aria-labelledby": "question", onclose: close },
      h("form", { method: "dialog" },
        h("h2", { id: "question" }, question),
        h("p", {}, explanation),
        h("div", { class: "answers" },
          h("button", { value: "no", autofocus: true }, no),
          h("button", { value: "yes", class: "primary" }, yes))),
    );
    function close() {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    }
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** Resolves after so many milliseconds; rejects when the signal aborts. */
export function sleep(ms, signal) {
  return new Promise((resolve, reject) => {
    if (signal.aborted) { reject(signal.reason); return; }
    const timer = setTimeout(resolve, ms);
    signal.addEventListener("abort", () => { clearTimeout(timer); reject(signal.reason); }, { once: true });
  });
}

/** Calls `work` again and again, `everyMs()` apart, while the page can be seen. */
export async function repeat(work, everyMs, signal) {
  while (!signal.aborted) {
    try {
      await work();
      if (!lasting) complain("");
    } catch (error) {
      if (signal.aborted) return;
      complain(error.message);
    }
    try {
      await sleep(everyMs(), signal);
      while (document.hidden) await sleep(300, signal);
    } catch {
      return;
    }
  }
}
