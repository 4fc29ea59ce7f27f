// Writes `made/` from the command `quell`: every shader that a choice of signals and stages can need, which program each choice
// is, and the table of parameters. Run it after a change of a shader, a stage's bindings or a parameter:
//
//     node packages/quell-denoise/make.mjs target/release/quell
//
// crates/quell-lab/tests/main/package.rs fails while `made/` is not what that command says.

import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile, mkdir } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

const run = promisify(execFile);
const quell = process.argv[2] ?? process.env.QUELL;
if (!quell) {
  console.error("usage: node make.mjs PATH-TO-QUELL");
  process.exit(2);
}
const here = new URL(".", import.meta.url);

/** What decides which stages run; the order is that of the bits of a program's number. */
const SWITCHES = [
  "matte", "glossy",
  "matte_temporal.enabled", "matte_prefilter.enabled", "disocclusion.enabled", "firefly.enabled", "matte_bilateral.enabled",
  "glossy_temporal.enabled", "glossy_bilateral.enabled", "direct_taa.enabled",
];
/** Switches that count only where their signal is there. */
const OF_SIGNAL = { matte: [2, 3, 4, 5, 6], glossy: [7, 8] };

/** The settings' lengths belong to this height: then a length in pixels is the parameter's own value. */
const SIZE = "1280x720";

function numbers() {
  const all = [];
  for (let bits = 0; bits < 1 << SWITCHES.length; bits++) {
    const [matte, glossy] = [bits & 1, bits & 2];
    if (!matte && !glossy) continue;
    if (!matte && OF_SIGNAL.matte.some((bit) => bits & (1 << bit))) continue;
    if (!glossy && OF_SIGNAL.glossy.some((bit) => bits & (1 << bit))) continue;
    all.push(bits);
  }
  return all;
}

async function manifestOf(bits, folder) {
  const on = (bit) => (bits & (1 << bit)) !== 0;
  const signals = SWITCHES.slice(0, 2).filter((_, bit) => on(bit));
  const dir = join(folder, String(bits));
  const options = ["shaders", dir, "--size", SIZE, "--signals", signals.join(",")];
  SWITCHES.forEach((name, bit) => {
    if (bit >= 2 && name !== "direct_taa.enabled" && !on(bit)) options.push("--set", `${name}=off`);
  });
  // Without jitter the plan has no anti-aliasing of direct light, as with the stage off.
  if (!on(9)) options.push("--no-jitter");
  await run(quell, options);
  const manifest = JSON.parse(await readFile(join(dir, "manifest.json"), "utf8"));
  const texts = new Map();
  for (const { file } of manifest.dispatches) texts.set(file, await readFile(join(dir, file), "utf8"));
  await rm(dir, { recursive: true });
  return { manifest, texts };
}

/** Numbers things by what they are: the same thing has one number. */
class Numbered {
  list = [];
  #known = new Map();
  of(value) {
    const key = JSON.stringify(value);
    if (!this.#known.has(key)) {
      this.#known.set(key, this.list.length);
      this.list.push(value);
    }
    return this.#known.get(key);
  }
}

/** The name of a file without its place in the order. */
const label = (file) => file.replace(/^\d+_/, "").replace(/\.wgsl$/, "");

async function programs(folder) {
  const blocks = new Numbered();
  const shaders = new Numbered();
  const dispatches = new Numbered();
  const outputs = new Numbered();
  const resources = {};
  const programs = {};
  let first;
  for (const bits of numbers()) {
    const { manifest, texts } = await manifestOf(bits, folder);
    first ??= manifest;
    for (const resource of manifest.resources) {
      // What comes out of one program is between stages in another; a host makes both alike.
      const described = { ...resource, role: resource.role === "output" ? "transient" : resource.role };
      // Tables belong to a height: the package makes its own.
      for (const name of ["bytes", "file", "period"]) if (resource.role === "taps") delete described[name];
      const before = resources[resource.name];
      if (before && JSON.stringify(before) !== JSON.stringify(described)) throw new Error(`two kinds of "${resource.name}"`);
      resources[resource.name] = described;
    }
    const listed = manifest.dispatches.map(({ name, file, entry_point, workgroups, bindings }) => {
      const code = texts.get(file).split(/\n\n(?=\S)/).map((block) => blocks.of(block));
      return dispatches.of({ name, shader: shaders.of({ label: label(file), code }), entry_point, workgroups, bindings });
    });
    programs[bits] = { dispatches: listed, outputs: outputs.of(manifest.outputs) };
  }
  return { first, blocks: blocks.list, shaders: shaders.list, dispatches: dispatches.list, outputs: outputs.list, resources, programs };
}

