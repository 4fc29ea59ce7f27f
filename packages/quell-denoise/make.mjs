// Writes `made/` from the command `quell`: the shader and the bindings of every pass, the resources that passes bind, the table of
// parameters, and the values of the presets. Which passes a choice of signals and settings needs, and what each binds, is
// src/plan.js. Run it after a change of a shader, of what a pass binds, of a parameter or of a preset:
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

/** Presets of the real-time filter; of the first are the parameters' own defaults. */
const PRESETS = ["paper", "quality"];

const paper = (...options) => ["--preset", "paper", ...options];

/** Options of `quell shaders` that together write every pass: fused, each alone, and those that can come first on the host's image. */
const CHOICES = [
  paper(),
  paper("--unfused"),
  ["--preset", "quality"],
  ["--preset", "quality", "--set", "young_filter.glossy_levels=3"],
  // Stage 5's second image has a texture of its own where it is not fed back.
  paper("--set", "pipeline.feedback=temporal"),
  // Without history the first filter that is on reads the host's image.
  ...[[], ["matte_prefilter"], ["matte_prefilter", "firefly"]].map((off) => (
    paper(...["matte_temporal", "glossy_temporal", ...off].flatMap((stage) => ["--set", `${stage}.enabled=off`]))
  )),
];

/** The settings' lengths belong to this height: then a length in pixels is the parameter's own value. */
const SIZE = "1280x720";

