// What a host's textures mean: twin of crates/quell/src/gpu/convention.rs.

import made from "../made/programs.js";
import { QuellError, checkNames, likely, shown } from "./error.js";

/** Choices of each kind, in the order of the numbers that shaders know them by. */
const CHOICES = {
  motionUnit: ["pixels", "extents"],
  depth: ["view", "device", "distance"],
  normal: ["xyz", "unorm-xyz", "octahedral", "unorm-octahedral"],
  normalSpace: ["world", "view"],
  roughness: ["perceptual", "alpha"],
};

const quell = {
  motionScale: [1, 1],
  motionUnit: "pixels",
  motionHasJitter: false,
  depth: "view",
  normal: "xyz",
  normalSpace: "world",
  roughness: "perceptual",
};
const upscaler = { ...quell, motionUnit: "extents", depth: "device" };
const ndc = { ...upscaler, motionScale: [-0.5, 0.5] };

/** Conventions by name. */
export const CONVENTIONS = {
  quell,
  bevy: { ...quell, motionScale: [-1, -1], motionUnit: "extents", depth: "device", normal: "unorm-xyz" },
  upscaler,
  ndc,
  // three.js: the node `velocity` is the difference of clip positions, `normalView` is in the camera's space.
  three: { ...ndc, normalSpace: "view" },
};

/** A convention by name, or the members that differ from quell's; checked. */
export function conventionOf(given) {
  if (typeof given === "string") {
    if (!Object.hasOwn(CONVENTIONS, given)) {
      throw new QuellError("convention", given, `is ${shown(given)}${likely(given, Object.keys(CONVENTIONS))}`);
    }
    return CONVENTIONS[given];
  }
  checkNames("convention", given, Object.keys(quell));
  const all = { ...quell, ...given };
  for (const [name, choices] of Object.entries(CHOICES)) {
    if (!choices.includes(all[name])) {
      throw new QuellError(`convention.${name}`, all[name], `is ${shown(all[name])}, not one of ${choices.join(", ")}`);
    }
  }
  const { motionScale: scale, motionHasJitter: jitter } = all;
  if (scale?.length !== 2 || !Array.from(scale).every(Number.isFinite)) {
    throw new QuellError("convention.motionScale", scale, `is ${shown(scale)}, not two finite numbers`);
  }
  if (typeof jitter !== "boolean") {
    throw new QuellError("convention.motionHasJitter", jitter, `is ${shown(jitter)}, not true or false`);
  }
  return all;
}

/** Squared lengths of normals lie as far from 1 by rounding alone: `unit_tolerance` in crates/quell/src/gpu/inputs.rs. */
function unitTolerance(format) {
  if (format === "rgb10a2unorm") return 1e-2;
  if (/^(rgba8unorm|rgba8snorm|bgra8unorm|rg8unorm|rg8snorm)$/.test(format)) return 4e-2;
  if (/^(rg11b10ufloat|rgb9e5ufloat)$/.test(format)) return 0.2;
  return made.constants.unit_tolerance;
}

/**
 * The members of the struct `Prepare`.
 * @param extent    [width, height]
 * @param now       { view, jitter, previousJitter }
 * @param channels  of roughness, glossyHitDistance, confidence: 0 to 3
 * @param there     the bits of the guides that there are
 */
export function prepareStruct(convention, extent, now, channels, normalFormat, there) {
  const number = (name) => CHOICES[name].indexOf(convention[name]);
  const unit = convention.motionUnit === "extents" ? extent : [1, 1];
  const shift = now.previousJitter.map((before, i) => before - now.jitter[i]);
  return {
    ...now.view.device(),
    unit_tolerance: unitTolerance(normalFormat),
    motion_scale: convention.motionScale.map((scale, i) => Math.fround(scale) * unit[i]),
    motion_shift: convention.motionHasJitter ? shift : [0, 0],
    depth: number("depth"),
    normal: number("normal"),
    normal_in_view: number("normalSpace"),
    roughness_is_alpha: number("roughness"),
    roughness_channel: channels.roughness ?? 0,
    glossy_hit_channel: channels.glossyHitDistance ?? 0,
    confidence_channel: channels.confidence ?? 0,
    there,
  };
}
