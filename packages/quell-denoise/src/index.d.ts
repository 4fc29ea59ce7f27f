import type { DebugView, Preset, Settings } from "../made/settings.js";

export type { DebugView, Preset, Settings };

/** One of the two lobes that are filtered: matte (diffuse) and glossy (specular) light. */
export type Signal = "matte" | "glossy";

export interface DenoiserOptions {
  /** Columns of the frames, from 1 to the device's `maxTextureDimension2D`. */
  width: number;
  /** Rows. */
  height: number;
  /**
   * Where settings start from. Default `"quality"`, smooth from the first frame on (docs/quality.md); `"paper"` is the system of
   * Mara et al. 2017, which moves fewer bytes.
   */
  preset?: Preset;
  /** Parameters that differ from the preset's. */
  settings?: Settings;
  /** What frames have; default both. A signal that is left out costs nothing. */
  signals?: readonly Signal[];
  /**
   * The samples of frames are jittered (`Camera.jitter`): the composite is anti-aliased over time (with preset `paper` its direct light
   * alone, stage 11). Default false.
   */
  jitter?: boolean;
  /** What textures mean, unless a frame says otherwise; default `"quell"`. */
  convention?: ConventionName | Partial<Convention>;
  /** A program from `loadProgram` in place of the package's; it comes with its own settings, for one height. */
  program?: Program;
  /** Compiles the pass of debug views, too; default false. */
  views?: boolean;
  /** Before the labels of what is made on the device; default `"quell"`. */
  label?: string;
}

/** A camera of one frame. World space is right-handed; clip space has x to the right, y up. */
export interface Camera {
  /** Clip from world, column-major, without jitter: projection times view. `multiplied(projection, view)` makes it. */
  clipFromWorld: ArrayLike<number>;
  /** Where samples lie, in pixels from the pixels' centres, x right, y down; default none. */
  jitter?: ArrayLike<number>;
  /** Of the eye, world space: needed where rays are parallel (orthographic), else unused. */
  position?: ArrayLike<number>;
}

/** One channel of a texture. */
export interface Channel {
  texture: GPUTexture;
  /** Default `"r"`. */
  channel?: "r" | "g" | "b" | "a";
}

/**
 * A frame's textures: two-dimensional, one sample a texel, usage `TEXTURE_BINDING`, at least as large as the frame, whose pixel
 * (0, 0), the upper left one, is texel (0, 0) of the first mip level. Bad values (NaN, infinities, normals that are not unit) are
 * repaired and, in the guides, counted.
 */
export interface Textures {
  /** Radiance free of noise: emission, sky, analytic or filtered direct light. Scene-linear. Absent: black. */
  direct?: GPUTexture;
  /** Diffuse light without albedo, mean over its paths; scene-linear, >= 0. Needed if the signal is on. */
  matte?: GPUTexture;
  /** What multiplies it back: the albedo. May exceed 1. Absent: 1. */
  matteWeight?: GPUTexture;
  /** Noisy direct light of the lobe, without weight, added unfiltered. Absent: none. */
  matteDirect?: GPUTexture;
  /** Specular light without its weight. Needed if the signal is on. */
  glossy?: GPUTexture;
  /** What multiplies it back. Absent: 1. */
  glossyWeight?: GPUTexture;
  /** Noisy direct light of the lobe. Absent: none. */
  glossyDirect?: GPUTexture;
  /** As `Convention.depth` says: a depth format, or r32float, r16float ... Absent: no surface is told from another. */
  depth?: GPUTexture;
  /** Shading normal on the viewer's side, as `Convention.normal` and `normalSpace` say; (0, 0, 0): background. */
  normal?: GPUTexture;
  /** Times `Convention.motionScale`: previous = current + motion. NaN: unknown. Absent: from depth and cameras. */
  motion?: GPUTexture;
  /** 0..1. Absent: glossy kernels size themselves by variance. */
  roughness?: GPUTexture | Channel;
  /** World-space distance from the surface to what the glossy ray met; +inf: it left the scene. */
  glossyHitDistance?: GPUTexture | Channel;
  /** Object or material, an unsigned integer: differing ids share no light. Absent: all equal. */
  surfaceId?: GPUTexture;
  /** Your own trust in history, 0..1; 0 resets that pixel. Absent: 1. */
  confidence?: GPUTexture | Channel;
}

/** What a host's textures mean. */
export interface Convention {
  /** Multiplies vectors; then previous = current + motion, x to the right, y down. */
  motionScale: readonly [number, number];
  /** What vectors are counted in: pixels, or shares of the frame's width and height. */
  motionUnit: "pixels" | "extents";
  /** Vectors are differences of jittered positions. */
  motionHasJitter: boolean;
  /** Distance along the camera's axis; what the depth test wrote, 0..1; length of the ray. */
  depth: "view" | "device" | "distance";
  /** How a unit vector is held: -1..1; 0..1; octahedral; octahedral in 0..1. */
  normal: "xyz" | "unorm-xyz" | "octahedral" | "unorm-octahedral";
  /** World space, or the camera's: x right, y up, z towards the viewer. */
  normalSpace: "world" | "view";
  /** glTF's perceptual roughness, or GGX's alpha, its square. */
  roughness: "perceptual" | "alpha";
}

