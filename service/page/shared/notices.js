// What the page tells its reader: what was done, and what is wrong.

import { byId, setText } from "./dom.js";

/**
 * Tells screen readers something, politely.
 * @param {string} text
 */
export function say(text) {
  setText(byId("said"), text);
}

/** Whether what is shown answers something that a person asked for; they may not have read it yet. */
let lasting = false;

/**
 * Shows what is wrong at the foot of the window; "" when all is well again.
 * @param {unknown} wrong - an error, or a text
 */
export function complain(wrong, lasts = false) {
  lasting = lasts;
  const place = byId("trouble");
  setText(place, messageOf(wrong));
  place.hidden = !place.textContent;
}

/** Takes away what is wrong, now that all is well, unless it answers what somebody asked for. */
export function recovered() {
  if (!lasting) complain("");
}

/**
 * What an error says.
 * @param {unknown} error
 */
export function messageOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/**
 * Does something and says so; what the API refuses is shown in its words.
 * @param {() => Promise<unknown>} work
 * @param {string} done
 * @param {() => unknown} refresh
 */
export async function attempt(work, done, refresh) {
  try {
    await work();
    say(done);
    complain("");
    await refresh();
  } catch (error) {
    complain(error, true);
  }
}
