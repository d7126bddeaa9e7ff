// What the current key allows, so that the page offers nothing that would be refused.

import { get } from "./api.js";

/** Until the API has answered, all is offered: it decides anyway. @type {{ id: string | null, role: Api.Role }} */
let known = { id: null, role: "admin" };

/** @type {() => void} */
let met;
/** Resolves once the API has said what the key allows, or cannot be asked. @type {Promise<void>} */
export const metMe = new Promise((resolve) => { met = resolve; });

/** Asks the API about the key; resolves to whether it has answered. */
export async function meetMe() {
  const said = await get("/v1/key").catch(() => null);
  known = said ?? known;
  met();
  return said !== null;
}

/** Whether a scene may be submitted. */
export function maySubmit() {
  return known.role !== "viewer";
}

/**
 * Whether something may be changed: one's own, or all as admin.
 * @param {{ owner: string | null }} thing
 */
export function maySteer(thing) {
  return known.role === "admin" || (known.role === "submitter" && thing.owner === known.id);
}

/** Whether workers may be drained and resumed. */
export function maySteerWorkers() {
  return known.role === "admin";
}
