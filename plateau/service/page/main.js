// The router: the path determines the screen, and links between screens load no page.

import { extensions } from "./extensions.js";
import { forgetKey, hasKey } from "./shared/api_key.js";
import { byId, h, setAttribute } from "./shared/dom.js";
import { complain } from "./shared/notices.js";
import { maySubmit, meetMe } from "./shared/permissions.js";
import * as job from "./job/job_screen.js";
import * as jobs from "./jobs/jobs_screen.js";
import * as submit from "./submit/submit_screen.js";
import * as workers from "./workers/workers_screen.js";

/** @typedef {(main: HTMLElement, context: ScreenContext) => void | Promise<void>} Screen  shows a screen in an empty element */
/** @typedef {{ id: string, signal: AbortSignal, go: (path: string) => void }} ScreenContext
 *   the id in the path, a signal that aborts when the screen is left, and the way to another screen */

/** @type {[path: RegExp, name: string, screen: { open: Screen }][]} */
const SCREENS = [
  [/^\/$/, "jobs", jobs],
  [/^\/submit$/, "submit", submit],
  [/^\/workers$/, "workers", workers],
  [/^\/jobs\/([^/]+)$/, "job", job],
  ...extensions.flatMap(({ screens }) => screens),
];

/** What is shown where no screen is. */
const NOWHERE = {
  /** @param {HTMLElement} main */
  open(main) {
    document.title = "Not found · Plateau";
    main.append(h("div", { class: "nothing" },
      h("h1", {}, "There is nothing here"),
      h("p", {}, `No page of this farm is at ${location.pathname}.`),
      h("a", { class: "button primary", href: "/" }, "Show the jobs")));
  },
};

for (const href of extensions.flatMap(({ styles }) => styles)) document.head.append(h("link", { rel: "stylesheet", href }));
byId("screens").append(...extensions.flatMap(({ links }) => links)
  .map(({ href, screen, text }) => h("a", { href, "data-screen": screen }, text)));

const main = byId("main");
let leaving = new AbortController();

/** @param {{ focus: boolean }} how */
function open({ focus }) {
  leaving.abort();
  leaving = new AbortController();
  complain("");
  // Questions of the screen that is left; the one for the key is everybody's.
  for (const dialog of document.querySelectorAll("dialog")) if (!dialog.querySelector("#key")) dialog.close();
  main.replaceChildren();
  const [path, name, screen] = SCREENS.find(([path]) => path.test(location.pathname)) ?? [/^/, "nowhere", NOWHERE];
  for (const link of document.querySelectorAll("a[data-screen]")) {
    setAttribute(link, "aria-current", link.getAttribute("data-screen") === name ? "page" : null);
  }
  const id = path.exec(location.pathname)?.[1] ?? "";
  screen.open(main, { id, signal: leaving.signal, go });
  if (focus) {
    scrollTo(0, 0);
    main.focus({ preventScroll: true });
  }
}

/**
 * Goes to another screen.
 * @param {string} path
 */
function go(path) {
  // Where one was, for when one comes back; the same address again is no step of its own.
  history.replaceState({ ...history.state, top: scrollY, focus: document.activeElement?.getAttribute("href") }, "");
  history[path === location.pathname + location.search ? "replaceState" : "pushState"](null, "", path);
  open({ focus: true });
}

document.addEventListener("click", (event) => {
  const link = event.target instanceof Element ? event.target.closest("a") : null;
  if (!link?.href || event.defaultPrevented || event.button || event.metaKey || event.ctrlKey || event.shiftKey) return;
  const there = new URL(link.getAttribute("href") ?? "", location.href);
  if (there.hash === "#main") { event.preventDefault(); main.focus(); return; }
  const ours = SCREENS.some(([path]) => path.test(there.pathname));
  if (there.origin !== location.origin || !ours || there.hash || link.hasAttribute("download")) return;
  event.preventDefault();
  go(there.pathname + there.search);
});
addEventListener("popstate", () => open({ focus: true }));

// A file that is dropped beside its target would replace the page.
for (const type of ["dragover", "drop"]) addEventListener(type, (event) => event.preventDefault());

const forget = byId("forget-key");
forget.addEventListener("click", () => {
  forgetKey();
  location.reload();
});

async function meet() {
  forget.hidden = !hasKey();
  if (!(await meetMe())) setTimeout(meet, 5000);
  byId("submit").hidden = !maySubmit();
}

document.addEventListener("plateau-key", meet);
meet();
open({ focus: false });
