// Taking part in a study: questions about the observer's seat, then the pairs. It shows no results.

import { get, send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { several } from "../shared/figures.js";
import { complain, messageOf } from "../shared/notices.js";
import { Calibration } from "./calibration.js";
import { missingRoom, runTrials } from "./trials.js";

/** @import { ScreenContext } from "../main.js" */

/**
 * @param {HTMLElement} main
 * @param {ScreenContext} context
 */
export async function open(main, { id, signal }) {
  document.title = "Take part · Plateau";
  const root = `/v1/studies/${encodeURIComponent(id)}`;
  const screen = h("article", { class: "observe" }, h("h1", { class: "unseen" }, "Take part"));
  main.append(screen);
  try {
    /** @type {Api.StudyView} */
    const study = await get(root, signal);
    const name = new URLSearchParams(location.search).get("as");
    /** @type {Api.ObserverView | "" | null} */
    const known = name && (await get(`${root}/observers/${encodeURIComponent(name)}`, signal).catch(() => null));
    if (known) ready(study, known);
    else welcome(study, name);
  } catch (error) {
    if (signal.aborted) return;
    screen.replaceChildren(h("div", { class: "nothing" }, h("h1", {}, "This study cannot be opened"), h("p", {}, messageOf(error))));
  }

  /**
   * @param {Api.StudyView} study
   * @param {string | null} name
   */
  function welcome(study, name) {
    const calibration = new Calibration();
    const pseudonym = h("input", {
      id: "pseudonym", type: "text", required: true, maxlength: 32, pattern: "[A-Za-z0-9][A-Za-z0-9_\\-]*",
      value: name ?? `o-${crypto.getRandomValues(new Uint16Array(1))[0].toString(16).padStart(4, "0")}`,
      autocomplete: "off", "aria-describedby": "pseudonym-help",
    });
    const wrong = h("p", { class: "bad", role: "alert" });
    screen.replaceChildren(
      h("h1", {}, "Do you see a difference?"),
      h("p", { class: "lead" }, `You will be shown ${several(study.trials, "pair")} of pictures. Say of each whether you see any difference between the two. Look as long as you like; there is no right answer.`),
      h("form", { class: "rest", onsubmit: submit },
        h("fieldset", {},
          h("legend", {}, "You"),
          h("div", { class: "field" }, h("label", { for: "pseudonym" }, "Pseudonym"), pseudonym,
            h("p", { class: "help", id: "pseudonym-help" }, "Choose anything but your name. With it you can continue later, at the same screen and seat. Only your answers and what you say about your screen are stored with it."))),
        calibration.element, wrong,
        h("div", { class: "send" }, h("button", { type: "submit", class: "primary large" }, "Continue"))));

    /** @param {SubmitEvent} event */
    async function submit(event) {
      event.preventDefault();
      try {
        const observer = await send("PUT", `${root}/observers/${encodeURIComponent(pseudonym.value)}`, { screen: calibration.screen });
        history.replaceState(null, "", `${location.pathname}?as=${encodeURIComponent(observer.name)}`);
        ready(study, observer);
      } catch (error) {
        setText(wrong, messageOf(error));
      }
    }
  }

  /**
   * @param {Api.StudyView} study
   * @param {Api.ObserverView} observer
   */
  function ready(study, observer) {
    const left = observer.trials.length - observer.answered.length;
    if (!left) {
      screen.replaceChildren(h("div", { class: "nothing" },
        h("h1", {}, "Thank you, that is all"),
        h("p", {}, "All your answers are saved. You may close this page.")));
      return;
    }
    const room = h("p", { class: "bad", role: "status" });
    const start = h("button", { class: "primary large" }, observer.answered.length ? "Continue" : "Begin");
    const full = h("button", { class: "large", onclick: () => document.documentElement.requestFullscreen?.().catch(() => {}) }, "Full screen");
    const look = () => {
      setText(room, missingRoom(study));
      start.disabled = room.textContent !== "";
    };
    addEventListener("resize", look, { signal });
    look();
    start.addEventListener("click", async () => {
      start.hidden = true;
      try {
        await runTrials(study, observer, signal);
      } catch (error) {
        if (signal.aborted) return;
        complain(error);
      }
      const now = await get(`${root}/observers/${encodeURIComponent(observer.name)}`, signal).catch(() => observer);
      ready(study, now);
    });
    const { viewing_distance_cm: distance } = observer.screen;
    screen.replaceChildren(
      h("h1", {}, observer.answered.length ? `Welcome back, ${observer.name}` : "Ready?"),
      h("p", { class: "lead" }, `${several(left, "pair")} to look at, from ${distance} cm.`),
      h("p", {}, "Answer with the buttons, or with the keys ", h("kbd", {}, "D"), " (a difference) and ", h("kbd", {}, "S"), " (the same). Each answer is saved at once. You may stop whenever you like, and continue here."),
      room, h("div", { class: "send" }, start, full));
    start.focus();
  }
}
