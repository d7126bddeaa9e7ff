// The trials of a study: pairs of pictures, each with one question.

import { bytes, Problem, send } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { complain, messageOf, say } from "../shared/notices.js";
import { decoded } from "../shared/picture.js";
import { sleep } from "../shared/polling.js";

/** The screen is empty between two pairs, so that flicker reveals nothing. */
const EMPTY_MS = 400;
const AGAIN_MS = 1500;
const GAP_PX = 32;
const CONTROLS_PX = 195;

/**
 * Shows the pairs without an answer; resolves when all have one, or the observer stops for now.
 * @param {Api.StudyView} study
 * @param {Api.ObserverView} observer
 * @param {AbortSignal} signal
 */
export async function runTrials(study, observer, signal) {
  const left = observer.trials.filter(({ trial }) => !observer.answered.includes(trial));
  const pictures = await fetchAll(left, signal);
  const stage = new Pairs(study, signal);
  const rest = document.querySelectorAll(".top, #main");
  for (const one of rest) one.toggleAttribute("inert", true);
  document.body.append(stage.element);
  try {
    for (const trial of left) {
      stage.empty(`${trial.trial + 1} of ${observer.trials.length}`);
      await sleep(EMPTY_MS, signal);
      const answer = await stage.show(pictures.get(trial.left) ?? "", pictures.get(trial.right) ?? "");
      if (!answer) return;
      await keep(`/v1/studies/${study.id}/observers/${observer.name}/answers/${trial.trial}`, answer, signal);
    }
  } finally {
    stage.element.remove();
    for (const one of rest) one.toggleAttribute("inert", false);
    for (const url of pictures.values()) URL.revokeObjectURL(url);
  }
}

/**
 * A message if both pictures do not fit into the window pixel by pixel; "" if they do.
 * @param {Api.StudyView} study
 */
export function missingRoom({ width, height }) {
  const needs = [(2 * width) / devicePixelRatio + 3 * GAP_PX, height / devicePixelRatio + CONTROLS_PX].map(Math.ceil);
  if (needs[0] <= innerWidth && needs[1] <= innerHeight) return "";
  return `Both pictures side by side need a window of ${needs[0]} × ${needs[1]}, and this one has ${innerWidth} × ${innerHeight}. Make the window larger, or use a larger screen: smaller pictures would hide the differences.`;
}

/**
 * @param {Api.Trial[]} trials
 * @param {AbortSignal} signal
 */
async function fetchAll(trials, signal) {
  const paths = [...new Set(trials.flatMap(({ left, right }) => [left, right]))];
  /** @type {Map<string, string>} */
  const found = new Map();
  for (const path of paths) {
    const { blob } = await bytes(path, signal);
    found.set(path, await decoded(blob));
  }
  return found;
}

/**
 * Sends an answer until it is stored; sending it twice is harmless.
 * @param {string} path
 * @param {Api.NewAnswer} answer
 * @param {AbortSignal} signal
 */
async function keep(path, answer, signal) {
  for (;;) {
    try {
      await send("PUT", path, answer);
      complain("");
      return;
    } catch (error) {
      if (signal.aborted) throw error;
      if (error instanceof Problem && error.status < 500 && error.status !== 429) throw error;
      complain(`Your answer is not saved yet, and is sent again. ${messageOf(error)}`);
    }
    await sleep(AGAIN_MS, signal);
  }
}

class Pairs {
  #left = h("img", { alt: "The left picture" });
  #right = h("img", { alt: "The right picture" });
  #pair = h("div", { class: "pair-shown" }, this.#left, this.#right);
  #count = h("p", { class: "pair-count" });
  #seen = h("button", { class: "large" }, "I see a difference ", h("kbd", {}, "D"));
  #same = h("button", { class: "large" }, "I don't ", h("kbd", {}, "S"));
  #stop = h("button", { class: "pair-stop" }, "Stop for now");
  #signal;
  element;

  /**
   * @param {Api.StudyView} study
   * @param {AbortSignal} signal
   */
  constructor({ width, height }, signal) {
    this.#signal = signal;
    for (const image of [this.#left, this.#right]) {
      // A pixel of the picture is a pixel of the screen.
      image.style.width = `${width / devicePixelRatio}px`;
      image.style.height = `${height / devicePixelRatio}px`;
    }
    this.element = h("section", { class: "observing", "aria-label": "Two pictures" },
      this.#pair, h("div", { class: "pair-answers" }, this.#seen, this.#same), this.#count, this.#stop);
  }

  /** @param {string} count */
  empty(count) {
    setText(this.#count, count);
    this.#pair.classList.add("empty");
    for (const button of [this.#seen, this.#same, this.#stop]) button.disabled = true;
  }

  /**
   * Shows a pair; resolves to the answer, or to null if the observer stops for now.
   * @param {string} left
   * @param {string} right
   * @returns {Promise<Api.NewAnswer | null>}
   */
  async show(left, right) {
    this.#left.src = left;
    this.#right.src = right;
    await Promise.all([this.#left.decode(), this.#right.decode()]);
    this.#pair.classList.remove("empty");
    for (const button of [this.#seen, this.#same, this.#stop]) button.disabled = false;
    say(`Pair ${this.#count.textContent}`);
    const started = performance.now();
    return new Promise((resolve, reject) => {
      const over = new AbortController();
      const answered = (/** @type {boolean} */ seen) => {
        over.abort();
        this.empty(this.#count.textContent ?? "");
        resolve({ seen, seconds: Math.round(performance.now() - started) / 1000 });
      };
      const options = { signal: over.signal };
      this.#seen.addEventListener("click", () => answered(true), options);
      this.#same.addEventListener("click", () => answered(false), options);
      document.addEventListener("keydown", (event) => {
        if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
        const key = event.key.toLowerCase();
        if (key === "d" || key === "s") answered(key === "d");
      }, options);
      this.#stop.addEventListener("click", () => { over.abort(); resolve(null); }, options);
      this.#signal.addEventListener("abort", () => { over.abort(); reject(this.#signal.reason); }, options);
    });
  }
}
