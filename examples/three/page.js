// quell-denoise on the device of three.js' WebGPU renderer. three.js draws the G-buffer: emission, albedo, normals, velocity, depth. A small
// path tracer adds one path a pixel, quell takes the noise out and smooths edges over time, three.js shows the picture.
//
// ?size=WxH; ?preset=paper; for scripts: ?frames=N stops after N frames under a moving camera (`window.state`, `picture()`), ?score=P compares the last with
// P paths a pixel, ?still leaves things where they are, ?readback draws to a 2D canvas: a browser that runs WebGPU in software may have no WebGPU canvas.

import * as THREE from "three/webgpu";
import {
  luminance, materialColor, materialEmissive, materialMetalness, materialRoughness, mix, mrt, normalView, step, texture, uniform, uv, vec4,
  velocity,
} from "three/tsl";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Denoiser, multiplied } from "quell-denoise";
import { Tracer } from "./tracer.js";

const parameters = new URLSearchParams(location.search);
const [width, height] = (parameters.get("size") ?? "960x540").split("x").map(Number);
const last = Number(parameters.get("frames") ?? Infinity);
const isReadBack = parameters.has("readback");
const says = document.querySelector("#says");
const canvas = document.querySelector("canvas");
[canvas.width, canvas.height] = [width, height];
const state = (window.state = { done: false, failed: null, frames: 0, adapter: null });
const SKY = [0.02, 0.03, 0.05];

/** A room, open to the viewer: unit boxes and spheres, so that the tracer knows them. */
function room() {
  const scene = new THREE.Scene();
  const box = new THREE.BoxGeometry(1, 1, 1);
  const sphere = new THREE.SphereGeometry(0.5, 128, 64);
  const add = (geometry, at, size, color, more = {}) => {
    const material = new THREE.MeshStandardMaterial({ color, roughness: 1, metalness: 0, ...more });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.position.set(...at);
    mesh.scale.set(...size);
    scene.add(mesh);
    return mesh;
  };
  add(box, [0, -0.05, 0], [6, 0.1, 5], 0xb8b0a4);
  add(box, [0, 3.05, 0], [6, 0.1, 5], 0xd0d0d0);
  add(box, [0, 1.5, -2.55], [6, 3, 0.1], 0xc8c4bc);
  add(box, [-3.05, 1.5, 0], [0.1, 3, 5], 0xb03028);
  add(box, [3.05, 1.5, 0], [0.1, 3, 5], 0x2f7d3a);
  const lamp = add(box, [0, 2.96, -0.4], [1.4, 0.05, 1], 0x000000, { emissive: 0xfff0d8, emissiveIntensity: 22 });
  const turning = add(box, [-1.3, 0.7, -1], [0.9, 1.4, 0.9], 0x4a78c0);
  add(box, [1.9, 0.3, -1.3], [1, 0.6, 0.8], 0xd8b048);
  const mirror = add(sphere, [0.4, 0.62, -0.3], [1.24, 1.24, 1.24], 0xf0e0c0, { metalness: 1, roughness: 0.15 });
  const ball = add(sphere, [1.8, 0.95, -1.3], [0.7, 0.7, 0.7], 0xe8e4e0);
  add(box, [-0.4, 0.12, 0.9], [0.6, 0.24, 0.4], 0xa04878);
  const pose = (time) => {
    turning.rotation.y = 0.8 * time;
    mirror.position.x = 0.4 + 0.5 * Math.sin(0.9 * time);
    ball.position.y = 0.95 + 0.3 * Math.abs(Math.sin(1.7 * time));
  };
  return { scene, lamp, pose, meshes: scene.children };
}

/** The textures that three.js draws into, by name, and what their texels hold. */
function gBuffer() {
  const target = new THREE.RenderTarget(width, height, { count: 4, type: THREE.HalfFloatType, samples: 0 });
  ["emission", "albedo", "normal", "velocity"].forEach((name, i) => {
    target.textures[i].name = name;
    target.textures[i].generateMipmaps = false;
  });
  target.depthTexture = new THREE.DepthTexture(width, height, THREE.FloatType);
  const nodes = mrt({
    emission: vec4(materialEmissive, 1),
    albedo: vec4(materialColor, 1),
    normal: vec4(normalView, materialRoughness),
    velocity: vec4(velocity, materialMetalness, 1),
  });
  return { target, nodes };
}

