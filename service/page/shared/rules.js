// The stopping rules as the service describes them: the fields of a form, and what a parameter means beyond its rule.

import { get } from "./api.js";
import { complain, recovered } from "./notices.js";
import { sleep } from "./polling.js";

/** @import { FieldAbout } from "./form_fields.js" */
/** @typedef {Api.JobSpec["rule"]} Rule */
/** @typedef {FieldAbout & Required<Pick<FieldAbout, "min" | "max">> & { value: number, role: Api.ParameterRole | null }} ParameterAbout */
/** @typedef {Omit<Api.RuleView, "parameters"> & { fields: ParameterAbout[] }} RuleAbout */

const RETRY_MS = 1000;

/**
 * Every rule, in the order in which to offer them; empty until `meetRules` has resolved.
 * @type {RuleAbout[]}
 */
export const RULES = [];

/**
 * Asks the service for its rules, until it has answered; once for all screens; rejects when the signal aborts.
 * @param {AbortSignal} signal
 */
export async function meetRules(signal) {
  while (!RULES.length) {
    try {
      /** @type {Api.Rules} */
      const { rules } = await get("/v1/rules", signal);
      RULES.splice(0, RULES.length, ...rules.map(({ parameters, ...rule }) => ({ ...rule, fields: parameters.map(field) })));
      recovered();
    } catch (error) {
      if (signal.aborted) throw error;
      complain(error);
      await sleep(RETRY_MS, signal);
    }
  }
}

/**
 * A parameter as a field of a form: `min`, `max` and `value` are the spec's own, a form shows them over `scale`.
 * @param {Api.ParameterView} parameter
 * @returns {ParameterAbout}
 */
function field({ name, label, unit, help, scale, role, default: value, least: min, most: max, whole }) {
  return { name, label, unit, help, scale, role, value, min, max, step: whole ? 1 : "any" };
}

/**
 * The rule of this name; undefined where the service had none when the page was opened.
 * @param {string} wanted
 */
export function ruleNamed(wanted) {
  return RULES.find(({ name }) => name === wanted);
}

/**
 * The field of a rule whose parameter has this role; undefined where it has none.
 * @param {Api.ParameterRole} role
 * @param {{ name: string }} rule
 */
export function fieldIn(role, rule) {
  return ruleNamed(rule.name)?.fields.find((one) => one.role === role);
}

/**
 * What a job's rule has in this role; null where it has nothing.
 * @param {Api.ParameterRole} role
 * @param {Rule} rule
 */
export function valueIn(role, rule) {
  const found = fieldIn(role, rule);
  return found ? parametersOf(rule)[found.name] ?? null : null;
}

/**
 * The parameters of a job's rule, whichever rule it is.
 * @param {Rule} rule
 * @returns {Record<string, number>}
 */
export function parametersOf({ name: _name, ...parameters }) {
  return parameters;
}

/**
 * The rules that say something when they are watched: one that stops at a number of samples does not.
 * @template {{ name: string }} Named
 * @param {Named[]} rules
 */
export function watchable(rules) {
  return rules.filter((rule) => !fieldIn("end_spp", rule));
}