async function manifestOf(options, folder) {
  const dir = join(folder, "shaders");
  await run(quell, ["shaders", dir, "--size", SIZE, ...options]);
  const manifest = JSON.parse(await readFile(join(dir, "manifest.json"), "utf8"));
  const texts = new Map();
  for (const { file } of [...manifest.dispatches, manifest.debug]) texts.set(file, await readFile(join(dir, file), "utf8"));
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

/** Has a copy of the frame before in some programs only; src/program.js adds it where a pass binds it. */
const ALTERNATES_IN_SOME = "guides moving";

/** What a host makes for a resource; what only one program knows is left out. */
function described(resource) {
  if (resource.name === ALTERNATES_IN_SOME) return { ...resource, role: "transient", copies: 1 };
  // What comes out of one program is between stages in another; tables of taps belong to a height, and the package makes its own.
  const of = { ...resource, role: resource.role === "output" ? "transient" : resource.role };
  if (resource.role === "taps") for (const name of ["bytes", "file", "period"]) delete of[name];
  return of;
}

/** `value` under `key`, which must not have held another. */
function only(table, key, value) {
  const before = table[key];
  if (before !== undefined && JSON.stringify(before) !== JSON.stringify(value)) throw new Error(`two kinds of "${key}"`);
  table[key] = value;
}

async function passes(folder) {
  const blocks = new Numbered();
  const shaders = new Numbered();
  const passes = {};
  const resources = {};
  const debug = {};
  let first;
  /** The shader's number: of the blocks that it is made of. */
  const shaderOf = (text) => shaders.of(text.split(/\n\n(?=\S)/).map((block) => blocks.of(block)));
  for (const options of CHOICES) {
    const { manifest, texts } = await manifestOf(options, folder);
    first ??= manifest;
    const { file, entry_point, workgroups, bindings, views } = manifest.debug;
    only(debug, "debug", { shader: shaderOf(texts.get(file)), entry_point, workgroups, bindings, views });
    for (const resource of manifest.resources) only(resources, resource.name, described(resource));
    const inputs = new Set(manifest.resources.filter(({ role }) => role === "input").map(({ name }) => name));
    for (const { name, file, entry_point, workgroups, bindings } of manifest.dispatches) {
      const shader = shaderOf(texts.get(file));
      // Colours of the host are repaired where they are loaded. Filters that can come first have another shader for it; stage 11
      // does it always.
      const input = bindings.find((binding) => binding.name === "input");
      const isFirst = name !== "direct_taa" && input !== undefined && inputs.has(input.resource);
      const bound = bindings.map(({ resource, copy, ...binding }) => binding);
      only(passes, isFirst ? `${name}, first` : name, { shader, entry_point, workgroups, bindings: bound });
    }
  }
  // Noisy direct light of a lobe is a colour of the host's like its weight; `quell shaders` writes no program that reads it.
  for (const lobe of ["matte", "glossy"]) {
    only(resources, `direct ${lobe}`, { ...resources[`${lobe} weight`], name: `direct ${lobe}` });
  }
  return { first, made: { passes, ...debug, shaders: shaders.list, blocks: blocks.list, resources } };
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

function declarations(parameters, presets, views) {
  const type = { number: () => "number", whole: () => "number", switch: () => "boolean", choice: (p) => p.choices.map((c) => JSON.stringify(c)).join(" | ") };
  const range = (p) => (p.kind === "number" || p.kind === "whole" ? ` From ${p.low} to ${p.high}${p.unit ? `, ${p.unit}` : ""}.` : "");
  const shown = (p) => (p.kind === "choice" ? p.default : p.kind === "switch" ? (p.default ? "true" : "false") : p.default);
  const lines = parameters.map((p) => `  /** ${p.meaning}${range(p)} Preset paper: ${shown(p)}. */\n  ${JSON.stringify(p.name)}?: ${type[p.kind](p)};`);
  const either = (names) => names.map((name) => JSON.stringify(name)).join(" | ");
  return `// Made by make.mjs.\n\n/** Names of presets. */\nexport type Preset = ${either(presets)};\n\n/** Debug views; docs/integrating.md shows what each looks like. */\nexport type DebugView = ${either(views)};\n\n/** Parameters of the stages by name; docs/parameters.md says what each does, and where its value comes from. */\nexport interface Settings {\n${lines.join("\n")}\n}\n`;
}

/** JSON, a line for each element of the first levels: changes are readable, and the file is small. */
function lines(value, depth) {
  if (depth === 0 || value === null || typeof value !== "object") return JSON.stringify(value);
  const list = Array.isArray(value);
  const each = Object.entries(value).map(([key, v]) => (list ? "" : `${JSON.stringify(key)}: `) + lines(v, depth - 1));
  if (each.length === 0) return list ? "[]" : "{}";
  return `${list ? "[" : "{"}\n${each.join(",\n")}\n${list ? "]" : "}"}`;
}

const explained = async (preset) => JSON.parse((await run(quell, ["explain", "--json", "--preset", preset])).stdout);

const folder = await mkdtemp(join(tmpdir(), "quell-package-"));
try {
  const { first, made } = await passes(folder);
  const parameters = (await explained(PRESETS[0])).parameters.map(parameter);
  // Of each preset the values that are not the default.
  const presets = {};
  for (const name of PRESETS) {
    const values = (await explained(name)).parameters.map(parameter).map((p) => [p.name, p.default]);
    presets[name] = Object.fromEntries(values.filter(([, value], at) => value !== parameters[at].default));
  }
  const settings = first.uniforms.find(({ name }) => name === "settings").values;
  const prepare = first.uniforms.find(({ name }) => name === "prepare").values;
  const all = {
    format: first.format,
    quell: first.quell,
    // What no parameter and no convention says.
    constants: { farthest_bent_px: settings.mirror.farthest_bent_px, unit_tolerance: prepare.unit_tolerance },
    parameters,
    presets,
    structs: first.structs,
    ...made,
  };
  await mkdir(new URL("made/", here), { recursive: true });
  const head = "// Made by make.mjs from `quell shaders` and `quell explain`. MIT OR Apache-2.0.\n";
  await writeFile(new URL("made/programs.js", here), `${head}export default ${lines(all, 2)};\n`);
  await writeFile(new URL("made/settings.d.ts", here), declarations(parameters, PRESETS, Object.keys(made.debug.views)));
  const { length } = await readFile(new URL("made/programs.js", here));
  console.log(`${Object.keys(made.passes).length} passes, ${made.shaders.length} shaders, ${length} bytes`);
} finally {
  await rm(folder, { recursive: true, force: true });
}
