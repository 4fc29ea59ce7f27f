// A frame's textures: which resource each is for, and what can be said of them before the device sees them.

import { QuellError, checkNames, shown } from "./error.js";

const FLOAT = { is: (f) => /(float|unorm|snorm)/.test(f) && !/^depth/.test(f) && !isCompressed(f), say: "floats or normalised numbers" };
const UINT = { is: (f) => /^(r|rg|rgba)(8|16|32)uint$|^rgb10a2uint$/.test(f), say: "unsigned integers" };
const DEPTH = { is: (f) => isDepth(f) || FLOAT.is(f), say: "depths, floats or normalised numbers" };

const isDepth = (format) => /^depth/.test(format);
const isCompressed = (format) => /^(bc|etc2|eac|astc)/.test(format);

/** How many channels a format has. */
function channelsOf(format) {
  if (/^(rgba|bgra|rgb10a2)/.test(format)) return 4;
  if (/^(rgb9e5|rg11b10)/.test(format)) return 3;
  return /^rg\d/.test(format) ? 2 : 1;
}

/** Textures by the names that a host gives them: resource of the program, kind of format, channels that are read at least. */
const PLANES = {
  direct: { resource: "direct input", takes: FLOAT, channels: 3 },
  matte: { resource: "matte input", takes: FLOAT, channels: 3, signal: "matte" },
  matteWeight: { resource: "matte weight", takes: FLOAT, channels: 3, signal: "matte" },
  matteDirect: { resource: "direct matte", takes: FLOAT, channels: 3, signal: "matte" },
  glossy: { resource: "glossy input", takes: FLOAT, channels: 3, signal: "glossy" },
  glossyWeight: { resource: "glossy weight", takes: FLOAT, channels: 3, signal: "glossy" },
  glossyDirect: { resource: "direct glossy", takes: FLOAT, channels: 3, signal: "glossy" },
  depth: { resource: "view depth", takes: DEPTH, channels: 1 },
  normal: { resource: "normal", takes: FLOAT, channels: 3 },
  motion: { resource: "motion", takes: FLOAT, channels: 2 },
  roughness: { resource: "roughness", takes: FLOAT, channels: 1, scalar: true },
  glossyHitDistance: { resource: "glossy hit distance", takes: FLOAT, channels: 1, scalar: true },
  surfaceId: { resource: "surface id", takes: UINT, channels: 1 },
  confidence: { resource: "confidence in", takes: FLOAT, channels: 1, scalar: true },
};
/** A depth buffer has a resource of its own. */
const DEPTH_BUFFER = "depth buffer";
const CHANNELS = ["r", "g", "b", "a"];
/** `GPUTextureUsage.TEXTURE_BINDING`, `STORAGE_BINDING`. */
const TEXTURE_BINDING = 4;
const STORAGE_BINDING = 8;

/** A plain texture of at least this extent. */
function plain(texture, [width, height], wrong) {
  if (typeof texture?.createView !== "function" || typeof texture.format !== "string") {
    throw wrong(`is ${shown(texture)}, not a GPUTexture`);
  }
  if (texture.dimension !== "2d") throw wrong(`has dimension ${texture.dimension}, not 2d`);
  if (texture.sampleCount !== 1) throw wrong(`has ${texture.sampleCount} samples a texel, not 1`);
  if (texture.depthOrArrayLayers !== 1) throw wrong(`has ${texture.depthOrArrayLayers} layers, not 1`);
  if (texture.width < width || texture.height < height) {
    throw wrong(`is ${texture.width}x${texture.height}, smaller than the frame, ${width}x${height}`);
  }
}

/** A host's texture that is drawn into. */
export function takenTarget(quantity, texture, format, extent) {
  const wrong = (why) => new QuellError(quantity, texture, why);
  plain(texture, extent, wrong);
  if (!(texture.usage & STORAGE_BINDING)) throw wrong("lacks the usage STORAGE_BINDING");
  if (texture.format !== format) throw wrong(`has the format ${texture.format}, not ${format}`);
}

function checked(quantity, given, plane, channels, extent) {
  const wrong = (why) => new QuellError(quantity, given, why);
  const texture = given?.texture ?? given;
  plain(texture, extent, wrong);
  if (!(texture.usage & TEXTURE_BINDING)) throw wrong("lacks the usage TEXTURE_BINDING");
  const { format } = texture;
  if (!plane.takes.is(format)) throw wrong(`has the format ${format}, not one of ${plane.takes.say}`);
  if (channelsOf(format) < channels) {
    throw wrong(`has the format ${format}, which has fewer than the ${channels} channels that are read`);
  }
  return texture;
}

/**
 * Textures of a frame by the names of resources.
 * @param reads  whether the program reads a resource
 * @returns {{ textures: Map<string, GPUTexture>, channels: Record<string, number>, has: (name: string) => boolean }}
 */
export function takenTextures(given, signals, extent, convention, reads) {
  checkNames("textures", given, Object.keys(PLANES));
  const textures = new Map();
  const channels = {};
  const has = (name) => given[name] !== undefined && given[name] !== null;
  for (const name of Object.keys(PLANES).filter(has)) {
    const [quantity, plane, value] = [`textures.${name}`, PLANES[name], given[name]];
    let count = plane.channels;
    if (name === "normal" && /octahedral/.test(convention.normal)) count = 2;
    if (value.texture && value.channel !== undefined) {
      const channel = plane.scalar ? CHANNELS.indexOf(value.channel) : -1;
      if (channel < 0) {
        const why = plane.scalar ? `is ${shown(value.channel)}, not one of r, g, b, a` : "is given, but this texture is read whole";
        throw new QuellError(`${quantity}.channel`, value.channel, why);
      }
      channels[name] = channel;
      count = channel + 1;
    }
    if (plane.signal && !signals.includes(plane.signal)) {
      const why = `is given, but the denoiser was made with signals ${shown(signals)}`;
      throw new QuellError(quantity, value, why);
    }
    const texture = checked(quantity, value, plane, count, extent);
    const resource = name === "depth" && isDepth(texture.format) ? DEPTH_BUFFER : plane.resource;
    if (!reads(resource)) throw new QuellError(quantity, value, "is given, but the program does not read it");
    textures.set(resource, texture);
  }
  for (const signal of signals) {
    if (!has(signal)) {
      const why = `is missing: the denoiser was made with signals ${shown(signals)}`;
      throw new QuellError(`textures.${signal}`, given[signal], why);
    }
  }
  return { textures, channels, has };
}

/** Which terms the composite adds, and which have weights: the struct `CompositeSettings`. */
export function compositeStruct(has) {
  const bit = (name) => (has(name) ? 1 : 0);
  return {
    direct: bit("direct"),
    matte: bit("matte"),
    glossy: bit("glossy"),
    direct_matte: bit("matteDirect"),
    direct_glossy: bit("glossyDirect"),
    matte_weight: bit("matteWeight"),
    glossy_weight: bit("glossyWeight"),
  };
}

/** A view for a shader: the first mip level, of a depth buffer its depths alone. */
export function viewOf(texture) {
  return texture.createView({ mipLevelCount: 1, aspect: isDepth(texture.format) ? "depth-only" : "all" });
}