/** Where the samples of a frame lie in their pixels, from the middle: Halton's sequence in bases 2 and 3. */
const jitterOf = (frame) => [2, 3].map((base) => {
  let [value, share] = [-0.5, 1 / base];
  for (let n = (frame % JITTERS) + 1; n > 0; n = Math.floor(n / base)) {
    value += share * (n % base);
    share /= base;
  }
  return value;
});
/** Frames after which the places repeat. */
const JITTERS = 16;

/** A texture of the device for three.js' nodes. */
function shown(gpuTexture) {
  const external = new THREE.ExternalTexture(gpuTexture);
  external.type = THREE.HalfFloatType;
  external.minFilter = external.magFilter = THREE.NearestFilter;
  external.generateMipmaps = false;
  external.needsUpdate = true;
  return external;
}

async function run() {
  const renderer = new THREE.WebGPURenderer({ canvas, antialias: false });
  await renderer.init();
  const { device } = renderer.backend;
  if (!device) throw new Error("three.js fell back to WebGL: quell needs WebGPU, which needs https or localhost");
  device.addEventListener("uncapturederror", (event) => fail(event.error));
  device.lost.then((info) => fail(new Error(`The device was lost: ${info.message}`)));
  state.adapter = [device.adapterInfo?.vendor, device.adapterInfo?.architecture].filter(Boolean).join(" ");
  renderer.setPixelRatio(1);
  renderer.setSize(width, height, false);

  const { scene, lamp, pose, meshes } = room();
  const camera = new THREE.PerspectiveCamera(50, width / height, 0.1, 50);
  camera.position.set(0, 1.6, 5.2);
  const controls = new OrbitControls(camera, canvas);
  controls.target.set(0, 1.2, -0.5);
  const { target, nodes } = gBuffer();
  /** Draws a frame whose samples lie off the pixels' middles; gives three.js' camera as quell takes it. */
  const drawGBuffer = (jitter) => {
    camera.clearViewOffset();
    const projection = camera.projectionMatrix.clone();
    // Velocity is that of surfaces, without the jitter.
    velocity.setProjectionMatrix(projection);
    camera.setViewOffset(width, height, ...jitter, width, height);
    renderer.setMRT(nodes);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    renderer.setMRT(null);
    return { clipFromWorld: multiplied(projection.elements, camera.matrixWorldInverse.elements), jitter };
  };

  pose(0);
  controls.update();
  // The first render also makes the matrices for WebGPU's depth.
  drawGBuffer([0, 0]);
  /** What three.js made on the device. */
  const gpu = (of) => renderer.backend.get(of).texture;
  const [emission, albedo, normal, motion] = target.textures.map(gpu);
  const depth = gpu(target.depthTexture);

  const tracer = new Tracer(device, [width, height]);
  const preset = parameters.get("preset") ?? "quality";
  const denoiser = await Denoiser.create(device, { width, height, preset, convention: "three", jitter: true });
  const trace = (encoder, seed, paths) => {
    const buffer = { depth, normal, velocity: motion };
    tracer.encode(encoder, { camera, meshes, lamp, sky: SKY, buffer, seed, paths });
  };
  const denoise = (encoder, told) => denoiser.encode(encoder, {
    camera: told,
    textures: {
      direct: emission,
      // Light without albedo; diffuse surfaces have no glossy light, metals no matte light.
      matte: tracer.matte, matteWeight: albedo,
      glossy: tracer.glossy, glossyWeight: albedo,
      depth, normal, motion,
      roughness: { texture: normal, channel: "a" },
      glossyHitDistance: tracer.hitDistance,
    },
  });

  const screen = await makeScreen(renderer, target, tracer);
  if (parameters.has("still")) document.querySelector("#move").checked = false;
  const frame = async (time) => {
    if (document.querySelector("#move").checked) pose(time);
    if (Number.isFinite(last)) camera.position.x = 0.6 * Math.sin(time);
    controls.update();
    const told = drawGBuffer(jitterOf(state.frames));
    const encoder = device.createCommandEncoder({ label: "trace and denoise" });
    trace(encoder, state.frames, 1);
    const output = denoise(encoder, told);
    device.queue.submit([encoder.finish()]);
    await screen(output.composite);
    state.frames += 1;
    return output;
  };

  if (Number.isFinite(last)) {
    let output;
    while (state.frames < last) {
      output = await frame(state.frames / 8);
      await device.queue.onSubmittedWorkDone();
    }
    says.textContent = `${state.adapter}: ${state.frames} frames of ${width}x${height}`;
    window.picture = async () => Array.from(await read(device, output.composite));
    const paths = Number(parameters.get("score") ?? 0);
    if (paths) state.score = await score(device, { tracer, trace, drawGBuffer, output, emission, albedo, paths });
    return;
  }
  let [before, isBusy] = [performance.now(), false];
  renderer.setAnimationLoop(async (now) => {
    if (state.failed || isBusy) return;
    isBusy = true;
    await frame(now / 1000);
    isBusy = false;
    says.textContent = `${width}x${height}, one path a pixel, ${(now - before).toFixed(1)} ms from frame to frame`;
    before = now;
  });
}

