// Settings by name, and what shaders read of them: twin of `SettingsUniforms::of` in crates/quell/src/gpu (a test compares the values).

import made from "../made/programs.js";
import { youngEnds } from "./plan.js";
import { QuellError, checkNames, likely, shown } from "./error.js";

const f = Math.fround;
/** Rows at which radii in pixels are meant. */
const REFERENCE_ROWS = 720;
/** `LEAST_WIDTH` of crates/quell/src/kernels/change.rs. */
const LEAST_CHANGE_WIDTH = f(1e-3);

const BY_NAME = new Map(made.parameters.map((parameter) => [parameter.name, parameter]));

/** The value of every parameter of a preset. */
export function preset(name) {
  if (!Object.hasOwn(made.presets, name)) {
    throw new QuellError("preset", name, `is ${shown(name)}${likely(String(name), Object.keys(made.presets))}`);
  }
  return { ...Object.fromEntries(made.parameters.map((p) => [p.name, p.default])), ...made.presets[name] };
}

function inWords(p) {
  if (p.kind === "switch") return "true or false";
  if (p.kind === "choice") return `one of ${p.choices.join(", ")}`;
  return `a ${p.kind === "whole" ? "whole " : ""}number from ${p.low} to ${p.high}`;
}

function fits(p, value) {
  if (p.kind === "switch") return typeof value === "boolean";
  if (p.kind === "choice") return p.choices.includes(value);
  const number = typeof value === "number" && f(value) >= f(p.low) && f(value) <= f(p.high);
  return number && (p.kind === "number" || Number.isInteger(value));
}

/** `settings` with these changes, checked. */
export function changed(settings, changes) {
  checkNames("settings", changes, [...BY_NAME.keys()]);
  for (const [name, value] of Object.entries(changes)) {
    const p = BY_NAME.get(name);
    if (!fits(p, value)) throw new QuellError(`settings["${name}"]`, value, `is ${shown(value)}, not ${inWords(p)}`);
  }
  return { ...settings, ...changes };
}

/** A stage's settings without its name before each. */
const stage = (settings, name) => {
  const own = Object.entries(settings).filter(([key]) => key.startsWith(`${name}.`));
  return Object.fromEntries(own.map(([key, value]) => [key.slice(name.length + 1), value]));
};

/** The stages that read taps, by the name of the table that they bind, with the number that spiral.js knows them by. */
export const TAPS = {
  "matte prefilter taps": { stage: 0, of: (settings) => stage(settings, "matte_prefilter") },
  "matte bilateral taps": { stage: 1, of: (settings) => stage(settings, "matte_bilateral") },
};

/** Numbers that shaders know choices by: their places in the table. */
const place = (name, value) => BY_NAME.get(name).choices.indexOf(value);

/**
 * The members of the struct `Settings`, but `composite`, for images of so many rows.
 */
