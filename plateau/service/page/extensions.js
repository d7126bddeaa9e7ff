// What extensions add to the page. The service answers with those that are installed in the place of this file.

/** @import { Screen } from "./main.js" */

/**
 * The exports of an extension's `extension.js`.
 * @typedef {object} Extension
 * @property {[path: RegExp, name: string, screen: { open: Screen }][]} screens
 * @property {{ href: string, screen: string, text: string }[]} links - in the header
 * @property {string[]} styles - paths of its style sheets
 * @property {((job: Api.JobView, go: (path: string) => void) => HTMLElement | null)[]} jobButtons
 *   each makes a button for a job, or null where it has none
 */

/** @type {Extension[]} */
export const extensions = [];