/** `three`: three.js' nodes `velocity` and `normalView`, and its depth buffer. */
export type ConventionName = "quell" | "bevy" | "upscaler" | "ndc" | "three";

/** Conventions by name, to start one's own from. */
export const CONVENTIONS: Readonly<Record<ConventionName, Readonly<Convention>>>;

export interface Frame {
  camera: Camera;
  /** Of the frame before. Default: the camera that was encoded last. */
  previousCamera?: Camera;
  textures: Textures;
  /** Number of the frame; default one more than the last. A step other than 1 is a cut. */
  index?: number;
  /** For this frame alone. */
  convention?: ConventionName | Partial<Convention>;
}

/**
 * What was encoded: textures that hold the frame once the encoder has run, until the next one has; rgba16float. The composite is the
 * same texture at every frame until `resize` or `configure` makes another; the others may alternate between two.
 */
export interface Output {
  /** direct + matte * weight + glossy * weight; anti-aliased with `jitter` and `antialiasing.enabled`. Alpha is 0. */
  composite: GPUTexture;
  /** Direct light, anti-aliased with `jitter` where `antialiasing.enabled` is off; the host's own texture where it is not filtered. */
  direct: GPUTexture | null;
  /** Filtered, without weight; null: the denoiser was made without the signal. */
  matte: GPUTexture | null;
  /** Filtered, without weight. */
  glossy: GPUTexture | null;
  /** In alpha: trust in the history of the matte signal (without it the glossy one's), 0..1; negative: background. */
  confidence: GPUTexture | null;
  /** Of the same signal, in frames; r32float. Where `changed_light` is on for it, at most 2^-12 too long: the lower 11 bits hold something else. */
  historyLength: GPUTexture | null;
  /** Counts of repaired values, in the order of `quell::gpu::Repairs`. */
  repairs: GPUBuffer | null;
  /** The frame continued from the one before. */
  hadHistory: boolean;
}

export interface ViewOptions {
  /** Brightness of `light`, cells a scene unit of `world_grid`, sensitivity of the errors; default 1. */
  scale?: number;
  /** Of `weights_around`: column and row; default the upper left one. */
  pixel?: readonly [number, number];
}

/** A parameter of a stage. */
export type Parameter = { name: keyof Settings; unit: string; meaning: string } & (
  | { kind: "number" | "whole"; low: number; high: number; default: number }
  | { kind: "switch"; default: boolean }
  | { kind: "choice"; choices: string[]; default: string }
);

/** The real-time denoiser on a host's device, for one view. */
export class Denoiser {
  private constructor();
  /**
   * Compiles the stages and makes their textures, without any feature or limit beyond WebGPU's defaults.
   * @throws {QuellError} an option out of its range; what the device refuses, out of memory among it
   */
  static create(device: GPUDevice, options: DenoiserOptions): Promise<Denoiser>;
  /** Every parameter of the stages. */
  static parameters(): Parameter[];
  readonly width: number;
  readonly height: number;
  readonly signals: Signal[];
  /** The value of every parameter; null: the program was written with its own. */
  readonly settings: Required<Settings> | null;
  /** Bytes of device memory that its textures and tables take. */
  readonly bytes: number;
  /**
   * Appends a frame to the host's encoder; the host submits. Several frames may share a submit. An encoder that is thrown away has
   * lost a frame: call `reset`.
   * @throws {QuellError} nothing was encoded then, and history is as it was
   */
  encode(encoder: GPUCommandEncoder, frame: Frame): Output;
  /**
   * Draws a debug view of the frame that was encoded last into a texture of yours (rgba8unorm, usage `STORAGE_BINDING`, at least of the
   * frame's extent), encoded for a display, in the same encoder or a later one. The denoiser must have been made with `views: true`.
   * @throws {QuellError} nothing was encoded then
   */
  encodeView(encoder: GPUCommandEncoder, view: DebugView, target: GPUTexture, options?: ViewOptions): void;
  /**
   * Changes settings. History is kept, unless other stages run or read other images then: what is missing is compiled then, its textures are made anew, and
   * the next frame starts afresh. After an error the old settings stay.
   */
  configure(settings: Settings): Promise<void>;
  /** Changes the frames' size: history is forgotten, pipelines stay, textures are made anew. Submit first what was encoded. */
  resize(width: number, height: number): void;
  /** Forgets history. */
  reset(): void;
  /** Gives the memory back. */
  destroy(): void;
}

/** What `loadProgram` gives. */
export interface Program {
  readonly signals: Signal[];
  /** Height of the frames that it was written for. */
  readonly rows: number;
}

/**
 * A program from the files of `quell shaders DIR`: for settings that the package has no program for, other storage, passes one by one.
 * @param folder  address, with a slash at the end
 */
export function loadProgram(folder: string | URL): Promise<Program>;

/** The product of two column-major 4x4 matrices, in doubles. */
export function multiplied(a: ArrayLike<number>, b: ArrayLike<number>): number[];

/** What was wrong with an argument. */
export class QuellError extends Error {
  /** Name of the argument, such as `textures.normal`. */
  readonly quantity: string;
  /** What it was. */
  readonly value: unknown;
}