export function settingsStruct(settings, rows) {
  const s = settings;
  const bit = (name) => (s[name] ? 1 : 0);
  const scaled = (value) => f(f(f(value) * rows) / REFERENCE_ROWS);
  const scale = f(rows / REFERENCE_ROWS);
  const step = Math.max(1, Math.round(f(f(s["glossy_bilateral.step"]) * scale)));
  const constantPx = f(f(s["glossy_bilateral.constant_radius"]) * scale);
  const isConstant = s["glossy_bilateral.radius"] === "constant";
  const mostPx = isConstant ? constantPx : f(f(s["glossy_bilateral.max_radius"]) * scale);
  // The detector of changed light: crates/quell/src/kernels/change.rs.
  const change = (signal, alpha) => {
    const isOn = s[`changed_light.${signal}`];
    const number = (value) => (isOn ? value : 0);
    const fast = f(s["changed_light.fast"]);
    const width = f(f(s["changed_light.certain"]) - f(s["changed_light.begin"]));
    return {
      fast: number(fast),
      fast_frames: number(f(1 / f(1 - fast))),
      long_frames: number(f(1 / f(1 - f(alpha)))),
      change_begin: number(s["changed_light.begin"]),
      change_slope: number(f(1 / Math.max(width, LEAST_CHANGE_WIDTH))),
      change_least: number(s["changed_light.least"]),
      change_radius: number(s["changed_light.radius"]),
      change_spacing: number(s["changed_light.spacing"]),
    };
  };
  const blend = (signal, name) => ({
    alpha: s[`${name}.alpha`],
    ramp: bit(`${name}.ramp`),
    clip: place(`${name}.clip`, s[`${name}.clip`]),
    clip_radius: s[`${name}.clip_radius`],
    clip_gamma: s[`${name}.clip_gamma`],
    confidence_frames: s["surface.confidence_frames"],
    ...change(signal, s[`${name}.alpha`]),
  });
  const edge = (gloss, contact) => ({
    depth: s["edge.depth"],
    normal: s["edge.normal"],
    plane: s["edge.plane"],
    gloss,
    contact,
  });
  const spiral = (name) => ({ taps: s[`${name}.taps`], mirror: place(`${name}.off_screen`, s[`${name}.off_screen`]) });
  const { confidence_frames: _, ...surface } = stage(s, "surface");
  const { radius, blur, floor, feedback_floor } = stage(s, "disocclusion");
  const young = stage(s, "young_filter");
  const [ends, glossyEnds] = ["matte", "glossy"].map((signal) => youngEnds(s, signal));
  // The matte level whose output stage 5 reads: it hands the confidence on.
  const acting = ends.filter(([, end]) => end > 1);
  const last = s["disocclusion.enabled"] && acting.length > 0 ? acting[acting.length - 1][0] : 0;
  return {
    surface: { ...surface, rejection: place("surface.rejection", surface.rejection) },
    matte_blend: blend("matte", "matte_temporal"),
    glossy_blend: blend("glossy", "glossy_temporal"),
    matte_edge: edge(s["edge.matte_gloss"], s["edge.contact"]),
    glossy_edge: edge(s["edge.glossy_gloss"], 0),
    young: {
      frames: young.frames,
      end_1: ends[0][1],
      end_3: ends[1][1],
      end_9: ends[2][1],
      end_27: ends[3][1],
      glossy_end_1: glossyEnds[0][1],
      glossy_end_3: glossyEnds[1][1],
      glossy_end_9: glossyEnds[2][1],
      lobe: young.lobe,
      least_lobe: young.least_lobe,
      deviations: young.deviations,
      matte_contrast: young.matte_contrast,
      glossy_contrast: young.glossy_contrast,
      further_contrast: young.further_contrast,
      contact_noise: young.contact_noise,
      isolated: young.isolated,
      last,
    },
    matte_prefilter: spiral("matte_prefilter"),
    matte_bilateral: spiral("matte_bilateral"),
    disocclusion: { radius, blur, floor, feedback_floor },
    firefly: {
      luminance: place("firefly.median", s["firefly.median"]),
      threshold: s["firefly.threshold"],
      plain: bit("firefly.plain"),
    },
    mirror: {
      virtual_reprojection: bit("glossy_temporal.virtual_reprojection"),
      hit_filter: place("glossy_temporal.hit_filter", s["glossy_temporal.hit_filter"]),
      curvature: bit("glossy_temporal.curvature"),
      max_hit_distance: s["glossy_temporal.max_hit_distance"],
      reflector_normal_min: s["glossy_temporal.reflector_normal_min"],
      reflector_roughness: s["glossy_temporal.reflector_roughness"],
      farthest_bent_px: scaled(made.constants.farthest_bent_px),
      mirror_roughness: s["glossy_temporal.mirror_roughness"],
      hit_tolerance: s["glossy_temporal.hit_tolerance"],
      spline_below: s["glossy_temporal.clip"] === "off" ? 0 : s["glossy_temporal.spline_roughness"],
    },
    glossy_bilateral: {
      radius: place("glossy_bilateral.radius", s["glossy_bilateral.radius"]),
      curvature: bit("glossy_bilateral.curvature"),
      monotone: bit("edge.monotone"),
      step_px: step,
      reach: Math.trunc(f(mostPx / step)),
      max_radius_px: mostPx,
      constant_radius_px: constantPx,
      min_radius: s["glossy_bilateral.min_radius"],
      sigma: s["glossy_bilateral.sigma"],
    },
    direct_taa: {
      history: s["direct_taa.history"],
      falloff_px: scaled(s["direct_taa.motion_falloff"]),
      clamp_falloff: s["direct_taa.clamp_falloff"],
    },
    antialiasing: {
      least: s["antialiasing.least"],
      resampling: s["antialiasing.resampling"],
      gamma: s["antialiasing.gamma"],
      change_falloff: s["antialiasing.change_falloff"],
      thin_radius: s["antialiasing.thin_radius"],
      thin_depth: s["antialiasing.thin_depth"],
      thin_motion: s["antialiasing.thin_motion"],
    },
  };
}

/** Every parameter: name, kind, range or choices, default, unit, meaning. */
export const parameters = () => made.parameters.map((p) => ({ ...p, ...(p.choices && { choices: [...p.choices] }) }));
