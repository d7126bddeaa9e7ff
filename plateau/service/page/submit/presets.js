// How good an image is to be, in a word: rules with parameters, and what they mean for this scene.

import { isAbort } from "../shared/api.js";
import { h, setText } from "../shared/dom.js";
import { roughly, whole } from "../shared/figures.js";
import { messageOf, say } from "../shared/notices.js";
import { ruleNamed } from "../shared/rules.js";
import { PROBE_S, probe } from "./probe.js";

/** @import { AskedRule, Expected } from "./probe.js" */

/** From the least samples to the most. @type {{ title: string, help: string, rule: AskedRule }[]} */
const PRESETS = [
  { title: "Draft", help: "Framing and light can be judged: noise may be seen in 1 % of the pixels.",
    rule: { name: "visible", target: 0.01, min_spp: 32 } },
  { title: "Final", help: "What jobs do by default: hardly a pixel has noise that a person could see.",
    rule: { name: "visible" } },
  { title: "To the eye's limit", help: "At most a tenth of a JOD from the converged image, by ColorVideoVDP: side by side, people can only guess.",
    rule: { name: "jod", target: 9.9 } },
];

export class Presets {
  #take;
  #ask;
  #signal;
  /** @type {AbortController | null} */
  #probing = null;
  #offered = PRESETS.filter(({ rule }) => ruleNamed(rule.name)).map((preset) => ({
    ...preset, takes: h("span", { class: "takes" }),
  }));
  #button = h("button", { type: "button", onclick: () => this.#toggle() });
  #said = h("p", { class: "hint", role: "status" });
  element;

  /**
   * @param {(rule: AskedRule) => void} take - called with the rule of a preset
   * @param {() => { form: (spec: object) => FormData, spec: { max_spp: number } & object }} ask - what a probe renders
   * @param {AbortSignal} signal
   */
  constructor(take, ask, signal) {
    this.#take = take;
    this.#ask = ask;
    this.#signal = signal;
    this.element = h("div", { class: "presets" },
      h("div", { class: "offered", role: "group", "aria-label": "Presets" }, this.#offered.map(({ title, help, rule, takes }) =>
        h("button", { type: "button", onclick: () => { this.#take(rule); say(`${title}: the rule below is set`); } },
          h("b", {}, title), h("span", { class: "help" }, help), takes))),
      h("p", { class: "send" }, this.#button, this.#said));
    this.#label();
  }

  /** Forgets what a probe has told: of another scene, or of other parameters. */
  forget() {
    this.#probing?.abort();
    for (const { takes } of this.#offered) setText(takes, "");
    setText(this.#said, "");
  }

  #label() {
    setText(this.#button, this.#probing ? "Stop the probe" : `Render for ${PROBE_S} s to estimate the times`);
  }

  #toggle() {
    if (this.#probing) this.#probing.abort();
    else this.#probe();
  }

  async #probe() {
    const probing = (this.#probing = new AbortController());
    this.#label();
    setText(this.#said, "A small job renders the scene, and is deleted afterwards …");
    const { form, spec } = this.#ask();
    const rules = this.#offered.map(({ rule }) => rule);
    try {
      const found = await probe(form, spec, rules, AbortSignal.any([probing.signal, this.#signal]));
      this.#offered.forEach(({ takes }, at) => setText(takes, inWords(found[at], spec.max_spp)));
      setText(this.#said, "At the pace of the probe, with the workers that rendered it; with more of them it takes less.");
    } catch (error) {
      setText(this.#said, isAbort(error) ? "" : messageOf(error));
    }
    this.#probing = null;
    this.#label();
  }
}

/**
 * @param {Expected} expected
 * @param {number} cap
 */
function inWords(expected, cap) {
  if (!expected) return `no estimate after ${PROBE_S} s`;
  const { spp, seconds } = expected;
  const much = `about ${whole(Number(spp.toPrecision(2)))} spp, ${roughly(seconds)}`;
  return spp > cap ? `${much}: beyond the cap of ${whole(cap)}` : much;
}
