// The stopping rules and the rest of a spec, as a form explains them: a sentence for each.
// Values, `min` and `max` are the spec's own (farm/model/spec.py), and a test compares them; a form shows them over `scale`.

const pixelsAt512 = { type: "number", min: 0, max: 512 * 512, step: "any" };
const spp = { min: 1, max: 1_000_000, step: 1 };

export const RULES = [
  {
    name: "visible", title: "No noise left to see",
    help: "Stops when hardly any noise is left: pixels that would still change visibly if it went on, estimated from two halves of the samples.",
    fields: [
      { name: "target", label: "Noise that may be left", unit: "%", value: 0.0002, scale: 0.01, min: 1e-9, max: 0.99, step: "any",
        help: "The share of the image that a person might still see change." },
      { name: "min_spp", label: "Not before", unit: "spp", value: 200, ...spp,
        help: "Guards against an estimate that is low by chance." },
    ],
  },
  {
    name: "reverse", title: "The paper's plateau",
    help: "Stops when the count of pixels that have changed since the first image no longer rises.",
    fields: [
      { name: "window", label: "Points in the line", value: 5, min: 2, max: 1000, step: 1,
        help: "How many points of the curve the slope is taken over." },
      { name: "epsilon", label: "Slope to stop at", unit: "px/spp at 512²", value: 0.1, min: 0, max: 512 * 512, step: "any",
        help: "Smaller is stricter." },
    ],
  },
  {
    name: "myszkowski", title: "Half against whole",
    help: "Stops when the image hardly differs from the one at a share of its samples.",
    fields: [
      { name: "alpha", label: "Share of the samples", value: 0.5, min: 0.01, max: 0.99, step: "any", help: "0.5 compares with half of them." },
      { name: "threshold", label: "Pixels that may differ", unit: "at 512²", value: 1, help: "Smaller is stricter.", ...pixelsAt512 },
    ],
  },
  {
    name: "successive", title: "One step to the next",
    help: "Stops when an image hardly differs from the one a step before; easily fooled by small steps.",
    fields: [{ name: "threshold", label: "Pixels that may differ", unit: "at 512²", value: 1, help: "Smaller is stricter.", ...pixelsAt512 }],
  },
  {
    name: "multiple", title: "Several steps back",
    help: "Stops when the last few images hardly differ from the newest.",
    fields: [
      { name: "window", label: "Images compared", value: 5, min: 1, max: 1000, step: 1, help: "How many earlier ones." },
      { name: "threshold", label: "Pixels that may differ", unit: "at 512²", value: 1, help: "Smaller is stricter.", ...pixelsAt512 },
    ],
  },
  {
    name: "fixed", title: "A number of samples",
    help: "Stops there, whatever the image looks like.",
    fields: [{ name: "spp", label: "Stop at", unit: "spp", value: 10000, ...spp, help: "Samples per pixel." }],
  },
];

export const VIEW = [
  { name: "exposure_ev", label: "Exposure", unit: "EV", value: 0, min: -100, max: 100, step: "any",
    help: "In powers of two; noise is judged as bright as it is shown." },
  { name: "white_luminance", label: "Display white", unit: "cd/m²", value: 100, min: 0.01, max: 20000, step: "any",
    help: "How bright white is: about 100 for a desk, 300 for a bright monitor, 1000 for HDR." },
  { name: "field_of_view_deg", label: "Image width seen under", unit: "°", value: 45, min: 0.0001, max: 179.9, step: "any",
    help: "The nearer the eye, the larger the angle, and the finer the noise that it sees." },
];

export const LIMITS = [
  { name: "max_spp", label: "At most", unit: "spp", value: 10000, ...spp,
    help: "The cap: the job ends there, converged or not." },
  { name: "step", label: "Look every", unit: "spp", value: 100, ...spp,
    help: "Samples between two judgements of the image; a whole number of slices." },
  { name: "time_limit_s", label: "Time limit", unit: "min", value: "", scale: 60, min: 0.1, max: 366 * 86_400, step: "any", optional: true,
    help: "The job ends after this time, without pauses. Empty: no limit." },
];

export const PRIORITY = { min: -1000, max: 1000, step: 1 };

export const MORE = [
  { name: "batch", label: "Batch", value: "", type: "text", maxlength: 100, optional: true, help: "A name that groups jobs." },
  { name: "min_spp", label: "No sooner than", unit: "spp", value: "", ...spp, optional: true,
    help: "The job does not converge before, whatever its rule says." },
  { name: "priority", label: "Priority", value: 0, ...PRIORITY, help: "Higher is served first." },
  { name: "slice_spp", label: "Slice", unit: "spp", value: 25, min: 1, max: 4096, step: 1,
    help: "What a worker renders at a time." },
  { name: "seed", label: "Seed", value: 0, min: 0, max: 4095, step: 1, help: "Another one draws other samples." },
  { name: "sensor", label: "Sensor", value: 0, min: 0, max: 1000, step: 1, help: "Which camera of the scene." },
];
