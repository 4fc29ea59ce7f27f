// Programs: what a frame does, as data. Those of the package, and those of a folder that `quell shaders DIR` wrote.

import made from "../made/programs.js";
import { QuellError, shown } from "./error.js";
import { planned } from "./plan.js";

/** The shaders' texts are stored as blocks, since they share most of them. */
const text = (shader) => shader.map((block) => made.blocks[block]).join("\n\n");

/** The pass that draws debug views. */
const debug = { ...made.debug, label: "debug", code: () => text(made.shaders[made.debug.shader]) };

/** The package's program for these stages. */
export function builtIn(settings, signals, jitter) {
  const { dispatches, outputs } = planned(settings, signals, jitter);
  // What a pass reads of the frame before has two copies, whatever it has in other programs.
  const isRemembered = ({ name }) => dispatches.some(({ bound }) => bound.some(({ resource, copy }) => resource === name && copy === "before"));
  const remembered = (resource) => (isRemembered(resource) ? { ...resource, role: "persistent", copies: 2 } : resource);
  return finished({
    // Settings that choose the same passes with the same bindings need nothing new.
    identity: JSON.stringify(dispatches),
    structs: made.structs,
    resources: Object.values(made.resources).map(remembered),
    dispatches: dispatches.map(({ pass, bound }) => {
      const { shader, bindings, ...of } = made.passes[pass];
      const each = bound.values();
      const complete = bindings.map((binding) => (binding.kind === "uniform" ? binding : { ...binding, ...each.next().value }));
      const [name] = pass.split(", ");
      return { ...of, name, shader, label: name, bindings: complete, code: () => text(made.shaders[shader]) };
    }),
    outputs,
    debug,
  });
}

/** Leaves out the resources that no dispatch binds. */
function finished(program) {
  const bound = new Set(program.dispatches.flatMap(({ bindings }) => bindings.map(({ resource }) => resource)));
  const kept = program.resources.filter(({ name }) => bound.has(name));
  const standIns = new Set(["absent float", ...kept.map((resource) => resource.if_absent)]);
  const resources = program.resources.filter(({ name }) => bound.has(name) || standIns.has(name));
  return { ...program, resources: new Map(resources.map((resource) => [resource.name, resource])) };
}

const got = async (url, as) => {
  const response = await fetch(url);
  if (!response.ok) throw new QuellError("folder", String(url), `has no such file: ${url} (${response.status})`);
  return response[as]();
};

/**
 * A program from the files of `quell shaders DIR`: for settings that the package has no program for, other storage, passes one
 * by one. Its settings are the ones that it was written with, for images of the height that it was written for.
 * @param {string | URL} folder  with a slash at the end
 */
export async function loadProgram(folder) {
  const base = new URL(folder, globalThis.location?.href);
  const manifest = await got(new URL("manifest.json", base), "json");
  if (manifest.format !== made.format) {
    throw new QuellError("manifest.format", manifest.format, `is ${shown(manifest.format)}, not ${made.format}`);
  }
  const values = (name) => manifest.uniforms.find((uniform) => uniform.name === name)?.values;
  if (!values("prepare")) {
    throw new QuellError("manifest", manifest.uniforms.map((u) => u.name), "is for packed guides: leave out `--guides packed`");
  }
  const dispatches = await Promise.all(manifest.dispatches.map(async ({ file, ...dispatch }) => {
    const code = await got(new URL(file, base), "text");
    return { ...dispatch, shader: file, label: file, code: () => code };
  }));
  const views = manifest.debug && await got(new URL(manifest.debug.file, base), "text");
  const taps = manifest.resources.filter(({ role }) => role === "taps");
  const tables = await Promise.all(taps.map(async ({ name, file, bytes, period }) => [
    name, { all: await got(new URL(file, base), "arrayBuffer"), bytes, period },
  ]));
  const { composite, ...settings } = values("settings");
  return finished({
    identity: String(base),
    structs: manifest.structs,
    resources: manifest.resources,
    dispatches,
    outputs: manifest.outputs,
    debug: views && { ...manifest.debug, shader: manifest.debug.file, label: "debug", code: () => views },
    signals: ["matte", "glossy"].filter((signal) => composite[signal] !== 0),
    rows: manifest.size.height,
    settings,
    tables: new Map(tables),
  });
}

/** `width`, `ceil(width / 8)`, `1`. */
export function formula(words, extent) {
  const quotient = /^ceil\((\w+) \/ (\w+)\)$/.exec(words);
  if (quotient) return Math.ceil(formula(quotient[1], extent) / formula(quotient[2], extent));
  if (words === "width") return extent[0];
  if (words === "height") return extent[1];
  if (/^\d+$/.test(words)) return Number(words);
  throw new QuellError("manifest", words, `has the unknown formula ${shown(words)}`);
}

/** Writes the members of a struct at their offsets. */
function fill(structs, name, values, view, start = 0) {
  for (const member of structs[name].members) {
    const value = values[member.name];
    if (value === undefined) throw new QuellError(`${name}.${member.name}`, value, "has no value");
    const at = start + member.offset;
    const each = (numbers, write) => [numbers].flat().forEach((v, i) => view[write](at + 4 * i, v, true));
    if (/^(f32|vec[234]f)$/.test(member.type)) each(value, "setFloat32");
    else if (/^(u32|vec[234]u)$/.test(member.type)) each(value, "setUint32");
    else if (/^(i32|vec[234]i)$/.test(member.type)) each(value, "setInt32");
    else if (/^array<vec3f, \d+>$/.test(member.type)) {
      // Each element takes the place of four numbers.
      value.forEach((row, i) => row.forEach((v, k) => view.setFloat32(at + 16 * i + 4 * k, v, true)));
    } else fill(structs, member.type, value, view, at);
  }
}

/** The bytes of a struct. */
export function packed(structs, name, values) {
  const bytes = new ArrayBuffer(structs[name].bytes);
  fill(structs, name, values, new DataView(bytes));
  return new Uint8Array(bytes);
}

/** A dispatch's binding, as a layout of bindings describes it. */
export function layoutEntry(binding) {
  const entry = { binding: binding.binding, visibility: GPUShaderStage.COMPUTE };
  switch (binding.kind) {
    case "uniform": return { ...entry, buffer: { type: "uniform" } };
    case "read-only-storage": return { ...entry, buffer: { type: "read-only-storage" } };
    case "storage": return { ...entry, buffer: { type: "storage" } };
    case "texture": return { ...entry, texture: { sampleType: binding.sample_type } };
    case "storage_texture": return { ...entry, storageTexture: { access: binding.access, format: binding.format } };
    default: throw new QuellError("manifest", binding.kind, `has the unknown kind of binding ${shown(binding.kind)}`);
  }
}
