// Runs the examples of docs/javascript.md as they stand there, on textures of a host's; crates/quell-lab/tests/main/package.rs drives it.

import * as quell from "../src/index.js";
import { CAMERA, textures } from "./behaviour.js";

const AsyncFunction = (async () => {}).constructor;

/** What the examples take for granted: a host's device, extent, camera and textures. */
function host(device) {
  const [width, height] = [64, 36];
  const { matte, matteWeight: albedo, glossy, depth, normal } = textures(device, 0, [width, height]);
  const empty = (format) => device.createTexture({ size: [width, height], format, usage: GPUTextureUsage.TEXTURE_BINDING });
  return {
    device, width, height, clipFromWorld: CAMERA.clipFromWorld,
    direct: empty("rgba16float"), matte, albedo, glossy, specular: albedo, depth, normal, motion: empty("rg16float"),
    roughness: empty("r8unorm"), glossyHitDistance: empty("r16float"), depthBuffer: empty("depth24plus"), orm: empty("rgba8unorm"),
  };
}

/** @returns {Promise<{ ran: number, wrong: string[] }>} */
export async function run(device, markdown) {
  const wrong = [];
  device.addEventListener("uncapturederror", (event) => wrong.push(event.error.message));
  const blocks = [...markdown.matchAll(/^```js\n([\s\S]*?)^```$/gm)].map((found) => found[1]);
  for (const block of blocks) {
    const code = block.replace(/^import (\{[^}]*\}) from "quell-denoise";$/gm, "const $1 = quell;");
    const given = host(device);
    const logged = [];
    const console = { log: (...values) => logged.push(values.join(" ")) };
    try {
      await new AsyncFunction("quell", "console", ...Object.keys(given), code)(quell, console, ...Object.values(given));
      await device.queue.onSubmittedWorkDone();
    } catch (error) {
      wrong.push(`${error.stack}\nin\n${code}`);
    }
    // What an example says that it prints.
    for (const [, said] of block.matchAll(/console\.log\(.*\); +\/\/ (.+)$/gm)) {
      if (!logged.includes(said)) wrong.push(`"${said}" was not printed, but ${JSON.stringify(logged.slice(-3))}`);
    }
  }
  return { ran: blocks.length, wrong };
}
