// The stopping rules as the service describes them: the fields of a form, and what a parameter means beyond its rule.

import { get } from "./api.js";
import { complain, recovered } from "./notices.js";
import { sleep } from "./polling.js";

const RETRY_MS = 1000;

/** Every rule, in the order in which to offer them; empty until `meetRules` has resolved. */
export const RULES = [];

/** Asks the service for its rules, until it has answered; once for all screens. */
export async function meetRules(signal) {
  while (!RULES.length) {
    try {
      const { rules } = await get("/v1/rules", signal);
      RULES.splice(0, RULES.length, ...rules.map(({ parameters, ...rule }) => ({ ...rule, fields: parameters.map(field) })));
      recovered();
    } catch (error) {
      if (signal.aborted) throw error;
      complain(error.message);
      await sleep(RETRY_MS, signal);
    }
  }
}

/** A parameter as a field of a form: `min`, `max` and `value` are the spec's own, a form shows them over `scale`. */
function field({ name, label, unit, help, scale, role, default: value, least: min, most: max, whole }) {
  return { name, label, unit, help, scale, role, value, min, max, step: whole ? 1 : "any" };
}

/** The rule of this name; undefined where the service had none when the page was opened. */
export function ruleNamed(wanted) {
  return RULES.find(({ name }) => name === wanted);
}

/** The field of a rule whose parameter has this role; undefined where it has none. */
export function fieldIn(role, rule) {
  return ruleNamed(rule.name)?.fields.find((one) => one.role === role);
}

/** What a job's rule has in this role; null where it has nothing. */
export function valueIn(role, rule) {
  const found = fieldIn(role, rule);
  return (found && rule[found.name]) ?? null;
}

/** The rules that say something when they are watched: one that stops at a number of samples does not. */
export function watchable() {
  return RULES.filter((rule) => !fieldIn("end_spp", rule));
}
