// What TypeScript must take, and what it must refuse; test/pack.sh checks it with `tsc --strict` against the installed package.

import {
  CONVENTIONS, Denoiser, QuellError, loadProgram, multiplied,
  type Camera, type Convention, type DebugView, type DenoiserOptions, type Frame, type Output, type Preset, type Settings, type Textures,
} from "quell-denoise";

export async function host(device: GPUDevice, encoder: GPUCommandEncoder, given: Record<"matte" | "glossy" | "depth" | "orm", GPUTexture>) {
  const preset: Preset = "quality";
  const settings: Settings = { "firefly.threshold": 3, "pipeline.feedback": "firefly", "matte_temporal.clip": "sigma", "matte_bilateral.enabled": false };
  const options: DenoiserOptions = { width: 64, height: 36, preset, settings, signals: ["matte", "glossy"], jitter: true, views: true };
  const denoiser: Denoiser = await Denoiser.create(device, options);
  const camera: Camera = { clipFromWorld: multiplied(new Float32Array(16), [1, 2, 3]), jitter: [0.1, -0.2] };
  const textures: Textures = { matte: given.matte, glossy: given.glossy, roughness: { texture: given.orm, channel: "g" } };
  const convention: Convention = { ...CONVENTIONS.three, normal: "octahedral" };
  const frame: Frame = { camera, previousCamera: camera, textures, convention, index: 7 };
  const output: Output = denoiser.encode(encoder, frame);
  const composite: GPUTexture = output.composite;
  const repairs: GPUBuffer | null = output.repairs;
  denoiser.encode(encoder, { camera, textures, convention: { depth: "device" } });
  await denoiser.configure({ "edge.monotone": true });
  denoiser.resize(denoiser.width, denoiser.height);
  const view: DebugView = "motion_error";
  denoiser.encodeView(encoder, view, given.orm, { scale: 2, pixel: [3, 4] });
  denoiser.reset();
  const names: (keyof Settings)[] = Denoiser.parameters().map((p) => p.name);
  const ranges = Denoiser.parameters().map((p) => (p.kind === "choice" ? p.choices : p.kind === "switch" ? [] : [p.low, p.high]));
  const own = await Denoiser.create(device, { width: 64, height: 36, program: await loadProgram("shaders/") });
  own.destroy();
  try {
    // @ts-expect-error no such choice
    await denoiser.configure({ "matte_temporal.clip": "round" });
    // @ts-expect-error no such preset
    await Denoiser.create(device, { width: 64, height: 36, preset: "fast" });
    // @ts-expect-error no such parameter
    await denoiser.configure({ "firefly.treshold": 3 });
    // @ts-expect-error no such texture
    denoiser.encode(encoder, { camera, textures: { normals: given.depth } });
    // @ts-expect-error made by `create`
    new Denoiser();
  } catch (error) {
    if (error instanceof QuellError) return error.quantity;
  }
  return { composite, repairs, names, ranges };
}
