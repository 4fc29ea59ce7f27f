// What the package does beside the picture: errors that name what was wrong and leave the object usable, sizes, settings, the end.
// Runs in a browser; crates/quell-lab/tests/main/package.rs drives it. Each check gives a line for what is wrong.

import { CONVENTIONS, Denoiser, QuellError, multiplied } from "../src/index.js";

const [WIDTH, HEIGHT] = [40, 24];
const { TEXTURE_BINDING, COPY_DST, STORAGE_BINDING } = GPUTextureUsage;

/** Looks from (0, 0, 3) along -z. */
export const CAMERA = {
  clipFromWorld: multiplied(
    [1.2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, -1, 0, 0, 0.1, 0], // infinite, reversed
    [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1],
  ),
};

/** Values of a pixel, for pictures that are the same at every run. */
function hash(x, y, k) {
  let h = Math.imul(x + 1, 0x9e3779b1) ^ Math.imul(y + 1, 0x85ebca6b) ^ Math.imul(k + 1, 0xc2b2ae35);
  h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
  return ((h ^ (h >>> 12)) >>> 0) / 2 ** 32;
}

function plane(device, format, channels, value, [width, height] = [WIDTH, HEIGHT], usage = TEXTURE_BINDING | COPY_DST) {
  const texture = device.createTexture({ label: "a host's", size: [width, height], format, usage });
  const data = new Float32Array(width * height * channels);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) for (let c = 0; c < channels; c++) data[(y * width + x) * channels + c] = value(x, y, c);
  }
  device.queue.writeTexture({ texture }, data, { bytesPerRow: 4 * channels * width }, [width, height]);
  return texture;
}

/** Noise on a wall before the camera, another at every frame. */
export function textures(device, index = 0, extent = [WIDTH, HEIGHT]) {
  const noise = (k) => (x, y, c) => (hash(x, y, 7 * index + k) < 0.2 ? 2 + c : 0);
  return {
    matte: plane(device, "rgba32float", 4, noise(1), extent),
    matteWeight: plane(device, "rgba32float", 4, (x, y) => 0.2 + 0.6 * ((x ^ y) & 1), extent),
    glossy: plane(device, "rgba32float", 4, noise(2), extent),
    depth: plane(device, "r32float", 1, () => 3, extent),
    normal: plane(device, "rgba32float", 4, (x, y, c) => (c === 2 ? 1 : 0), extent),
  };
}

/** The bits of a half from 2^-14 to 2. */
function halfOf(value) {
  const exponent = Math.floor(Math.log2(value));
  return ((exponent + 15) << 10) + Math.round((value / 2 ** exponent - 1) * 1024);
}

/** What a texture of so many bytes a texel holds. */
async function contents(device, texture, size) {
  const row = 256 * Math.ceil((size * texture.width) / 256);
  const buffer = device.createBuffer({ size: row * texture.height, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow: row }, [texture.width, texture.height]);
  device.queue.submit([encoder.finish()]);
  await buffer.mapAsync(GPUMapMode.READ);
  const all = new Uint8Array(buffer.getMappedRange().slice(0));
  buffer.destroy();
  const packed = new Uint8Array(size * texture.width * texture.height);
  for (let y = 0; y < texture.height; y++) packed.set(all.subarray(y * row, y * row + size * texture.width), y * size * texture.width);
  return packed;
}

const bytes = (device, texture) => contents(device, texture, 4);
const texels = async (device, texture) => Array.from(new Uint16Array((await contents(device, texture, 8)).buffer));

