// The fields of forms for a spec, without its rules: their names and texts. `describe` adds what the service's
// schema of the spec says: defaults, bounds and choices, and the help where there is none here.

import { sentence } from "./figures.js";

/** @import { FieldAbout } from "./form_fields.js" */

/** @type {FieldAbout[]} */
export const VIEW = [
  { name: "exposure_ev", label: "Exposure", unit: "EV",
    help: "In powers of two; noise is judged at the brightness at which it is shown." },
  { name: "white_luminance", label: "Display white", unit: "cd/m²",
    help: "How bright white is: about 200 for a desk, 300 for a bright monitor, 1000 for HDR." },
  { name: "contrast", label: "Contrast", unit: ": 1",
    help: "White over black in a dark room. Only the rule jod knows it." },
  { name: "ambient_lux", label: "Light on the display", unit: "lux",
    help: "About 0 in a cinema, 64 in a dim room, 250 in an office. Only the rule jod knows it." },
  { name: "pixels_per_degree", label: "Pixels in a degree",
    help: "About 20 on a desk at 200 %, 38 there pixel by pixel, 57 in a cinema, 120 on a phone, for images of any size." },
  { name: "field_of_view_deg", label: "Or image width seen under", unit: "°",
    help: "Counts in place of the pixels in a degree. The nearer the eye, the larger the angle, and the finer the visible noise." },
  { name: "primaries", label: "Primaries" },
  { name: "background", label: "Background", type: "text", value: "", optional: true,
    help: "Linear red, green and blue behind an image with alpha, where it is judged and shown." },
];

/** @type {FieldAbout[]} */
export const LIMITS = [
  { name: "max_spp", label: "At most", unit: "spp", help: "The cap: the job ends there, converged or not." },
  { name: "step", label: "Judge every", unit: "spp",
    help: "Samples between two evaluations; a whole number of slices." },
  { name: "time_limit_s", label: "Time limit", unit: "min", scale: 60,
    help: "The job ends after this time, without pauses. Empty: no limit." },
  { name: "time_limit_from", label: "Which begins at", choices: { first_slice: "the first slice", submission: "the submission" },
    help: "From the submission on, waiting for a worker counts too." },
];

/** Of the allocation by zones. @type {FieldAbout[]} */
export const ZONES = [
  { name: "size", label: "Side of a zone", unit: "px",
    help: "Smaller zones follow the noise more closely; a multiple of 16." },
];

/** Of Open Image Denoise. @type {FieldAbout[]} */
export const DENOISER = [
  { name: "guides", label: "With guides", help: "What the surfaces are keeps texture from being taken for noise." },
];

/** How image.exr is written. @type {FieldAbout[]} */
export const EXR = [
  { name: "precision", label: "Precision of image.exr" },
  { name: "compression", label: "Its compression" },
];

/** @type {FieldAbout[]} */
export const MORE = [
  { name: "name", label: "Name", help: "What the job is called. Empty: as its scene is." },
  { name: "batch", label: "Batch", help: "A name that groups jobs." },
  { name: "after", label: "After",
    help: "Ids of jobs and names of batches, separated by commas: the job waits until all have ended well." },
  { name: "min_spp", label: "No sooner than", unit: "spp",
    help: "The job does not converge earlier, whatever its rule says." },
  { name: "priority", label: "Priority", help: "Higher priorities are served first." },
  { name: "slice_spp", label: "Slice", unit: "spp", help: "What a worker renders at a time." },
  { name: "seed", label: "Seed", help: "Another seed draws other samples." },
  { name: "sensor", label: "Sensor", help: "The scene's camera, by its index." },
  { name: "watch", label: "Rules to watch", type: "names", value: "", optional: true,
    help: "Names, separated by commas: they stop nothing, and mark the curve where they would have. Empty: reverse, the paper's." },
  { name: "keep_slices", label: "Keep every slice", help: "To compare any two points of the curve, and to judge the job again; a few MB each." },
  { name: "aovs", label: "Channels of image.exr", type: "names", value: "", optional: true,
    help: "Besides colour: albedo, normal, depth, position, uv, shape_id, primitive_id, separated by commas." },
];

/** Which workers render it. @type {FieldAbout[]} */
export const WORKERS = [
  { name: "variant", label: "Variant" },
  { name: "pool", label: "Pool" },
  { name: "requires", label: "Tags", help: "Only workers that have all of these render it. Separated by commas." },
];

/** Where people look at images pixel by pixel: fields of a view by the place's name. @type {Record<string, Record<string, number>>} */
export const PLACES = {};

/** Who hears of its end. @type {FieldAbout[]} */
export const NOTICE = [
  { name: "targets", label: "Notify", help: "Targets that the farm's operator has named, separated by commas." },
  { name: "url", label: "URL", placeholder: "https://…", help: "A signed message is sent there. Empty: none." },
  { name: "secret", label: "Its secret" },
];

/**
 * Names the targets that the farm's operator has named.
 * @param {{ targets: string[] }} named
 */
export function offer({ targets }) {
  if (targets.length) NOTICE[0].help = `Of ${targets.join(", ")}, separated by commas.`;
}

/**
 * Completes the fields by the service's schema of a spec.
 * @param {Schema} schema
 */
export function describe(schema) {
  const parts = schema.$defs ?? {};
  Object.assign(PLACES, parts.ViewSpec?.["x-places"]);
  for (const fields of [LIMITS, MORE, WORKERS]) complete(fields, schema);
  for (const [fields, part] of /** @type {[FieldAbout[], string][]} */ ([
    [VIEW, "ViewSpec"], [ZONES, "ZonesAllocation"], [DENOISER, "OidnDenoising"], [EXR, "ExrSpec"], [NOTICE, "NoticeSpec"],
  ])) complete(fields, parts[part]);
}

/**
 * What is read of a JSON schema.
 * @typedef {object} Schema
 * @property {string} [type]
 * @property {string} [description]
 * @property {any} [default]
 * @property {number} [minimum]
 * @property {number} [maximum]
 * @property {number} [multipleOf]
 * @property {number} [maxLength]
 * @property {string[]} [enum]
 * @property {Schema} [items]
 * @property {Schema[]} [anyOf]
 * @property {Record<string, Schema>} [properties]
 * @property {Record<string, Schema>} [$defs]
 * @property {Record<string, Record<string, number>>} [x-places]
 */

/**
 * @param {FieldAbout[]} fields
 * @param {Schema | undefined} schema - of the part of the spec that has them
 */
function complete(fields, schema) {
  for (const field of fields) {
    const said = schema?.properties?.[field.name];
    if (said) Object.assign(field, { ...described(said), ...field });
  }
}

/**
 * @param {Schema} said
 * @returns {Partial<FieldAbout>}
 */
function described(said) {
  const isOptional = said.anyOf?.some(({ type }) => type === "null") ?? false;
  const { type, minimum: min, maximum: max, multipleOf, maxLength: maxlength, enum: choices } =
    said.anyOf?.find((one) => one.type !== "null") ?? said;
  const help = sentence((said.description ?? "").replaceAll("`", ""));
  if (choices) return { type: "choice", value: said.default, choices: Object.fromEntries(choices.map((one) => [one, one])), help };
  if (type === "boolean") return { type: "flag", value: said.default, help };
  if (type === "array") return { type: "names", value: (said.default ?? []).join(", "), optional: true, help };
  if (type === "string") return { type: "text", value: said.default ?? "", maxlength, optional: isOptional, help };
  return { type: "number", value: said.default ?? "", min, max, step: multipleOf ?? (type === "integer" ? 1 : "any"), optional: isOptional, help };
}
