// The fields of a form for a spec, without its rules.
// Values, `min` and `max` are those of farm/model/spec.py; a test compares them.

/** @import { FieldAbout } from "./form_fields.js" */

/** @type {Partial<FieldAbout>} */
const spp = { min: 1, max: 1_000_000, step: 1 };

/** @type {FieldAbout[]} */
export const VIEW = [
  { name: "exposure_ev", label: "Exposure", unit: "EV", value: 0, min: -100, max: 100, step: "any",
    help: "In powers of two; noise is judged at the brightness at which it is shown." },
  { name: "white_luminance", label: "Display white", unit: "cd/m²", value: 100, min: 0.01, max: 20000, step: "any",
    help: "How bright white is: about 100 for a desk, 300 for a bright monitor, 1000 for HDR." },
  { name: "contrast", label: "Contrast", unit: ": 1", value: 1000, min: 2, max: 1e9, step: "any",
    help: "White over black in a dark room. Only the rule jod knows it." },
  { name: "ambient_lux", label: "Light on the display", unit: "lux", value: 64, min: 0, max: 100000, step: "any",
    help: "About 0 in a cinema, 64 in a dim room, 250 in an office. Only the rule jod knows it." },
  { name: "field_of_view_deg", label: "Image width seen under", unit: "°", value: 45, min: 0.0001, max: 179.9, step: "any",
    help: "The nearer the eye, the larger the angle, and the finer the visible noise." },
  { name: "pixels_per_degree", label: "Or pixels in a degree", value: "", min: 0.1, max: 1000, step: "any", optional: true,
    help: "About 38 on a desk, 57 in a cinema, 120 on a phone, for images of any size. Empty: by the angle." },
];

/** @type {FieldAbout[]} */
export const LIMITS = [
  { name: "max_spp", label: "At most", unit: "spp", value: 10000, ...spp,
    help: "The cap: the job ends there, converged or not." },
  { name: "step", label: "Judge every", unit: "spp", value: 100, ...spp,
    help: "Samples between two evaluations; a whole number of slices." },
  { name: "time_limit_s", label: "Time limit", unit: "min", value: "", scale: 60, min: 0.1, max: 366 * 86_400, step: "any", optional: true,
    help: "The job ends after this time, without pauses. Empty: no limit." },
];

/** Of the allocation by zones. @type {FieldAbout[]} */
export const ZONES = [
  { name: "size", label: "Side of a zone", unit: "px", value: 16, min: 16, max: 1024, step: 16,
    help: "Smaller zones follow the noise more closely; a multiple of 16." },
];

/** The channels of image.exr beside colour, by their names in farm/model/aovs.py. */
export const AOVS = {
  albedo: "Albedo", normal: "Normals", depth: "Depth", position: "Position", uv: "Texture coordinates",
  shape_id: "Shape ids", primitive_id: "Primitive ids",
};
/** The same by the layers of image.exr, which compositors know by these names. @type {Record<string, string>} */
export const LAYERS = {
  albedo: AOVS.albedo, N: AOVS.normal, Z: AOVS.depth, P: AOVS.position, uv: AOVS.uv,
  "id.shape": AOVS.shape_id, "id.primitive": AOVS.primitive_id,
};
/** How image.exr is written, the default first (farm/model/exr_spec.py). */
export const EXR = { precision: ["float", "half"], compression: ["zip", "none", "rle", "zips", "piz"] };

export const PRIORITY = { min: -1000, max: 1000, step: 1 };

/** @type {FieldAbout[]} */
export const MORE = [
  { name: "batch", label: "Batch", value: "", type: "text", maxlength: 100, optional: true, help: "A name that groups jobs." },
  { name: "min_spp", label: "No sooner than", unit: "spp", value: "", ...spp, optional: true,
    help: "The job does not converge earlier, whatever its rule says." },
  { name: "priority", label: "Priority", value: 0, ...PRIORITY, help: "Higher priorities are served first." },
  { name: "slice_spp", label: "Slice", unit: "spp", value: 25, min: 1, max: 4096, step: 1,
    help: "What a worker renders at a time." },
  { name: "seed", label: "Seed", value: 0, min: 0, max: 4095, step: 1, help: "Another seed draws other samples." },
  { name: "sensor", label: "Sensor", value: 0, min: 0, max: 1000, step: 1, help: "The scene's camera, by its index." },
];
