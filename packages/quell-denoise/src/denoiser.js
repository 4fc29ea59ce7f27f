// The denoiser: makes what a program needs on the host's device, and encodes its dispatches into the host's encoder. It never
// submits, reads back or asks for a feature or a limit beyond WebGPU's defaults (docs/javascript.md).

import { View, frameStruct, taken } from "./camera.js";
import { conventionOf, prepareStruct } from "./convention.js";
import { QuellError, checkNames, likely, shown } from "./error.js";
import { builtIn, formula, layoutEntry, packed } from "./program.js";
import { PHASES, allTaps } from "./spiral.js";
import { TAPS, changed, parameters, preset, settingsStruct } from "./settings.js";
import { compositeStruct, takenTarget, takenTextures, viewOf } from "./textures.js";

const OPTIONS = ["width", "height", "preset", "settings", "signals", "jitter", "convention", "program", "views", "label"];
const VIEW = ["scale", "pixel"];
const FRAME = ["camera", "previousCamera", "textures", "index", "convention"];
const SIGNALS = ["matte", "glossy"];
/** What `create` alone can hand to the constructor. */
const MADE = Symbol("made");

/**
 * What `make` makes, once the device has said that it could. Errors of what the host does meanwhile stay the host's: the scopes are
 * closed before anything is awaited.
 */
async function scoped(device, quantity, make) {
  device.pushErrorScope("validation");
  device.pushErrorScope("out-of-memory");
  const made = make();
  const errors = await Promise.all([device.popErrorScope(), device.popErrorScope()]);
  const error = errors.find((e) => e);
  return { made, error: error && new QuellError(quantity, error.message, `could not be made: ${error.message}`) };
}

/** Compiles. A compiler's warnings are for quell's tests, not for a program that uses it. */
async function compiled(device, label, code) {
  const { made: module, error } = await scoped(device, `shader ${label}`, () => device.createShaderModule({ label, code }));
  const { messages } = await module.getCompilationInfo();
  const errors = messages.filter((m) => m.type === "error");
  if (errors.length > 0) {
    const said = errors.map((m) => `${label}:${m.lineNum}:${m.linePos}: ${m.type}: ${m.message}`);
    throw new QuellError(`shader ${label}`, label, `does not compile: ${said.join("\n")}`);
  }
  if (error) throw error;
  return module;
}

function extentOf(device, width, height) {
  const most = device.limits.maxTextureDimension2D;
  for (const [name, value] of Object.entries({ width, height })) {
    if (!Number.isInteger(value) || value < 1 || value > most) {
      throw new QuellError(name, value, `is ${shown(value)}, not a whole number from 1 to ${most}, the device's limit`);
    }
  }
  return [width, height];
}

export class Denoiser {
  #device;
  #label;
  #extent;
  #settings;
  #signals;
  #jitter;
  #convention;
  #program;
  /** The host gave the program. */
  #isGiven;
  #kernels = new Map();
  #dispatches = [];
  /** The pass of debug views; null: not asked for. */
  #views = null;
  /** Of the current extent: copies of each texture, buffers, tables of taps. */
  #own = null;
  #turn = 0;
  #last = null;
  /** The last `configure`, which the next one waits for. */
  #configured = Promise.resolve();
  #isDestroyed = false;

  constructor(key) {
    if (key !== MADE) throw new QuellError("Denoiser", key, "is made by `await Denoiser.create(device, options)`");
  }

