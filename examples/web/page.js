// The page: runs the frames of frames.json through the package quell-denoise, shows noisy | denoised, says how far the result lies from
// the one that came with the frames. `?from=FOLDER/` names another folder than quell-shaders/; `?preset=paper` another preset than
// `quality` (that of `quell shaders --preset`); `?program` takes the shaders and settings of that folder in place of the package's.

import { Denoiser, loadProgram } from "quell-denoise";
import { BYTES, read, texels } from "./texels.js";

const parameters = new URLSearchParams(location.search);
const base = new URL(parameters.get("from") ?? "quell-shaders/", location.href);
const says = document.querySelector("#says");
const canvas = document.querySelector("canvas");

/** What a script that drives the page looks at. */
const state = (window.state = { done: false, failed: null, frames: [], adapter: null });

/** What the package calls the textures that the files name as the manifest does. */
const TEXTURES = {
  "direct input": "direct", "matte input": "matte", "matte weight": "matteWeight", "direct matte": "matteDirect",
  "glossy input": "glossy", "glossy weight": "glossyWeight", "direct glossy": "glossyDirect", "view depth": "depth",
  normal: "normal", motion: "motion", roughness: "roughness", "glossy hit distance": "glossyHitDistance", "surface id": "surfaceId",
  "confidence in": "confidence",
};

const SHOW = /* wgsl */ `
struct Shown { split: f32, exposure: f32 }
@group(0) @binding(0) var<uniform> shown: Shown;
@group(0) @binding(1) var denoised: texture_2d<f32>;
@group(0) @binding(2) var direct: texture_2d<f32>;
@group(0) @binding(3) var matte: texture_2d<f32>;
@group(0) @binding(4) var matte_weight: texture_2d<f32>;
@group(0) @binding(5) var glossy: texture_2d<f32>;
@group(0) @binding(6) var glossy_weight: texture_2d<f32>;

@vertex
fn whole(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn show(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let p = vec2u(at.xy);
    let border = shown.split * f32(textureDimensions(denoised).x);
    var light = textureLoad(denoised, p, 0).rgb;
    if at.x < border {
        light = textureLoad(direct, p, 0).rgb
            + textureLoad(matte, p, 0).rgb * textureLoad(matte_weight, p, 0).rgb
            + textureLoad(glossy, p, 0).rgb * textureLoad(glossy_weight, p, 0).rgb;
    }
    // Reinhard's curve on the luminance, then sRGB.
    light = max(light * shown.exposure, vec3f(0.0));
    let luminance = dot(light, vec3f(0.2126, 0.7152, 0.0722));
    light = min(light / (1.0 + 0.5 * luminance), vec3f(1.0));
    let encoded = select(1.055 * pow(light, vec3f(1.0 / 2.4)) - 0.055, light * 12.92, light <= vec3f(0.0031308));
    return vec4f(select(encoded, vec3f(1.0), abs(at.x - border) < 1.0), 1.0);
}
`;

/**
 * Draws noisy | denoised into a texture, and brings that to the canvas by hand: a WebGPU canvas would be faster, but a
 * browser that runs WebGPU in software may have none (headless Chromium loses its device).
 */
class Screen {
  static async make(device, frames) {
    const screen = new Screen();
    const format = "rgba8unorm";
    screen.context = canvas.getContext("2d");
    const { RENDER_ATTACHMENT, COPY_SRC } = GPUTextureUsage;
    const size = [canvas.width, canvas.height];
    screen.picture = device.createTexture({ label: "picture", size, format, usage: RENDER_ATTACHMENT | COPY_SRC });
    const module = device.createShaderModule({ label: "show", code: SHOW });
    const texture = (binding) => ({
      binding, visibility: GPUShaderStage.FRAGMENT, texture: { sampleType: "unfilterable-float" },
    });
    const uniform = { binding: 0, visibility: GPUShaderStage.FRAGMENT, buffer: {} };
    screen.layout = device.createBindGroupLayout({ entries: [uniform, ...[1, 2, 3, 4, 5, 6].map(texture)] });
    screen.pipeline = device.createRenderPipeline({
      layout: device.createPipelineLayout({ bindGroupLayouts: [screen.layout] }),
      vertex: { module },
      fragment: { module, targets: [{ format }] },
    });
    screen.uniform = device.createBuffer({ size: 8, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    screen.black = device.createTexture({ size: [1, 1], format: "rgba8unorm", usage: GPUTextureUsage.TEXTURE_BINDING });
    return Object.assign(screen, { device, exposure: frames.exposure });
  }

  async draw(denoised, inputs) {
    const encoder = this.device.createCommandEncoder({ label: "show" });
    const split = Number(document.querySelector("#split").value);
    this.device.queue.writeBuffer(this.uniform, 0, new Float32Array([split, this.exposure]));
    const names = ["direct", "matte", "matteWeight", "glossy", "glossyWeight"];
    const textures = [denoised, ...names.map((name) => inputs[name] ?? this.black)];
    const entries = textures.map((texture, i) => ({ binding: i + 1, resource: texture.createView() }));
    entries.unshift({ binding: 0, resource: { buffer: this.uniform } });
    const view = this.picture.createView();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view, loadOp: "clear", storeOp: "store" }] });
    pass.setPipeline(this.pipeline);
    pass.setBindGroup(0, this.device.createBindGroup({ layout: this.layout, entries }));
    pass.draw(3);
    pass.end();
    this.device.queue.submit([encoder.finish()]);
    const bytes = new Uint8ClampedArray(await read(this.device, this.picture));
    this.context.putImageData(new ImageData(bytes, canvas.width, canvas.height), 0, 0);
  }
}

