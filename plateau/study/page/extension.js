// What observer studies add to the page.

import { studyButton } from "./make_study_dialog.js";
import * as observe from "./observe_screen.js";
import * as studies from "./studies_screen.js";
import * as study from "./study_screen.js";

/** @import { Extension } from "../extensions.js" */

/** @type {Extension["screens"]} */
export const screens = [
  [/^\/studies$/, "studies", studies],
  [/^\/studies\/([^/]+)$/, "study", study],
  [/^\/studies\/([^/]+)\/observe$/, "observe", observe],
];
/** @type {Extension["links"]} */
export const links = [{ href: "/studies", screen: "studies", text: "Studies" }];
/** @type {Extension["styles"]} */
export const styles = ["/page/study/study.css"];
/** @type {Extension["jobButtons"]} */
export const jobButtons = [studyButton];
