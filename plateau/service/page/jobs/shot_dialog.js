// The dialog of a batch that is a shot: how good it is in motion, its frames one by one, and its film.

import { get, isProblem } from "../shared/api.js";
import { openDialog } from "../shared/dialogs.js";
import { h, setText, svg } from "../shared/dom.js";
import { whole } from "../shared/figures.js";
import { messageOf } from "../shared/notices.js";
import { Picture } from "../shared/picture.js";
import { repeat } from "../shared/polling.js";

const EVERY_MS = 2000;
/** The service reads the image of each frame for a film. */
const FILM_EVERY_MS = 30_000;
const HEIGHT = 72;
const WIDTH = 480;
/** JOD at the bottom of the strip. */
const LEAST = 5;

/** @type {Record<string, string>} */
const STATES = {
  rendering: "Its frames are being rendered", judging: "It is being judged", good: "Each moment of it is good enough",
  short: "Frames reached their caps before each moment of it was good enough", judged: "It was judged",
  "not judged": "It was not judged",
};

/**
 * Opens the dialog.
 * @param {string} batch
 * @param {(id: string) => string} nameOf - the name of a job
 */
export function showShot(batch, nameOf) {
  const path = `/v1/batches/${encodeURIComponent(batch)}/shot`;
  const over = new AbortController();
  const words = h("div", { class: "told" }, h("p", {}, "Looking …"));
  const strip = h("div", { class: "strip" });
  const wrong = h("p", { class: "bad", role: "alert" });
  const film = new Shown("The film of its newest images");
  const map = new Shown("Where noise is seen in motion: not in dark blue, and most in yellow");
  const legend = h("p", { class: "help" }, `Bars are the samples of each frame, pale while it waits, dotted what it is to have. The line is the quality at its moment, from ${LEAST} to 10 JOD, dashed the target.`);
  const dialog = openDialog(`${batch} as a shot`, { method: "dialog" }, words, strip, legend,
    h("div", { class: "pictures" }, film.element, map.element), wrong,
    h("div", { class: "answers" }, h("button", { autofocus: true }, "Close")));
  dialog.classList.add("wide");
  dialog.addEventListener("close", () => {
    over.abort();
    film.picture.letGo();
    map.picture.letGo();
  });
  let before = "", filmed = "";

  async function refresh() {
    try {
      /** @type {Api.ShotView} */
      const shot = await get(path, over.signal);
      const now = JSON.stringify(shot);
      if (now !== before) {
        before = now;
        words.replaceChildren(...told(shot));
        const at = strip.contains(document.activeElement) && document.activeElement?.getAttribute("href");
        strip.replaceChildren(stripOf(shot, nameOf, () => dialog.close()));
        if (at) /** @type {SVGElement | null} */ (strip.querySelector(`a[href="${at}"]`))?.focus();
      }
      const turn = `${shot.state} ${Math.floor(Date.now() / FILM_EVERY_MS)}`;
      if (turn !== filmed && shot.by_frame.some(({ spp }) => spp)) {
        if (await film.show(shot.links.film, over.signal)) filmed = turn;
      }
      if (shot.looks) await map.show(shot.links.flicker, over.signal);
      setText(wrong, "");
    } catch (error) {
      if (!over.signal.aborted) setText(wrong, messageOf(error));
    }
  }
  repeat(refresh, () => EVERY_MS, over.signal);
}

/** A picture with words under it, hidden until there is one. */
class Shown {
  #image = h("img", { alt: "" });

  /** @param {string} about */
  constructor(about) {
    this.#image.alt = about;
    this.picture = new Picture(this.#image);
    this.element = h("figure", { hidden: true }, this.#image, h("figcaption", {}, about));
  }

  /**
   * @param {string} path
   * @param {AbortSignal} signal
   */
  async show(path, signal) {
    try {
      await this.picture.show(path, signal);
      this.element.hidden = false;
      return true;
    } catch (error) {
      if (!isProblem(error, "no-image-yet")) throw error;
      return false;
    }
  }
}

/** @param {Api.ShotView} shot */
function told(shot) {
  const { frames, fps, state, waiting, jod, low_moment_jod: low, worst_frame: worst, target, why } = shot;
  const judged = jod == null || low == null
    ? "It is judged as a video once all of its frames have been stopped by their own rules."
    : `In motion it has an estimated ${jod.toFixed(2)} JOD against the converged shot, and surely ${low.toFixed(2)} at its worst moment, in which frame ${worst} is seen most.`;
  const goal = target == null ? "" : ` Each moment is to have ${target}.`;
  const waits = state === "rendering" ? `: ${waiting} of ${frames} wait to be judged` : "";
  return [
    h("p", {}, `${frames} frames at ${fps} per second. ${STATES[state] ?? state}${waits}.`),
    h("p", {}, `${judged}${goal}`),
    h("p", { class: "help" }, "10 JOD: nobody sees a difference. 9: three of four people prefer the converged shot."),
    ...(state === "not judged" ? [h("p", { class: "bad" }, why)] : []),
  ];
}

/**
 * The frames side by side: a bar for the samples of each, and a line of the quality while it is seen.
 * @param {Api.ShotView} shot
 * @param {(id: string) => string} nameOf
 * @param {() => void} close
 */
function stripOf(shot, nameOf, close) {
  const last = shot.judged.at(-1);
  const step = WIDTH / shot.frames;
  const most = Math.max(1, ...shot.by_frame.map((frame) => frame.needs_spp ?? frame.spp));
  const y = (/** @type {number} */ jod) => HEIGHT * (1 - (Math.max(jod, LEAST) - LEAST) / (10 - LEAST));
  const bars = shot.by_frame.map((frame, place) => {
    const tall = HEIGHT * (frame.spp / most);
    const asked = HEIGHT * ((frame.needs_spp ?? 0) / most);
    const about = said(frame, place, last, nameOf(frame.job));
    return svg("a", { href: `/jobs/${frame.job}`, "aria-label": about, onclick: close },
      svg("title", {}, about),
      svg("rect", { class: "space", x: place * step, y: 0, width: step, height: HEIGHT }),
      svg("rect", { class: "asked-bar", x: place * step, y: HEIGHT - asked, width: step * 0.85, height: asked }),
      svg("rect", { class: frame.waits ? "bar waits" : "bar", x: place * step, y: HEIGHT - tall, width: step * 0.85, height: tall }));
  });
  const line = last && last.low_frames.map((jod, place) => `${(place + 0.43) * step} ${y(jod)}`).join("L");
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": "Its frames, in their order" }, bars,
    shot.target != null && svg("path", { class: "goal", d: `M0 ${y(shot.target)}H${WIDTH}` }),
    line && svg("path", { class: "quality", d: `M${line}` }));
}

/**
 * @param {Api.ShotFrame} frame
 * @param {number} place
 * @param {Api.ShotLook | undefined} last
 * @param {string} name
 */
function said({ spp, waits, needs_spp: needs }, place, last, name) {
  const quality = last ? `, ${last.low_frames[place].toFixed(2)} JOD at its moment` : "";
  const asked = needs != null && needs > spp ? `, is to have ${whole(needs)}` : "";
  return `${name}, frame ${place}: ${whole(spp)} spp${asked}${quality}${waits ? ", waits" : ""}`;
}