/** @param {GPUDevice} device */
export async function run(device) {
  const wrong = [];
  const check = (name, holds) => holds || wrong.push(name);
  const refused = async (quantity, act) => {
    try {
      await act();
      wrong.push(`${quantity}: nothing was refused`);
    } catch (error) {
      const named = error instanceof QuellError && error.quantity === quantity && error.message.includes(quantity);
      check(`${quantity}: ${error.stack}`, named);
    }
  };
  const complaints = [];
  device.addEventListener("uncapturederror", (event) => complaints.push(event.error.message));

  const size = { width: WIDTH, height: HEIGHT };
  await refused("device", () => Denoiser.create(undefined, size));
  await refused("options", () => Denoiser.create(device));
  await refused("width", () => Denoiser.create(device, { ...size, width: 0 }));
  await refused("width", () => Denoiser.create(device, { ...size, width: 40.5 }));
  await refused("height", () => Denoiser.create(device, { ...size, height: 1e9 }));
  await refused("options.hight", () => Denoiser.create(device, { width: 4, hight: 4 }));
  await refused("preset", () => Denoiser.create(device, { ...size, preset: "papr" }));
  await refused("signals", () => Denoiser.create(device, { ...size, signals: ["mate"] }));
  await refused("signals", () => Denoiser.create(device, { ...size, signals: [] }));
  await refused("convention", () => Denoiser.create(device, { ...size, convention: "tree" }));
  await refused("convention.depth", () => Denoiser.create(device, { ...size, convention: { depth: "linear" } }));
  await refused("convention.motionScale", () => Denoiser.create(device, { ...size, convention: { motionScale: [1, NaN] } }));
  await refused("settings.firefly.treshold", () => Denoiser.create(device, { ...size, settings: { "firefly.treshold": 3 } }));
  await refused('settings["firefly.threshold"]', () => Denoiser.create(device, { ...size, settings: { "firefly.threshold": 0.5 } }));
  await refused('settings["matte_prefilter.taps"]', () => Denoiser.create(device, { ...size, settings: { "matte_prefilter.taps": 24.5 } }));
  await refused('settings["pipeline.feedback"]', () => Denoiser.create(device, { ...size, settings: { "pipeline.feedback": "fireflies" } }));
  await refused("program", () => Denoiser.create(device, { ...size, program: { signals: ["matte", "glossy"] } }));
  await refused("views", () => Denoiser.create(device, { ...size, views: 1 }));
  await refused("Denoiser", () => new Denoiser());

  // What follows changes settings of stages that `quality` leaves out.
  const denoiser = await Denoiser.create(device, { ...size, preset: "paper" });
  const planes = [0, 1, 2].map((index) => textures(device, index));
  const frame = (index) => ({ index, camera: CAMERA, textures: planes[index] });
  /** Frames from the first on, each in its own submit; the last one's composite. */
  const through = async (of, count = 3) => {
    of.reset();
    let output;
    for (let index = 0; index < count; index++) {
      const encoder = device.createCommandEncoder();
      output = of.encode(encoder, frame(index));
      device.queue.submit([encoder.finish()]);
    }
    return texels(device, output.composite);
  };
  const expected = await through(denoiser);
  check("the picture is black", expected.some((half) => half !== 0));

  // Frames that share a submit find their own uniforms.
  denoiser.reset();
  const encoder = device.createCommandEncoder();
  const outputs = [0, 1, 2].map((index) => denoiser.encode(encoder, frame(index)));
  device.queue.submit([encoder.finish()]);
  check("frames of one submit differ from frames of three", String(await texels(device, outputs[2].composite)) === String(expected));
  check("history", outputs.map((output) => output.hadHistory).join() === "false,true,true");
  check("one frame alone has history", String(await through(denoiser, 1)) !== String(expected));

  // Between the second frame and the third a host makes every mistake: the third is what it would have been.
  denoiser.reset();
  let encoders = device.createCommandEncoder();
  denoiser.encode(encoders, frame(0));
  denoiser.encode(encoders, frame(1));
  const bad = (change) => () => denoiser.encode(encoders, { ...frame(2), ...change });
  const texture = (change) => bad({ textures: { ...planes[2], ...change } });
  const matrix = (i, value) => CAMERA.clipFromWorld.map((v, k) => (k === i ? value : v));
  await refused("encoder", () => denoiser.encode(null, frame(2)));
  await refused("frame", () => denoiser.encode(encoders));
  await refused("frame.cameras", bad({ cameras: 1 }));
  await refused("camera", bad({ camera: undefined }));
  await refused("camera.clipFromWorld", bad({ camera: { clipFromWorld: [1, 2] } }));
  await refused("camera.clipFromWorld[5]", bad({ camera: { clipFromWorld: matrix(5, NaN) } }));
  await refused("camera.clipFromWorld", bad({ camera: { clipFromWorld: Array(16).fill(0) } }));
  await refused("camera.clipFromWorld", bad({ camera: { clipFromWorld: matrix(0, 0) } }));
  await refused("camera.position", bad({ camera: { clipFromWorld: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] } }));
  await refused("camera.jitter", bad({ camera: { ...CAMERA, jitter: [0.25, 0] } }));
  await refused("previousCamera.clipFromWorld", bad({ previousCamera: { clipFromWorld: Array(16).fill(0) } }));
  await refused("index", bad({ index: 1.5 }));
  await refused("textures", bad({ textures: undefined }));
  await refused("textures.normals", texture({ normals: planes[2].normal }));
  await refused("textures.matte", texture({ matte: undefined }));
  await refused("textures.normal", texture({ normal: {} }));
  await refused("textures.normal", texture({ normal: planes[2].depth }));
  await refused("textures.depth", texture({ depth: plane(device, "r32float", 1, () => 1, [WIDTH, HEIGHT - 1]) }));
  await refused("textures.surfaceId", texture({ surfaceId: planes[2].depth }));
  await refused("textures.roughness.channel", texture({ roughness: { texture: planes[2].normal, channel: "x" } }));
  await refused("textures.roughness", texture({ roughness: { texture: planes[2].depth, channel: "g" } }));
  const storage = device.createTexture({ size: [WIDTH, HEIGHT], format: "rgba16float", usage: STORAGE_BINDING });
  await refused("textures.direct", texture({ direct: storage }));
  const layers = device.createTexture({ size: [WIDTH, HEIGHT, 2], format: "rgba16float", usage: TEXTURE_BINDING });
  await refused("textures.direct", texture({ direct: layers }));
  await refused('settings["edge.depth"]', () => denoiser.configure({ "edge.depth": Infinity }));
  await refused("width", () => denoiser.resize(-1, HEIGHT));
  const third = denoiser.encode(encoders, frame(2));
  device.queue.submit([encoders.finish()]);
  check("a mistake changed the next frame", String(await texels(device, third.composite)) === String(expected));

  // Settings: a number changes the picture and comes back; the number of taps changes the tables' size.
  await denoiser.configure({ "matte_prefilter.radius": 4, "matte_prefilter.taps": 7 });
  check("a radius went unseen", String(await through(denoiser)) !== String(expected));
  await denoiser.configure({ "matte_prefilter.radius": 32, "matte_prefilter.taps": 24 });
  check("settings do not come back", String(await through(denoiser)) === String(expected));
  // A stage is switched off and on: another program, and the first one anew.
  await denoiser.configure({ "matte_bilateral.enabled": false });
  check("a switch went unseen", String(await through(denoiser)) !== String(expected));
  await denoiser.configure({ "matte_bilateral.enabled": true });
  check("a stage does not come back", String(await through(denoiser)) === String(expected));
  // What is fed back, what the median reads: the program changes, no stage does.
  for (const [name, value, first] of [["pipeline.feedback", "firefly", "blend"], ["firefly.input", "temporal", "disocclusion"]]) {
    await denoiser.configure({ [name]: value });
    check(`${name} went unseen`, String(await through(denoiser)) !== String(expected));
    await denoiser.configure({ [name]: first });
    check(`${name} does not come back`, String(await through(denoiser)) === String(expected));
  }
  // Changes that overlap come in their order, and a new size meanwhile holds.
  const changes = [{ "matte_bilateral.enabled": false }, { "firefly.threshold": 3 }, { "matte_bilateral.enabled": true, "firefly.threshold": 2 }];
  const changing = changes.map((change) => denoiser.configure(change));
  denoiser.resize(WIDTH, 2 * HEIGHT);
  await Promise.all(changing);
  denoiser.resize(WIDTH, HEIGHT);
  check("overlapping changes", String(await through(denoiser)) === String(expected));
  check("settings by name", denoiser.settings["matte_prefilter.radius"] === 32 && denoiser.settings["firefly.enabled"] === true);
  check("parameters", Denoiser.parameters().length === Object.keys(denoiser.settings).length);

  // Another size and back.
  const { bytes: taken } = denoiser;
  denoiser.resize(2 * WIDTH, 2 * HEIGHT);
  // Four times the pixels, at more than 100 bytes each; tables of taps stay as they are.
  const more = denoiser.bytes - taken;
  check(`another size takes ${more} bytes more`, more > 3 * WIDTH * HEIGHT * 100 && denoiser.width === 2 * WIDTH);
  await refused("textures.matte", () => denoiser.encode(device.createCommandEncoder(), frame(0)));
  denoiser.resize(WIDTH, HEIGHT);
  check("another size changed what comes after", String(await through(denoiser)) === String(expected));
  check(`bytes: ${taken}, now ${denoiser.bytes}`, denoiser.bytes === taken);

  // Guides in another convention hold the same: device depth of that projection, normals of the camera's space in 0..1.
  denoiser.reset();
  encoders = device.createCommandEncoder();
  let other;
  for (let index = 0; index < 3; index++) {
    const depth = plane(device, "r32float", 1, () => Math.fround(0.1 / 3));
    const normal = plane(device, "rgba32float", 4, (x, y, c) => (c === 2 ? 1 : 0.5));
    const motion = plane(device, "rg32float", 2, () => 0);
    const convention = { ...CONVENTIONS.three, normal: "unorm-xyz" };
    other = denoiser.encode(encoders, { ...frame(index), textures: { ...planes[index], depth, normal, motion }, convention });
  }
  device.queue.submit([encoders.finish()]);
  const found = await texels(device, other.composite);
  const steps = found.map((half, i) => Math.abs(half - expected[i])).filter((step) => step > 4).length;
  check(`another convention changes ${steps} of ${found.length} values`, steps <= found.length / 100);

  denoiser.destroy();
  denoiser.destroy();
  for (const act of [() => denoiser.encode(device.createCommandEncoder(), frame(0)), () => denoiser.configure({}), () => denoiser.resize(8, 8), () => denoiser.reset()]) {
    await refused("denoiser", act);
  }
  const target = device.createTexture({ size: [WIDTH, HEIGHT], format: "rgba8unorm", usage: STORAGE_BINDING | GPUTextureUsage.COPY_SRC });
  // Another preset is other settings, and nothing else.
  const quality = await Denoiser.create(device, size);
  const asQuality = await Denoiser.create(device, { ...size, preset: "paper" });
  const { settings } = quality;
  await asQuality.configure(settings);
  const smooth = await through(quality);
  check("the preset went unseen", String(smooth) !== String(expected) && settings["young_filter.frames"] === 64);
  check("the preset's settings one by one", String(await through(asQuality)) === String(smooth));
  // Noisy direct light of a lobe is added as it is, times the lobe's weight.
  quality.reset();
  const ones = plane(device, "rgba32float", 4, () => 1);
  const black = plane(device, "rgba32float", 4, () => 0);
  const dark = { ...planes[0], matte: black, glossy: black };
  for (const [lobe, weight] of [["matteDirect", (x, y) => 0.2 + 0.6 * ((x ^ y) & 1)], ["glossyDirect", () => 1]]) {
    encoders = device.createCommandEncoder();
    const lit = quality.encode(encoders, { camera: CAMERA, textures: { ...dark, [lobe]: ones } });
    device.queue.submit([encoders.finish()]);
    const halves = await texels(device, lit.composite);
    const near = (half, value) => Math.abs(half - halfOf(value)) <= 1;
    check(lobe, near(halves[0], weight(0, 0)) && near(halves[4], weight(1, 0)) && near(halves[5], weight(1, 0)));
  }
  // Debug views: a pixel in the middle of the wall, whose depth is 3 and whose normal looks at the viewer.
  await refused("views", () => quality.encodeView(device.createCommandEncoder(), "depth", target));
  const seen = await Denoiser.create(device, { ...size, views: true });
  await refused("view", () => seen.encodeView(device.createCommandEncoder(), "depth", target));
  const shown = async (view, count = 3, options = {}) => {
    seen.reset();
    encoders = device.createCommandEncoder();
    for (let index = 0; index < count; index++) seen.encode(encoders, frame(index));
    seen.encodeView(encoders, view, target, options);
    device.queue.submit([encoders.finish()]);
    const at = 4 * (12 * WIDTH + 20);
    return Array.from((await bytes(device, target)).slice(at, at + 4));
  };
  for (const [view, count, options, pixel] of [
    ["depth", 1, {}, [165, 165, 165, 255]],
    ["normal", 1, {}, [128, 128, 255, 255]],
    ["rejection", 1, {}, [255, 255, 255, 255]],
    ["rejection", 3, {}, [0, 77, 13, 255]],
    ["motion", 3, {}, [0, 0, 0, 255]],
    ["motion_error", 3, {}, [0, 0, 0, 255]],
    ["confidence", 1, {}, [255, 0, 0, 255]],
    ["history_length", 1, {}, [0, 0, 0, 255]],
    ["weights_around", 1, { pixel: [20, 12] }, [0, 255, 0, 255]],
    ["weight_sum", 1, {}, [255, 255, 255, 255]],
  ]) {
    const came = await shown(view, count, options);
    // Halves are rounded either way.
    const off = came.map((value, i) => Math.abs(value - pixel[i]));
    check(`${view} after ${count}: ${came}, not ${pixel}`, Math.max(...off) <= 1);
  }
  await refused("view", () => seen.encodeView(device.createCommandEncoder(), "deep", target));
  await refused("target", () => seen.encodeView(device.createCommandEncoder(), "depth", planes[0].depth));
  await refused("target", () => seen.encodeView(device.createCommandEncoder(), "depth", null));
  await refused("options.scale", () => seen.encodeView(device.createCommandEncoder(), "depth", target, { scale: 0 }));
  await refused("options.pixel", () => seen.encodeView(device.createCommandEncoder(), "depth", target, { pixel: [WIDTH, 0] }));
  for (const of of [quality, asQuality, seen]) of.destroy();
  // One signal alone, and without albedo.
  const alone = await Denoiser.create(device, { ...size, signals: ["glossy"], settings: { "glossy_temporal.enabled": false } });
  await refused("textures.matte", () => alone.encode(device.createCommandEncoder(), frame(0)));
  encoders = device.createCommandEncoder();
  const { matte: _, matteWeight: __, ...glossy } = planes[0];
  const single = alone.encode(encoders, { camera: CAMERA, textures: glossy });
  device.queue.submit([encoders.finish()]);
  check("the glossy signal alone is black", (await texels(device, single.composite)).some((half) => half !== 0));
  check("outputs of one signal", single.matte === null && single.glossy !== null);
  alone.destroy();

  await device.queue.onSubmittedWorkDone();
  return [...wrong, ...complaints.map((message) => `uncaptured: ${message}`)];
}