/** Draws noisy | denoised by three.js. */
async function makeScreen(renderer, target, tracer) {
  const split = uniform(0.5);
  const [emission, albedo] = target.textures.map((t) => texture(t));
  let quad;
  const material = (composite) => {
    const noisy = emission.add(texture(shown(tracer.matte)).add(texture(shown(tracer.glossy))).mul(albedo));
    const both = mix(noisy, texture(shown(composite)), step(split, uv().x)).rgb;
    const made = new THREE.MeshBasicNodeMaterial();
    // Reinhard's curve on the luminance; three.js maps no tones in a render target, so it is done here for both ways of showing.
    made.colorNode = vec4(both.div(luminance(both).mul(0.5).add(1)), 1);
    return made;
  };
  const own = isReadBack ? new THREE.RenderTarget(canvas.width, canvas.height) : null;
  if (own) own.texture.colorSpace = THREE.SRGBColorSpace;
  const flat = own && canvas.getContext("2d");
  return async (composite) => {
    // The composite is the same texture at every frame.
    quad ??= new THREE.QuadMesh(material(composite));
    split.value = Number(document.querySelector("#split").value);
    renderer.setRenderTarget(own);
    quad.render(renderer);
    renderer.setRenderTarget(null);
    if (!flat) return;
    const pixels = await renderer.readRenderTargetPixelsAsync(own, 0, 0, canvas.width, canvas.height);
    flat.putImageData(new ImageData(new Uint8ClampedArray(pixels), canvas.width, canvas.height), 0, 0);
  };
}

/** A number from the bits of a half. */
function half(bits) {
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  const sign = bits & 0x8000 ? -1 : 1;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24);
}

/** Red, green and blue of an rgba16float texture. */
async function read(device, gpuTexture) {
  const row = 256 * Math.ceil((8 * width) / 256);
  const buffer = device.createBuffer({ size: row * height, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture: gpuTexture }, { buffer, bytesPerRow: row }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await buffer.mapAsync(GPUMapMode.READ);
  const all = new Uint16Array(buffer.getMappedRange());
  const values = new Float32Array(3 * width * height);
  for (let i = 0; i < width * height; i++) {
    const at = Math.floor(i / width) * (row / 2) + 4 * (i % width);
    for (let c = 0; c < 3; c++) values[3 * i + c] = half(all[at + c]);
  }
  buffer.destroy();
  return values;
}

/** Relative squared error of the noisy and of the denoised picture against this frame at many paths a pixel, all over the pixel. */
async function score(device, { tracer, trace, drawGBuffer, output, emission, albedo, paths }) {
  const denoised = await read(device, output.composite);
  const picture = async () => {
    const [direct, weight] = [await read(device, emission), await read(device, albedo)];
    const [matte, glossy] = [await read(device, tracer.matte), await read(device, tracer.glossy)];
    return direct.map((v, i) => v + (matte[i] + glossy[i]) * weight[i]);
  };
  const noisy = await picture();
  const sum = new Float32Array(noisy.length);
  for (let round = 0; round < JITTERS; round++) {
    drawGBuffer(jitterOf(round));
    const encoder = device.createCommandEncoder();
    trace(encoder, 1e6 + round, Math.ceil(paths / JITTERS));
    device.queue.submit([encoder.finish()]);
    (await picture()).forEach((v, i) => { sum[i] += v / JITTERS; });
  }
  // The worst hundredth is left out, as in quell's own figures.
  const error = (picture) => {
    const each = Array.from(picture, (v, i) => (v - sum[i]) ** 2 / (sum[i] ** 2 + 0.01)).sort((a, b) => a - b);
    const kept = each.slice(0, Math.floor(0.99 * each.length));
    return kept.reduce((total, v) => total + v, 0) / kept.length;
  };
  const mean = (picture) => picture.reduce((total, v) => total + v, 0) / picture.length;
  return { noisy: error(noisy), denoised: error(denoised), energy: mean(denoised) / mean(sum), finite: denoised.every(Number.isFinite) };
}

function fail(error) {
  state.failed ??= error.message;
  says.textContent = error.message;
}

run().catch(fail).finally(() => { state.done = true; });