/** Brings a frame's planes into textures, made when first needed. */
async function upload(device, extent, frame, inputs) {
  const response = await fetch(new URL(frame.file, base));
  if (!response.ok) throw new Error(`${frame.file}: ${response.status}`);
  const bytes = await response.arrayBuffer();
  for (const { name, format, offset } of frame.planes) {
    const texture = (inputs[TEXTURES[name]] ??= device.createTexture({
      label: name, size: extent, format, usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    }));
    device.queue.writeTexture({ texture }, bytes, { offset, bytesPerRow: BYTES[format] * extent[0] }, extent);
  }
  return bytes;
}

/** A camera as the package takes it. */
const camera = ({ clip_from_world: clipFromWorld, jitter }) => ({ clipFromWorld, jitter });

/** How far values lie apart, relative to the larger one plus the plane's mean magnitude. Alpha is left out. */
function apart(found, expected) {
  const colour = (_, i) => i % 4 < 3;
  const [a, b] = [found.filter(colour), expected.filter(colour)];
  const mean = b.reduce((total, v) => total + Math.abs(v), 0) / b.length;
  const differences = Array.from(a, (v, i) => Math.abs(v - b[i]) / (Math.max(Math.abs(v), Math.abs(b[i])) + mean));
  if (differences.some(Number.isNaN)) throw new Error("the result holds NaN");
  differences.sort((p, q) => p - q);
  const at = (share) => differences[Math.min(differences.length - 1, Math.floor(share * differences.length))];
  return { median: at(0.5), most: at(0.98), nearly_all: at(0.998), largest: at(1) };
}

async function run() {
  if (!navigator.gpu) throw new Error("This browser has no WebGPU here. It needs https or localhost.");
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
  if (!adapter) throw new Error("There is no adapter for WebGPU.");
  const { vendor, architecture, description } = adapter.info;
  state.adapter = [vendor, architecture, description].filter(Boolean).join(" ");
  // No feature and no limit beyond the defaults.
  const device = await adapter.requestDevice();
  device.addEventListener("uncapturederror", (event) => fail(event.error));
  device.lost.then((info) => fail(new Error(`The device was lost: ${info.message}`)));

  const response = await fetch(new URL("frames.json", base));
  if (!response.ok) throw new Error(`No ${base}frames.json: write it by \`quell shaders examples/web/quell-shaders --frames 16\`.`);
  const frames = await response.json();
  const extent = [frames.size.width, frames.size.height];
  [canvas.width, canvas.height] = extent;
  const [width, height] = extent;
  const jitter = frames.frames.some((frame) => frame.camera.jitter.some((v) => v !== 0));
  const program = parameters.has("program") ? await loadProgram(base) : undefined;
  const preset = parameters.get("preset") ?? undefined;
  const denoiser = await Denoiser.create(device, { width, height, ...(program ? { program } : { preset, jitter }) });
  const screen = await Screen.make(device, frames);
  /** By the package's names. */
  const inputs = {};

  let output;
  for (const frame of frames.frames) {
    const bytes = await upload(device, extent, frame, inputs);
    await device.queue.onSubmittedWorkDone();
    const start = performance.now();
    const encoder = device.createCommandEncoder();
    output = denoiser.encode(encoder, {
      index: frame.index,
      camera: camera(frame.camera),
      previousCamera: camera(frame.previous_camera),
      textures: inputs,
    });
    device.queue.submit([encoder.finish()]);
    await device.queue.onSubmittedWorkDone();
    const ms = performance.now() - start;
    await screen.draw(output.composite, inputs);
    const outputs = {};
    for (const { name, format, offset, bytes: length } of frame.expected) {
      const expected = texels(bytes.slice(offset, offset + length), format);
      outputs[name] = apart(texels(await read(device, output[name]), output[name].format), expected);
    }
    state.frames.push({ index: frame.index, ms, outputs });
    const { median, most, nearly_all: nearlyAll } = outputs.composite;
    says.textContent = `${state.adapter}: frame ${frame.index}, ${ms.toFixed(1)} ms from submitting to the end\n` +
      `off what came with it by ${median.toExponential(1)} (median), ${most.toExponential(1)} (98 %), ` +
      `${nearlyAll.toExponential(1)} (99.8 %), relative to each value plus the plane's mean`;
  }
  document.querySelector("#split").oninput = () => screen.draw(output.composite, inputs).catch(fail);
  /** The texels of an output, for a script: base64. */
  window.output = async (name) => {
    const texture = output[name];
    const bytes = new Uint8Array(await read(device, texture));
    let text = "";
    for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
    return { format: texture.format, base64: btoa(text) };
  };
}

function fail(error) {
  state.failed ??= error.message;
  says.textContent = error.message;
}

document.querySelector("#again").onclick = () => location.reload();
run().catch(fail).finally(() => { state.done = true; });