/** A parameter's line of `quell explain`, with its range as numbers or names. */
function parameter({ name, unit, meaning, range, value }) {
  const number = /^a (whole )?number from (\S+) to (\S+)$/.exec(range);
  if (number) {
    const [low, high] = [Number(number[2]), Number(number[3])];
    return { name, kind: number[1] ? "whole" : "number", low, high, default: Number(value), unit, meaning };
  }
  const choice = /^one of (.+)$/.exec(range);
  if (choice) return { name, kind: "choice", choices: choice[1].split(", "), default: value, unit, meaning };
  if (range !== "on or off") throw new Error(`unknown range "${range}"`);
  return { name, kind: "switch", default: value === "on", unit, meaning };
}

function declarations(parameters) {
  const type = { number: () => "number", whole: () => "number", switch: () => "boolean", choice: (p) => p.choices.map((c) => JSON.stringify(c)).join(" | ") };
  const range = (p) => (p.kind === "number" || p.kind === "whole" ? ` From ${p.low} to ${p.high}${p.unit ? `, ${p.unit}` : ""}.` : "");
  const shown = (p) => (p.kind === "choice" ? p.default : p.kind === "switch" ? (p.default ? "true" : "false") : p.default);
  const lines = parameters.map((p) => `  /** ${p.meaning}${range(p)} Default: ${shown(p)}. */\n  ${JSON.stringify(p.name)}?: ${type[p.kind](p)};`);
  return `// Made by make.mjs.\n\n/** Parameters of the stages by name; docs/parameters.md says what each does, and where its value comes from. */\nexport interface Settings {\n${lines.join("\n")}\n}\n`;
}

/** JSON, a line for each element of the first levels: changes are readable, and the file is small. */
function lines(value, depth) {
  if (depth === 0 || value === null || typeof value !== "object") return JSON.stringify(value);
  const list = Array.isArray(value);
  const each = Object.entries(value).map(([key, v]) => (list ? "" : `${JSON.stringify(key)}: `) + lines(v, depth - 1));
  if (each.length === 0) return list ? "[]" : "{}";
  return `${list ? "[" : "{"}\n${each.join(",\n")}\n${list ? "]" : "}"}`;
}

const folder = await mkdtemp(join(tmpdir(), "quell-package-"));
try {
  const { first, ...made } = await programs(folder);
  const explained = JSON.parse((await run(quell, ["explain", "--json"])).stdout);
  const parameters = explained.parameters.map(parameter);
  const settings = first.uniforms.find(({ name }) => name === "settings").values;
  const prepare = first.uniforms.find(({ name }) => name === "prepare").values;
  const all = {
    format: first.format,
    quell: first.quell,
    switches: SWITCHES,
    // What no parameter and no convention says.
    constants: { farthest_bent_px: settings.mirror.farthest_bent_px, unit_tolerance: prepare.unit_tolerance },
    parameters,
    structs: first.structs,
    ...made,
  };
  await mkdir(new URL("made/", here), { recursive: true });
  const head = "// Made by make.mjs from `quell shaders` and `quell explain`. MIT OR Apache-2.0.\n";
  await writeFile(new URL("made/programs.js", here), `${head}export default ${lines(all, 2)};\n`);
  await writeFile(new URL("made/settings.d.ts", here), declarations(parameters));
  const { length } = await readFile(new URL("made/programs.js", here));
  console.log(`${Object.keys(made.programs).length} choices, ${made.shaders.length} shaders, ${length} bytes`);
} finally {
  await rm(folder, { recursive: true, force: true });
}
