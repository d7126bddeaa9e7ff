// What can be done to a job: pause, resume, cancel, and its priority.

import { send } from "./api.js";
import { complain, confirmed, h, say, setAttribute } from "./dom.js";
import { showGuard } from "./guard.js";
import { maySteer, maySubmit } from "./me.js";
import { PRIORITY } from "./rules.js";
import { ENDED, title, whole } from "./words.js";

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

/** The buttons for a job in its state, `jobNow()` how it is when one is pressed; none where it has ended. */
export function controls(jobNow, refresh, close = () => {}) {
  const job = jobNow();
  if (ENDED.has(job.state) || !maySteer(job)) return [];
  const move = (path, done) => () => {
    close();
    return attempt(() => send("POST", path), done, refresh);
  };
  const name = title(job);
  const found = [];
  if (job.state === "rendering") {
    found.push(h("button", { onclick: move(job.links.pause, `${name} is paused`) }, "Pause"));
  }
  if (job.state === "paused") {
    found.push(h("button", { onclick: move(job.links.resume, `${name} goes on`) }, "Resume"));
  }
  found.push(h("button", { class: "danger", onclick: cancel }, "Cancel"));
  async function cancel() {
    close();
    const { committed_spp: spp } = jobNow();
    const kept = spp
      ? `It keeps the image that it has by then, at ${whole(spp)} spp or a little more.`
      : "No slice of it has been rendered yet, so it will have no image.";
    if (await confirmed(`Cancel ${name}?`, kept, "Cancel the job")) {
      await attempt(() => send("POST", job.links.cancel), `${name} is cancelled`, refresh);
    }
  }
  const input = h("input", {
    type: "number", ...PRIORITY, value: job.spec.priority, "aria-label": "Priority",
  });
  found.push(h("form", { class: "priority", onsubmit: prioritise },
    h("label", {}, "Priority ", input), h("button", {}, "Set")));
  function prioritise(event) {
    event.preventDefault();
    close();
    const priority = Number(input.value);
    attempt(() => send("PATCH", job.links.self, { priority }), `${name} has priority ${priority}`, refresh);
  }
  return found;
}

/** A menu of what can be done to a job of the list. */
export function jobMenu(jobNow, refresh) {
  return menuButton(
    (close) => {
      const found = controls(jobNow, refresh, close);
      if (found.length) return found;
      const { state, owner_name: owner } = jobNow();
      return [h("p", {}, ENDED.has(state) ? `It has ended: ${state}.` : `It is ${owner ? `${owner}'s` : "nobody's"}, and your key may not change it.`)];
    });
}

/** A menu of what can be done to a whole batch; `nameOf(id)` is what its jobs are called. */
export function batchMenu(batch, jobsNow, nameOf, refresh) {
  const menu = menuButton(
    (close) => {
      const states = new Set(jobsNow().filter((job) => !ENDED.has(job.state)).map((job) => job.state));
      const guard = h("button", { onclick: () => { close(); showGuard(batch, nameOf); } }, "Will it flicker?");
      if (!states.size) return [h("p", {}, "All its jobs have ended."), guard];
      if (!maySubmit()) return [guard];
      const all = (what) => send("POST", `/v1/batches/${encodeURIComponent(batch)}/${what}`);
      const button = (text, what, done) => h("button", { onclick: () => {
        close();
        return attempt(() => all(what), done, refresh);
      } }, text);
      return [
        states.has("rendering") && button("Pause all", "pause", `${batch} is paused`),
        states.has("paused") && button("Resume all", "resume", `${batch} goes on`),
        h("button", { class: "danger", onclick: async () => {
          close();
          const kept = "Jobs that are being rendered keep the image that they have by then.";
          if (await confirmed(`Cancel all jobs of ${batch}?`, kept, "Cancel them all", "Keep them")) {
            await attempt(() => all("cancel"), `${batch} is cancelled`, refresh);
          }
        } }, "Cancel all"),
        guard,
      ];
    });
  menu.name(`Actions for the batch ${batch}`);
  return menu;
}

/** A button with a menu that is filled when it opens: its `element`, and `name(text)` to say whose it is. */
function menuButton(fill) {
  const menu = h("div", { class: "menu", popover: "auto" });
  const button = h("button", { class: "quiet dots", "aria-haspopup": "true", "aria-expanded": "false" }, "⋯");
  button.popoverTargetElement = menu;
  menu.addEventListener("beforetoggle", (event) => {
    button.setAttribute("aria-expanded", String(event.newState === "open"));
    if (event.newState !== "open") return;
    menu.replaceChildren(...fill(() => menu.hidePopover()).filter(Boolean));
    const place = button.getBoundingClientRect();
    menu.style.top = `${place.bottom + scrollY + 4}px`;
    menu.style.right = `${Math.max(8, document.documentElement.clientWidth - place.right)}px`;
  });
  return {
    element: h("div", { class: "actions" }, button, menu),
    name: (text) => setAttribute(button, "aria-label", text),
  };
}