  /**
   * Compiles the stages and makes their textures on the host's device.
   * @throws {QuellError} an option out of its range; what the device refuses, out of memory among it
   */
  static async create(device, options) {
    if (typeof device?.createComputePipelineAsync !== "function") {
      throw new QuellError("device", device, `is ${shown(device)}, not a GPUDevice`);
    }
    checkNames("options", options, OPTIONS);
    const denoiser = new Denoiser(MADE);
    denoiser.#device = device;
    denoiser.#label = options.label ?? "quell";
    denoiser.#extent = extentOf(device, options.width, options.height);
    denoiser.#convention = conventionOf(options.convention ?? "quell");
    const { program, jitter = false, views = false } = options;
    const signals = options.signals ?? program?.signals ?? SIGNALS;
    if (!Array.isArray(signals) || signals.length === 0 || !signals.every((s, i) => SIGNALS.includes(s) && signals.indexOf(s) === i)) {
      throw new QuellError("signals", signals, `is ${shown(signals)}, not a list of matte, glossy or both`);
    }
    for (const [name, value] of Object.entries({ jitter, views })) {
      if (typeof value !== "boolean") throw new QuellError(name, value, `is ${shown(value)}, not true or false`);
    }
    denoiser.#signals = SIGNALS.filter((signal) => signals.includes(signal));
    if (program) {
      for (const name of ["preset", "settings", "jitter"]) {
        if (options[name] !== undefined) {
          throw new QuellError(name, options[name], "is given beside a program, which was written with its own");
        }
      }
      if (!(program.resources instanceof Map)) {
        throw new QuellError("program", program, `is ${shown(program)}, not what loadProgram gave`);
      }
      if (denoiser.#signals.join() !== program.signals.join()) {
        throw new QuellError("signals", signals, `is ${shown(signals)}, but the program is for ${shown(program.signals)}`);
      }
      checkRows(program, denoiser.#extent);
    }
    denoiser.#isGiven = Boolean(program);
    denoiser.#jitter = jitter;
    denoiser.#settings = changed(preset(options.preset ?? "quality"), options.settings ?? {});
    denoiser.#program = program ?? builtIn(denoiser.#settings, denoiser.#signals, jitter);
    denoiser.#dispatches = await denoiser.#compiled(denoiser.#program);
    if (views) {
      const { debug } = denoiser.#program;
      if (!debug) throw new QuellError("views", views, "is true, but the program's files have no debug views: write them anew");
      denoiser.#views = { ...debug, ...(await denoiser.#kernel(debug)) };
    }
    denoiser.#own = await denoiser.#scopedMake(denoiser.#program, denoiser.#settings);
    return denoiser;
  }

  /** Every parameter of the stages: name, kind, range or choices, default, unit, meaning. */
  static parameters() {
    return parameters();
  }

  get width() {
    return this.#extent[0];
  }

  get height() {
    return this.#extent[1];
  }

  /** The value of every parameter; null: the program was written with its own. */
  get settings() {
    return this.#isGiven ? null : { ...this.#settings };
  }

  get signals() {
    return [...this.#signals];
  }

  /** Bytes of the textures and tables that the denoiser holds on the device. */
  get bytes() {
    return this.#own?.bytes ?? 0;
  }

  #alive() {
    if (this.#isDestroyed) throw new QuellError("denoiser", this, "was destroyed");
  }

  /** The kernels of a program; each is compiled once. */
  #compiled(program) {
    return Promise.all(program.dispatches.map(async (dispatch) => {
      // Passes may share a shader, each with an entry point of its own.
      const key = `${dispatch.shader}: ${dispatch.entry_point}`;
      this.#kernels.set(key, this.#kernels.get(key) ?? this.#kernel(dispatch));
      try {
        return { ...dispatch, ...(await this.#kernels.get(key)) };
      } catch (error) {
        this.#kernels.delete(key);
        throw error;
      }
    }));
  }

  async #kernel({ label, code, entry_point: entryPoint, bindings }) {
    const module = await compiled(this.#device, `${this.#label} ${label}`, code());
    const layout = this.#device.createBindGroupLayout({ label, entries: bindings.map(layoutEntry) });
    const pipeline = await this.#device.createComputePipelineAsync({
      label,
      layout: this.#device.createPipelineLayout({ label, bindGroupLayouts: [layout] }),
      compute: { module, entryPoint },
    });
    return { layout, pipeline };
  }

  async #scopedMake(program, settings) {
    const quantity = `memory for frames of ${this.width}x${this.height}`;
    const { made, error } = await scoped(this.#device, quantity, () => this.#make(program, settings, this.#extent));
    if (error) {
      free(made);
      throw error;
    }
    return made;
  }

  /** Textures, buffers and tables for a program and an extent. */
  #make(program, settings, extent) {
    const device = this.#device;
    const { COPY_DST, COPY_SRC, UNIFORM, STORAGE } = GPUBufferUsage;
    const own = { textures: new Map(), buffers: new Map(), tables: new Map(), groups: [new Map(), new Map()], bytes: 0 };
    const buffer = (name, size, usage) => {
      own.bytes += size;
      return device.createBuffer({ label: `${this.#label} ${name}`, size, usage });
    };
    for (const [name, struct] of [["frame", "Frame"], ["settings", "Settings"], ["prepare", "Prepare"]]) {
      own.buffers.set(name, buffer(name, program.structs[struct].bytes, UNIFORM | COPY_DST));
    }
    for (const resource of program.resources.values()) {
      const { name, role, kind } = resource;
      if (role === "input") continue;
      if (role === "taps") {
        const table = program.tables?.get(name) ?? madeTable(name, settings, extent[1]);
        const all = buffer(`${name} of all frames`, table.all.byteLength, COPY_SRC | COPY_DST);
        device.queue.writeBuffer(all, 0, table.all);
        own.tables.set(name, { ...table, all });
        own.buffers.set(name, buffer(name, table.bytes, STORAGE | COPY_DST));
      } else if (kind === "buffer") {
        own.buffers.set(name, buffer(name, resource.bytes, STORAGE | COPY_DST | COPY_SRC));
      } else {
        const size = [formula(resource.width, extent), formula(resource.height, extent)];
        const copies = resource.copies ?? 1;
        own.bytes += copies * size[0] * size[1] * (resource.bytes_per_texel ?? 4);
        own.textures.set(name, Array.from({ length: copies }, () => this.#texture(resource, size)));
      }
    }
    return own;
  }

  #texture({ name, role, format }, size) {
    const { TEXTURE_BINDING, STORAGE_BINDING, COPY_SRC } = GPUTextureUsage;
    // What stands in for a texture that is not there is only read.
    const written = role === "absent" ? 0 : STORAGE_BINDING | COPY_SRC;
    return this.#device.createTexture({ label: `${this.#label} ${name}`, size, format, usage: TEXTURE_BINDING | written });
  }

  /**
   * Changes settings. History is kept, unless other stages run or read other images then: what is missing is compiled, and the next
   * frame starts afresh. After an error the old settings stay.
   */
  configure(settings) {
    this.#configured = this.#configured.catch(() => {}).then(() => this.#configure(settings));
    return this.#configured;
  }

  async #configure(settings) {
    this.#alive();
    if (this.#isGiven) {
      throw new QuellError("settings", settings, "cannot change: the program was written with its own");
    }
    const next = changed(this.#settings, settings);
    const program = builtIn(next, this.#signals, this.#jitter);
    if (program.identity === this.#program.identity) {
      this.#retable(next);
      this.#settings = next;
      return;
    }
    const dispatches = await this.#compiled(program);
    for (;;) {
      this.#alive();
      const extent = this.#extent;
      const own = await this.#scopedMake(program, next);
      // The host may have resized or destroyed it meanwhile.
      if (!this.#isDestroyed && extent === this.#extent) {
        free(this.#own);
        [this.#program, this.#dispatches, this.#own, this.#last, this.#settings] = [program, dispatches, own, null, next];
        return;
      }
      free(own);
    }
  }

  /** Tables of taps for other settings; the old ones stay for frames that were encoded and not submitted. */
  #retable(settings) {
    for (const [name, old] of this.#own.tables) {
      const { of } = TAPS[name];
      if (JSON.stringify(of(settings)) === JSON.stringify(of(this.#settings))) continue;
      const table = madeTable(name, settings, this.height);
      const { COPY_DST, COPY_SRC, STORAGE } = GPUBufferUsage;
      const label = `${this.#label} ${name}`;
      const all = this.#device.createBuffer({ label: `${label} of all frames`, size: table.all.byteLength, usage: COPY_SRC | COPY_DST });
      this.#device.queue.writeBuffer(all, 0, table.all);
      this.#own.bytes += table.all.byteLength - old.all.size;
      this.#own.tables.set(name, { ...table, all });
      if (table.bytes !== old.bytes) {
        this.#own.bytes += table.bytes - old.bytes;
        this.#own.buffers.set(name, this.#device.createBuffer({ label, size: table.bytes, usage: STORAGE | COPY_DST }));
        this.#own.groups = [new Map(), new Map()];
      }
    }
  }

  /**
   * Changes the size of the frames: history is forgotten, pipelines stay. The same size changes nothing. Submit what was encoded
   * before: its textures are destroyed.
   */
  resize(width, height) {
    this.#alive();
    const extent = extentOf(this.#device, width, height);
    if (extent.join() === this.#extent.join()) return;
    if (this.#isGiven) checkRows(this.#program, extent);
    const own = this.#make(this.#program, this.#settings, extent);
    free(this.#own);
    [this.#own, this.#extent, this.#last] = [own, extent, null];
  }

  /** Forgets history: the next frame starts afresh. */
  reset() {
    this.#alive();
    this.#last = null;
  }

  /** Gives the memory back. Whatever is called afterwards is an error; a second `destroy` does nothing. */
  destroy() {
    if (!this.#isDestroyed) free(this.#own);
    this.#isDestroyed = true;
    this.#own = null;
  }

  /**
   * Appends a frame to the host's encoder. Frames run in the order in which they were encoded; several may be encoded before one
   * submit. An encoder that is thrown away has lost a frame: call `reset`.
   * @throws {QuellError} nothing was encoded then, and history is as it was
   */
  encode(encoder, given) {
    this.#alive();
    if (typeof encoder?.beginComputePass !== "function") {
      throw new QuellError("encoder", encoder, `is ${shown(encoder)}, not a GPUCommandEncoder`);
    }
    const frame = this.#taken(given);
    const uniforms = this.#uniforms(frame);
    this.#turn = 1 - this.#turn;
    this.#upload(encoder, uniforms, frame.index);
    for (const { name, role } of this.#program.resources.values()) {
      if (role === "counts") encoder.clearBuffer(this.#own.buffers.get(name));
    }
    const pass = encoder.beginComputePass({ label: this.#label });
    this.#dispatches.forEach((dispatch, place) => {
      pass.setPipeline(dispatch.pipeline);
      pass.setBindGroup(0, this.#group(dispatch, place, frame.textures));
      pass.dispatchWorkgroups(...dispatch.workgroups.map((words) => formula(words, this.#extent)));
    });
    pass.end();
    // Not the textures: those are the host's to keep or drop.
    this.#last = { index: frame.index, camera: frame.camera, jitter: frame.jitter, view: frame.view };
    return this.#output(frame);
  }

  /** A frame as a host gave it, checked. */
  #taken(given) {
    checkNames("frame", given, FRAME);
    const convention = given.convention === undefined ? this.#convention : conventionOf(given.convention);
    const index = given.index ?? (this.#last ? this.#last.index + 1 : 0);
    if (!Number.isSafeInteger(index)) throw new QuellError("index", index, `is ${shown(index)}, not a whole number`);
    const camera = taken("camera", given.camera);
    // Where the host keeps no camera, the last frame's is the one before; of the first frame its own.
    const previous = given.previousCamera === undefined ? (this.#last?.camera ?? camera) : taken("previousCamera", given.previousCamera);
    if (!this.#isGiven && !this.#jitter && camera.jitter.some((v) => v !== 0)) {
      throw new QuellError("camera.jitter", camera.jitter, `is ${shown(camera.jitter)}, but the denoiser was made with jitter: false`);
    }
    const reads = (resource) => this.#program.resources.has(resource);
    const { textures, channels, has } = takenTextures(given.textures, this.#signals, this.#extent, convention, reads);
    return {
      index,
      camera,
      jitter: camera.jitter,
      previousJitter: previous.jitter,
      view: new View("camera", camera, this.#extent),
      previousView: new View("previousCamera", previous, this.#extent),
      hasGlossyHit: has("glossyHitDistance"),
      hasRoughness: has("roughness"),
      convention,
      textures,
      channels,
      composite: compositeStruct(has),
      before: this.#last && Math.abs(index - this.#last.index) === 1 ? this.#last : null,
    };
  }

  /** The structs that shaders read, by the names of their buffers. */
  #uniforms(frame) {
    const { structs, resources } = this.#program;
    let there = 0;
    for (const [name, { there: bits = 0 }] of resources) if (frame.textures.has(name)) there |= bits;
    const values = {
      frame: ["Frame", frameStruct(frame, frame.before, this.#extent)],
      settings: ["Settings", {
        ...(this.#program.settings ?? settingsStruct(this.#settings, this.height)), composite: frame.composite,
      }],
      prepare: ["Prepare", prepareStruct(
        frame.convention, this.#extent, frame, frame.channels, frame.textures.get("normal")?.format, there,
      )],
    };
    return Object.entries(values).map(([name, [struct, members]]) => [name, packed(structs, struct, members)]);
  }

  /** Uniforms and taps of this frame, brought by the encoder itself: frames that share a submit each find their own. */
  #upload(encoder, uniforms, index) {
    const size = uniforms.reduce((total, [, bytes]) => total + bytes.length, 0);
    const staging = this.#device.createBuffer({
      label: `${this.#label} uniforms of a frame`, size, usage: GPUBufferUsage.COPY_SRC, mappedAtCreation: true,
    });
    const mapped = new Uint8Array(staging.getMappedRange());
    let at = 0;
    const places = uniforms.map(([name, bytes]) => {
      mapped.set(bytes, at);
      at += bytes.length;
      return [name, at - bytes.length, bytes.length];
    });
    staging.unmap();
    for (const [name, from, length] of places) encoder.copyBufferToBuffer(staging, from, this.#own.buffers.get(name), 0, length);
    for (const [name, { all, bytes, period }] of this.#own.tables) {
      const start = (((index % period) + period) % period) * bytes;
      encoder.copyBufferToBuffer(all, start, this.#own.buffers.get(name), 0, bytes);
    }
  }

  /** What a binding has: a buffer, or the copy of a texture that is its turn. */
  #bound(name, before, given) {
    const buffer = this.#own.buffers.get(name);
    if (buffer) return buffer;
    const copies = this.#own.textures.get(name);
    if (copies) return copies[(this.#turn + (before ? 1 : 0)) % copies.length];
    const texture = given.get(name);
    if (texture) return texture;
    return this.#own.textures.get(this.#program.resources.get(name)?.if_absent ?? "absent float")[0];
  }

  /** The bind group of a dispatch: made anew only when another texture is bound than at the same turn before. */
  #group(dispatch, place, given) {
    const bound = dispatch.bindings.map(({ kind, uniform, resource, copy }) => (
      this.#bound(kind === "uniform" ? uniform : resource, copy === "before", given)
    ));
    const groups = this.#own.groups[this.#turn];
    const known = groups.get(place);
    if (known && known.bound.every((resource, i) => resource === bound[i])) return known.group;
    const entries = dispatch.bindings.map(({ binding }, i) => {
      const resource = bound[i];
      return { binding, resource: typeof resource.createView === "function" ? viewOf(resource) : { buffer: resource } };
    });
    const group = this.#device.createBindGroup({ label: `${this.#label} ${dispatch.name}`, layout: dispatch.layout, entries });
    groups.set(place, { bound, group });
    return group;
  }

  /**
   * Draws a debug view of the frame that was encoded last into the host's texture, in the same encoder or a later one.
   * @throws {QuellError} nothing was encoded then
   */
  encodeView(encoder, view, target, options = {}) {
    this.#alive();
    if (typeof encoder?.beginComputePass !== "function") {
      throw new QuellError("encoder", encoder, `is ${shown(encoder)}, not a GPUCommandEncoder`);
    }
    if (!this.#views) throw new QuellError("views", false, "was not asked for: Denoiser.create(device, { ..., views: true })");
    const { views, bindings, workgroups, pipeline, layout } = this.#views;
    if (!Object.hasOwn(views, view)) {
      throw new QuellError("view", view, `is ${shown(view)}${likely(String(view), Object.keys(views))}`);
    }
    if (!this.#last) throw new QuellError("view", view, "has no frame to show: encode one first");
    checkNames("options", options, VIEW);
    const { scale = 1, pixel = [0, 0] } = options;
    if (!(typeof scale === "number" && Number.isFinite(scale) && scale > 0)) {
      throw new QuellError("options.scale", scale, `is ${shown(scale)}, not a number above 0`);
    }
    if (!Array.isArray(pixel) || pixel.length !== 2 || !pixel.every((v, i) => Number.isInteger(v) && v >= 0 && v < this.#extent[i])) {
      throw new QuellError("options.pixel", pixel, `is ${shown(pixel)}, not a pixel of ${this.width}x${this.height}`);
    }
    const picture = bindings.find(({ kind }) => kind === "storage_texture");
    takenTarget("target", target, picture.format, this.#extent);
    const { outputs, structs, settings } = this.#program;
    const own = (name) => {
      const copies = this.#own.textures.get(name);
      return copies?.[this.#turn % copies.length] ?? this.#own.textures.get("absent float")[0];
    };
    const taps = this.#own.buffers.get("matte bilateral taps");
    const buffer = (usage, bytes) => {
      const made = this.#device.createBuffer({ label: `${this.#label} view`, size: bytes.length, usage, mappedAtCreation: true });
      new Uint8Array(made.getMappedRange()).set(bytes);
      made.unmap();
      return made;
    };
    const uniform = packed(structs, "Debug", {
      eye: this.#last.view.eye,
      view: views[view],
      centre: pixel,
      scale,
      taps: taps ? (settings?.matte_bilateral.taps ?? this.#settings["matte_bilateral.taps"]) : 0,
      has_confidence: outputs.confidence ? 1 : 0,
    });
    const chosen = {
      debug: () => buffer(GPUBufferUsage.UNIFORM, uniform),
      image: () => own(view === "light" ? outputs.composite : outputs.confidence),
      history_length: () => own(outputs.history_length),
      spiral: () => taps ?? buffer(GPUBufferUsage.STORAGE, new Uint8Array(16)),
      [picture.name]: () => target,
    };
    const entries = bindings.map(({ binding, name, uniform: of, resource, copy }) => {
      const bound = chosen[name]?.() ?? this.#bound(of ?? resource, copy === "before", new Map());
      return { binding, resource: typeof bound.createView === "function" ? viewOf(bound) : { buffer: bound } };
    });
    const pass = encoder.beginComputePass({ label: `${this.#label} view` });
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, this.#device.createBindGroup({ label: `${this.#label} view`, layout, entries }));
    pass.dispatchWorkgroups(...workgroups.map((words) => formula(words, this.#extent)));
    pass.end();
  }

  #output(frame) {
    const { outputs, resources } = this.#program;
    const texture = (name) => {
      const resource = outputs[name];
      if (!resource) return null;
      const own = this.#own.textures.get(resource);
      // What no stage filters is the host's own.
      return own ? own[this.#turn % own.length] : (frame.textures.get(resource) ?? null);
    };
    const counts = [...resources.values()].find(({ role }) => role === "counts");
    return {
      composite: texture("composite"),
      direct: texture("direct"),
      matte: texture("matte"),
      glossy: texture("glossy"),
      confidence: texture("confidence"),
      historyLength: texture("history_length"),
      repairs: counts ? this.#own.buffers.get(counts.name) : null,
      hadHistory: frame.before !== null,
    };
  }
}

/** Gives back what `make` made. */
function free(own) {
  for (const copies of own.textures.values()) copies.forEach((texture) => texture.destroy());
  for (const buffer of own.buffers.values()) buffer.destroy();
  for (const { all } of own.tables.values()) all.destroy();
}

function checkRows(program, [, height]) {
  if (program.rows !== height) {
    throw new QuellError("height", height, `is ${height}, but the program was written for ${program.rows} rows`);
  }
}

/** The package's own table, for all frames after which it repeats. */
function madeTable(name, settings, rows) {
  const { stage, of } = TAPS[name];
  const all = allTaps(of(settings), stage, rows);
  return { all, bytes: all.byteLength / PHASES, period: PHASES };
}
