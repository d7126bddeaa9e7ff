// Messages to the user: what was done, and what is wrong.

import { byId, setText } from "./dom.js";

/**
 * Announces a text to screen readers.
 * @param {string} text
 */
export function say(text) {
  setText(byId("said"), text);
}

/** Whether the shown error answers a user's action; it stays, since the user may not have read it yet. */
let lasting = false;

/**
 * Shows an error at the foot of the window; "" removes it.
 * @param {unknown} wrong - an error, or a text
 */
export function complain(wrong, lasts = false) {
  lasting = lasts;
  const place = byId("trouble");
  setText(place, messageOf(wrong));
  place.hidden = !place.textContent;
}

/** Removes the error, unless it answers a user's action. */
export function recovered() {
  if (!lasting) complain("");
}

/**
 * The message of an error.
 * @param {unknown} error
 */
export function messageOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/**
 * Does something and announces it, or shows the error.
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
