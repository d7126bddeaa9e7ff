// What the page tells its reader: what was done, and what is wrong.

import { setText } from "./dom.js";

/** Tells screen readers something, politely. */
export function say(text) {
  setText(document.getElementById("said"), text);
}

/** Whether what is shown answers something that a person asked for; they may not have read it yet. */
let lasting = false;

/** Shows what is wrong at the foot of the window; "" when all is well again. */
export function complain(text, lasts = false) {
  lasting = lasts;
  const place = document.getElementById("trouble");
  setText(place, text);
  place.hidden = !text;
}

/** Takes away what is wrong, now that all is well, unless it answers what somebody asked for. */
export function recovered() {
  if (!lasting) complain("");
}

/** Does something and says so; what the API refuses is shown in its words. */
export async function attempt(work, done, refresh) {
  try {
    await work();
    say(done);
    complain("");
    await refresh();
  } catch (error) {
    complain(error.message, true);
  }
}
