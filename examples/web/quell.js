// A denoiser out of the files of `quell shaders DIR`, for any WebGPU device: it reads manifest.json, compiles, makes what
// has to be made, and encodes a frame's dispatches into the page's own command encoder (docs/shaders.md).
//
//   const denoiser = await Denoiser.load(device, "quell-shaders/", [width, height]);
//   denoiser.input("matte input", texture);            // once, or whenever another texture is to be read
//   denoiser.begin(index, { frame, prepare });         // every frame: what the structs of the manifest are told
//   denoiser.encode(encoder);                          // the page submits; one frame a submit
//   denoiser.output("composite");                      // the texture that holds it then

/** A manifest of another layout is refused. */
const FORMAT = 1;

async function got(url, as) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status}`);
  return response[as]();
}

/** `width`, `ceil(width / 8)`, `1`. */
export function formula(text, extent) {
  const quotient = /^ceil\((\w+) \/ (\w+)\)$/.exec(text);
  if (quotient) return Math.ceil(formula(quotient[1], extent) / formula(quotient[2], extent));
  if (text === "width") return extent[0];
  if (text === "height") return extent[1];
  if (/^\d+$/.test(text)) return Number(text);
  throw new Error(`unknown formula "${text}"`);
}

/** Writes the members of a struct at their offsets. */
function fill(structs, name, values, view, start = 0) {
  for (const member of structs[name].members) {
    const value = values[member.name];
    if (value === undefined) throw new Error(`${name}.${member.name} has no value`);
    const at = start + member.offset;
    const each = (numbers, write) => [numbers].flat().forEach((v, i) => view[write](at + 4 * i, v, true));
    if (/^(f32|vec[234]f)$/.test(member.type)) each(value, "setFloat32");
    else if (/^(u32|vec[234]u)$/.test(member.type)) each(value, "setUint32");
    else if (/^array<vec3f, \d+>$/.test(member.type)) {
      // Each element takes the place of four numbers.
      value.forEach((row, i) => row.forEach((v, k) => view.setFloat32(at + 16 * i + 4 * k, v, true)));
    } else fill(structs, member.type, value, view, at);
  }
}

function layoutEntry(binding) {
  const entry = { binding: binding.binding, visibility: GPUShaderStage.COMPUTE };
  switch (binding.kind) {
    case "uniform": return { ...entry, buffer: { type: "uniform" } };
    case "read-only-storage": return { ...entry, buffer: { type: "read-only-storage" } };
    case "storage": return { ...entry, buffer: { type: "storage" } };
    case "texture": return { ...entry, texture: { sampleType: binding.sample_type } };
    case "storage_texture": return { ...entry, storageTexture: { access: binding.access, format: binding.format } };
    default: throw new Error(`unknown kind of binding "${binding.kind}"`);
  }
}

/** Compiles; whatever the browser's compiler says, a warning too, is an error. */
export async function compiled(device, label, code) {
  const module = device.createShaderModule({ label, code });
  const { messages } = await module.getCompilationInfo();
  if (messages.length > 0) {
    const said = messages.map((m) => `${label}:${m.lineNum}:${m.linePos}: ${m.type}: ${m.message}`);
    throw new Error(said.join("\n"));
  }
  return module;
}

export class Denoiser {
  /** Reads the manifest in the folder `base` and makes everything for frames of `extent`. */
  static async load(device, base, extent) {
    const manifest = await got(`${base}manifest.json`, "json");
    if (manifest.format !== FORMAT) throw new Error(`manifest of format ${manifest.format}, not ${FORMAT}`);
    const denoiser = new Denoiser(device, manifest, extent);
    device.pushErrorScope("validation");
    device.pushErrorScope("out-of-memory");
    await denoiser.#make(base);
    for (const error of [await device.popErrorScope(), await device.popErrorScope()]) {
      if (error) throw new Error(error.message);
    }
    return denoiser;
  }

  constructor(device, manifest, extent) {
    this.device = device;
    this.manifest = manifest;
    this.extent = extent;
    this.turn = 0;
    this.resources = new Map(manifest.resources.map((resource) => [resource.name, resource]));
    this.textures = new Map(); // copies of each own texture
    this.buffers = new Map();
    this.tables = new Map();
    this.inputs = new Map();
    this.dispatches = [];
    this.groups = [[], []]; // of each turn
  }

  async #make(base) {
    const usage = { copy: GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC };
    const buffer = (label, size, kind) => this.device.createBuffer({ label, size, usage: kind | usage.copy });
    for (const uniform of this.manifest.uniforms) {
      const size = this.manifest.structs[uniform.struct].bytes;
      this.buffers.set(uniform.name, buffer(uniform.name, size, GPUBufferUsage.UNIFORM));
    }
    for (const resource of this.manifest.resources) {
      const { name, role, kind } = resource;
      if (role === "input") continue;
      if (kind === "buffer") {
        this.buffers.set(name, buffer(name, resource.bytes, GPUBufferUsage.STORAGE));
        if (role === "taps") this.tables.set(name, await got(base + resource.file, "arrayBuffer"));
      } else {
        const copies = Array.from({ length: resource.copies ?? 1 }, () => this.#texture(resource));
        this.textures.set(name, copies);
      }
    }
    this.dispatches = await Promise.all(this.manifest.dispatches.map(async (described) => {
      const { name, file, entry_point: entryPoint, workgroups, bindings } = described;
      const module = await compiled(this.device, file, await got(base + file, "text"));
      const layout = this.device.createBindGroupLayout({ label: name, entries: bindings.map(layoutEntry) });
      const pipeline = await this.device.createComputePipelineAsync({
        label: name,
        layout: this.device.createPipelineLayout({ label: name, bindGroupLayouts: [layout] }),
        compute: { module, entryPoint },
      });
      return { name, layout, pipeline, bindings, workgroups: workgroups.map((f) => formula(f, this.extent)) };
    }));
  }

  #texture({ name, role, format, width, height }) {
    const { TEXTURE_BINDING, STORAGE_BINDING, COPY_SRC, COPY_DST } = GPUTextureUsage;
    // What stands in for an input that is not there is only read.
    const written = role === "absent" ? 0 : STORAGE_BINDING | COPY_SRC | COPY_DST;
    const size = [formula(width, this.extent), formula(height, this.extent)];
    return this.device.createTexture({ label: name, size, format, usage: TEXTURE_BINDING | written });
  }

  /** Names a texture of the page's for a resource of the role `input`; null: there is none. */
  input(name, texture) {
    if (this.inputs.get(name) === texture) return;
    this.inputs.set(name, texture);
    this.groups = [[], []];
  }

  /** Own textures that the page fills, such as those of the role `guides`: after `begin`, before the frame is submitted. */
  texture(name) {
    const copies = this.textures.get(name);
    return copies && copies[this.turn % copies.length];
  }

  /** The texture that holds an output once the frame has run; undefined: this program has no such output. */
  output(name) {
    return this.texture(this.manifest.outputs[name]);
  }

  /**
   * Begins the frame of this number.
   * @param told  what uniforms hold that the manifest gives no values for, by their names: { frame: {..}, prepare: {..} }
   */
  begin(index, told) {
    this.turn = 1 - this.turn;
    this.index = index;
    this.told = told;
  }

  /** Encodes the frame's dispatches. */
  encode(encoder) {
    for (const { name, struct, values } of this.manifest.uniforms) {
      const bytes = new ArrayBuffer(this.manifest.structs[struct].bytes);
      const all = { there: this.#there(), ...values, ...this.told[name] };
      fill(this.manifest.structs, struct, all, new DataView(bytes));
      this.device.queue.writeBuffer(this.buffers.get(name), 0, bytes);
    }
    for (const [name, table] of this.tables) {
      const { bytes, period } = this.resources.get(name);
      const start = (((this.index % period) + period) % period) * bytes;
      this.device.queue.writeBuffer(this.buffers.get(name), 0, table, start, bytes);
    }
    for (const { name, role } of this.manifest.resources) {
      if (role === "counts") encoder.clearBuffer(this.buffers.get(name));
    }
    const pass = encoder.beginComputePass({ label: "quell" });
    this.dispatches.forEach((dispatch, k) => {
      pass.setPipeline(dispatch.pipeline);
      pass.setBindGroup(0, (this.groups[this.turn][k] ??= this.#group(dispatch)));
      pass.dispatchWorkgroups(...dispatch.workgroups);
    });
    pass.end();
  }

  /** Which of the inputs that may be absent there are. */
  #there() {
    const bits = ({ name, there }) => (this.inputs.get(name) ? (there ?? 0) : 0);
    return this.manifest.resources.reduce((all, resource) => all | bits(resource), 0);
  }

  #group({ name, layout, bindings }) {
    const entries = bindings.map((binding) => {
      const source = binding.kind === "uniform" ? binding.uniform : binding.resource;
      const buffer = this.buffers.get(source);
      if (buffer) return { binding: binding.binding, resource: { buffer } };
      return { binding: binding.binding, resource: this.#bound(source, binding.copy === "before").createView() };
    });
    return this.device.createBindGroup({ label: name, layout, entries });
  }

  #bound(name, before) {
    const copies = this.textures.get(name);
    if (copies) return copies[(this.turn + (before ? 1 : 0)) % copies.length];
    const texture = this.inputs.get(name);
    if (texture) return texture;
    const standIn = this.resources.get(name)?.if_absent;
    if (!standIn) throw new Error(`"${name}" is needed, but no texture was given for it`);
    return this.#bound(standIn, false);
  }

  /** Gives the memory back. */
  destroy() {
    for (const copies of this.textures.values()) copies.forEach((texture) => texture.destroy());
    for (const buffer of this.buffers.values()) buffer.destroy();
  }
}
