// The stopping rules as the service describes them: the fields of their forms, and the roles of their parameters.
// The other fields of a spec are described with them.

import { get } from "./api.js";
import { complain, recovered } from "./notices.js";
import { sleep } from "./polling.js";
import { describe } from "./spec_fields.js";

/** @import { FieldAbout } from "./form_fields.js" */
/** @typedef {Api.JobSpec["rule"]} Rule */
/** @typedef {FieldAbout & Required<Pick<FieldAbout, "min" | "max">> & { value: number, role: Api.ParameterRole | null }} ParameterAbout */
/** @typedef {Omit<Api.RuleView, "parameters"> & { fields: ParameterAbout[] }} RuleAbout */

const RETRY_MS = 1000;

/** All rules, in the order of the forms; empty until `meetRules` has resolved. @type {RuleAbout[]} */
export const RULES = [];

/**
 * Fetches the rules and the schema of a spec, once for all screens, and tries until it succeeds; rejects when the signal aborts.
 * @param {AbortSignal} signal
 */
export async function meetRules(signal) {
  while (!RULES.length) {
    try {
      /** @type {[Api.Rules, any]} */
      const [{ rules }, schema] = await Promise.all([get("/v1/rules", signal), get("/v1/spec", signal)]);
      describe(schema);
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
 * A parameter as a field of a form; `min`, `max` and `value` are those of the spec.
 * @param {Api.ParameterView} parameter
 * @returns {ParameterAbout}
 */
function field({ name, label, unit, help, scale, role, default: value, least: min, most: max, whole }) {
  return { name, label, unit, help, scale, role, value, min, max, step: whole ? 1 : "any" };
}

/**
 * The rule of this name; undefined if the service has none.
 * @param {string} wanted
 */
export function ruleNamed(wanted) {
  return RULES.find(({ name }) => name === wanted);
}

/**
 * The value of a job's rule in this role; null if it has none.
 * @param {Api.ParameterRole} role
 * @param {Rule} rule
 */
export function valueIn(role, rule) {
  const found = ruleNamed(rule.name)?.fields.find((one) => one.role === role);
  const { name: _name, ...parameters } = rule;
  return found ? /** @type {Record<string, number>} */ (parameters)[found.name] ?? null : null;
}
