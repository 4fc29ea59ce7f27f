//! The GPU back end for hosts in other languages: its shaders as files, and a manifest that says what to make, to fill, to
//! bind and to dispatch. Both come from the program that [`quell::gpu::Denoiser`] walks (docs/shaders.md).

use quell::gpu::{
    BindingKind, Bound, Contents, Convention, Dispatch, FIRST_BINDING, Holds, Pass, PrepareUniforms, Program, Resource,
    Role, Sample, SettingsUniforms, Slot, Storage, TAP_FRAMES, Texel, Uniform, debug_view_numbers, layouts, pack_taps,
};
use quell::pipeline::Plan;
use quell::{Settings, Size};
use serde_json::{Map, Value, json};

/// Version of the manifest's layout.
pub const FORMAT: u32 = 1;
/// Name of the manifest's file.
pub const MANIFEST: &str = "manifest.json";

/// What a host gets its program for.
#[derive(Clone, Debug)]
pub struct Choice<'a> {
    /// Parameters of the stages.
    pub settings: &'a Settings,
    /// Extent of the images; lengths in pixels among the settings, and the taps, belong to its height.
    pub size: Size,
    /// What a frame has.
    pub contents: Contents,
    /// What the host's guides mean, where they are textures.
    pub convention: Convention,
    /// How planes are stored.
    pub storage: Storage,
    /// Stages that can share a pass do.
    pub fuse: bool,
}

/// A file: its name and what it holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Within the folder of the manifest.
    pub name: String,
    /// Text or binary.
    pub bytes: Vec<u8>,
}

/// The pass that draws debug views.
const DEBUG: &str = "debug.wgsl";

/// The shaders of every dispatch and of the debug views, tables of taps, and the manifest, last.
///
/// # Errors
/// A setting out of its range; a size without pixels.
pub fn files(choice: &Choice<'_>) -> Result<Vec<File>, quell::Error> {
    choice.settings.check()?;
    if choice.size.pixels() == 0 {
        return Err(quell::Error::EmptySize { size: choice.size });
    }
    let plan = Plan::new(choice.settings, choice.contents.inputs());
    let program = Program::new(&plan, choice.contents, choice.storage, choice.fuse);
    let mut files: Vec<File> = program
        .dispatches
        .iter()
        .enumerate()
        .map(|(index, dispatch)| {
            let source = dispatch.pass.source(program.storage, dispatch.host_input);
            File { name: shader_name(index, dispatch), bytes: source.into_bytes() }
        })
        .collect();
    for resource in program.resources.iter().filter(|r| r.role == Role::Taps) {
        let frames = 0..TAP_FRAMES as i64;
        let bytes = frames.flat_map(|frame| pack_taps(choice.settings, resource.slot, choice.size.height, frame));
        files.push(File { name: taps_name(resource.slot), bytes: bytes.collect() });
    }
    let [debug, _] = Pass::DEBUG;
    files.push(File { name: DEBUG.to_owned(), bytes: debug.source(program.storage, false).into_bytes() });
    let manifest = manifest(choice, &program);
    files.push(File { name: MANIFEST.to_owned(), bytes: format!("{manifest:#}\n").into_bytes() });
    Ok(files)
}

fn manifest(choice: &Choice<'_>, program: &Program) -> Value {
    let structs = layouts();
    let mut used = vec!["Frame", "Settings", "SpiralTap", "Debug"];
    let mut uniforms = vec![json!({ "name": "frame", "binding": 0, "struct": "Frame" })];
    let settings = SettingsUniforms::of(choice.settings, choice.size, choice.contents).bytes();
    let settings = values(&structs, "Settings", &settings);
    uniforms.push(json!({ "name": "settings", "binding": 1, "struct": "Settings", "values": settings }));
    for resource in &program.resources {
        let Holds::Uniform(of) = resource.holds else { continue };
        used.push(of);
        uniforms.push(prepare(choice, &structs, resource.slot.name(), of));
    }
    let named = |index: usize| program.resources.get(index).map(|r| r.slot.name());
    let shown = program.shown;
    json!({
        "format": FORMAT,
        "quell": env!("CARGO_PKG_VERSION"),
        "size": { "width": choice.size.width, "height": choice.size.height },
        "storage": match program.storage { Storage::Half => "half", Storage::Float => "float" },
        "resources": program.resources.iter().filter(|r| r.role != Role::Uniform).map(|r| resource(choice, program, r)).collect::<Vec<_>>(),
        "structs": reached(&structs, &used).into_iter().map(layout).collect::<Map<_, _>>(),
        "uniforms": uniforms,
        "dispatches": program
            .dispatches
            .iter()
            .enumerate()
            .map(|(index, d)| dispatch(program, index, d))
            .collect::<Vec<_>>(),
        "outputs": {
            "composite": shown.composite.and_then(named),
            "direct": shown.direct.and_then(named),
            "matte": shown.matte.and_then(named),
            "glossy": shown.glossy.and_then(named),
            "confidence": shown.confidence.and_then(named),
            "history_length": shown.length.and_then(named),
        },
        "debug": debug(),
    })
}

/// The pass that draws debug views, and the views by their numbers.
fn debug() -> Value {
    let [pass, _] = Pass::DEBUG;
    let bindings = (FIRST_BINDING..).zip(pass.bindings).map(|(number, binding)| {
        // What it shows besides is the host's to choose: any image, the history length.
        let (slot, before) = match binding.name {
            "geometry" => (Some(Slot::Geometry), false),
            "surface" => (Some(Slot::Surface), false),
            "moving" => (Some(Slot::Moving), false),
            "geometry_before" => (Some(Slot::Geometry), true),
            "surface_before" => (Some(Slot::Surface), true),
            "spiral" => (Some(Slot::BilateralTaps), false),
            _ => (None, false),
        };
        let mut value = json!({ "binding": number, "name": binding.name });
        if let Some(slot) = slot {
            extend(&mut value, json!({ "resource": slot.name(), "copy": if before { "before" } else { "this" } }));
        }
        use BindingKind as Kind;
        let further = match binding.kind {
            Kind::Uniform(_) => json!({ "kind": "uniform", "uniform": binding.name }),
            Kind::Sampled(texel) => json!({ "kind": "texture", "sample_type": sample_type(texel) }),
            Kind::Host(sample) => json!({ "kind": "texture", "sample_type": sample_names(sample).0 }),
            Kind::Taps => json!({ "kind": "read-only-storage" }),
            Kind::Picture(format) => json!({ "kind": "storage_texture", "access": "write-only",
                                             "format": format!("{format:?}").to_lowercase() }),
            // It binds none of these.
            Kind::Stored(_) | Kind::Counts(_) | Kind::Frames | Kind::Read(_) | Kind::Write(_) | Kind::Layers(_) => {
                Value::Null
            }
        };
        extend(&mut value, further);
        value
    });
    json!({
        "file": DEBUG,
        "entry_point": pass.entry,
        "workgroup_size": [pass.workgroup(), pass.workgroup(), 1],
        "workgroups": workgroups(&pass),
        "group": 0,
        "bindings": uniform_bindings().into_iter().chain(bindings).collect::<Vec<_>>(),
        "views": debug_view_numbers().map(|(name, number)| (name.to_owned(), json!(number))).collect::<Map<_, _>>(),
    })
}

/// The uniforms that every pass binds.
fn uniform_bindings() -> [Value; 2] {
    [("frame", 0), ("settings", 1)]
        .map(|(name, binding)| json!({ "binding": binding, "name": name, "kind": "uniform", "uniform": name }))
}

fn workgroups(pass: &Pass) -> [String; 3] {
    let side = pass.workgroup();
    [format!("ceil(width / {side})"), format!("ceil(height / {side})"), "1".to_owned()]
}

/// The border's uniform: what the convention says, and which members every frame fills anew.
fn prepare(choice: &Choice<'_>, structs: &[Uniform], name: &str, of: &str) -> Value {
    let bytes = PrepareUniforms::of_convention(&choice.convention, choice.size).bytes();
    let mut said = values(structs, of, &bytes);
    if let Value::Object(said) = &mut said {
        said.retain(|member, _| !PrepareUniforms::PER_FRAME.contains(&member.as_str()));
    }
    json!({ "name": name, "struct": of, "values": said, "per_frame": PrepareUniforms::PER_FRAME })
}

/// What shaders read, by name: size, and members with type and offset.
fn layout(uniform: &Uniform) -> (String, Value) {
    let members: Vec<Value> =
        uniform.members.iter().map(|m| json!({ "name": m.name, "type": m.ty, "offset": m.offset })).collect();
    (uniform.name.to_owned(), json!({ "bytes": uniform.size, "members": members }))
}

/// The structs of these names, and those that they are made of.
fn reached<'a>(structs: &'a [Uniform], names: &[&str]) -> Vec<&'a Uniform> {
    let mut reached: Vec<&Uniform> = Vec::new();
    let mut open: Vec<&str> = names.to_vec();
    while let Some(name) = open.pop() {
        let Some(found) = structs.iter().find(|s| s.name == name) else { continue };
        if !reached.contains(&found) {
            reached.push(found);
            open.extend(found.members.iter().map(|m| m.ty));
        }
    }
    reached
}

/// The members of a struct with the values that these bytes hold.
fn values(structs: &[Uniform], name: &str, bytes: &[u8]) -> Value {
    let Some(of) = structs.iter().find(|s| s.name == name) else { return Value::Null };
    let word = |offset: usize| bytes.get(offset..).and_then(|b| b.first_chunk::<4>()).copied().unwrap_or_default();
    let member = |m: &quell::gpu::Member| {
        let value = match m.ty {
            "u32" => json!(u32::from_le_bytes(word(m.offset))),
            "f32" => json!(f32::from_le_bytes(word(m.offset))),
            "vec2f" => json!([0, 4].map(|at| f32::from_le_bytes(word(m.offset + at)))),
            inner => values(structs, inner, bytes.get(m.offset..).unwrap_or_default()),
        };
        (m.name.to_owned(), value)
    };
    Value::Object(of.members.iter().map(member).collect())
}

fn resource(choice: &Choice<'_>, program: &Program, resource: &Resource) -> Value {
    let mut value = json!({
        "name": resource.slot.name(),
        "role": role_name(resource.role),
        "copies": if resource.alternates { 2 } else { 1 },
    });
    let further = match (resource.holds, resource.slot) {
        (Holds::Plane(texel), _) if resource.role == Role::Input => {
            json!({ "kind": "texture_2d", "format": "any of floats", "sample_type": sample_type(texel),
                    "width": "width", "height": "height" })
        }
        (Holds::Plane(texel), _) => json!({
            "kind": "texture_2d",
            "format": texel.format_name(program.storage),
            "bytes_per_texel": texel.bytes(program.storage),
            "width": "width",
            "height": "height",
        }),
        (Holds::Host(sample), Slot::Guide(plane)) => {
            let (name, format) = sample_names(sample);
            let stand_in = resource.absent.and_then(|index| program.resources.get(index)).map(|r| r.slot.name());
            json!({ "kind": "texture_2d", "format": format, "sample_type": name, "width": "width", "height": "height",
                    "optional": true, "there": plane.there(), "if_absent": stand_in })
        }
        (Holds::Host(sample), _) => {
            let format = format!("{:?}", sample.absent_format()).to_lowercase();
            json!({ "kind": "texture_2d", "format": format, "sample_type": sample_names(sample).0,
                    "width": "1", "height": "1" })
        }
        (Holds::Counts(count), _) => json!({ "kind": "buffer", "bytes": 4 * count }),
        (Holds::Uniform(of), _) => json!({ "kind": "uniform", "struct": of }),
        (Holds::Taps, slot) => {
            let bytes = pack_taps(choice.settings, slot, choice.size.height, 0).len();
            json!({ "kind": "buffer", "struct": "SpiralTap", "bytes": bytes, "file": taps_name(slot),
                    "period": TAP_FRAMES })
        }
    };
    extend(&mut value, further);
    value
}

/// The members of one object into another.
fn extend(value: &mut Value, further: Value) {
    if let (Value::Object(value), Value::Object(further)) = (value, further) {
        value.extend(further);
    }
}

fn dispatch(program: &Program, index: usize, dispatch: &Dispatch) -> Value {
    let bindings = (FIRST_BINDING..).zip(dispatch.pass.bindings).zip(&dispatch.bound);
    let bindings = bindings.map(|((number, binding), bound)| {
        let Bound { resource, before } = *bound;
        let name = program.resources.get(resource).map(|r| r.slot.name());
        let mut value = json!({ "binding": number, "name": binding.name });
        use BindingKind as Kind;
        if let Kind::Uniform(_) = binding.kind {
            extend(&mut value, json!({ "kind": "uniform", "uniform": name }));
            return value;
        }
        extend(&mut value, json!({ "resource": name, "copy": if before { "before" } else { "this" } }));
        let further = match binding.kind {
            Kind::Sampled(texel) => json!({ "kind": "texture", "sample_type": sample_type(texel) }),
            Kind::Stored(texel) => json!({ "kind": "storage_texture", "access": "write-only",
                                           "format": texel.format_name(program.storage) }),
            Kind::Host(sample) => json!({ "kind": "texture", "sample_type": sample_names(sample).0 }),
            Kind::Taps => json!({ "kind": "read-only-storage" }),
            Kind::Counts(_) => json!({ "kind": "storage" }),
            // None of the real-time filter's passes binds these.
            Kind::Uniform(_) | Kind::Frames | Kind::Read(_) | Kind::Write(_) | Kind::Picture(_) | Kind::Layers(_) => {
                Value::Null
            }
        };
        extend(&mut value, further);
        value
    });
    json!({
        "name": dispatch.pass.name,
        "stages": dispatch.pass.stages.iter().map(|s| s.name()).collect::<Vec<_>>(),
        "file": shader_name(index, dispatch),
        "entry_point": dispatch.pass.entry,
        "workgroup_size": [dispatch.pass.workgroup(), dispatch.pass.workgroup(), 1],
        "workgroups": workgroups(&dispatch.pass),
        "group": 0,
        "bindings": uniform_bindings().into_iter().chain(bindings).collect::<Vec<_>>(),
        "bytes_per_pixel": program.bytes_of(dispatch),
    })
}

const fn role_name(role: Role) -> &'static str {
    match role {
        Role::Input => "input",
        Role::Guides => "guides",
        Role::Persistent => "persistent",
        Role::Output => "output",
        Role::Transient => "transient",
        Role::Taps => "taps",
        Role::Uniform => "uniform",
        Role::Counts => "counts",
        Role::Absent => "absent",
    }
}

fn sample_type(texel: Texel) -> &'static str {
    if texel.component() == "u32" { "uint" } else { "unfilterable-float" }
}

/// What WebGPU calls it in a layout of bindings, and which formats fit.
const fn sample_names(sample: Sample) -> (&'static str, &'static str) {
    match sample {
        Sample::Float => ("unfilterable-float", "any of floats"),
        Sample::Uint => ("uint", "any of unsigned integers"),
        Sample::Depth => ("depth", "any of depths"),
    }
}

fn shader_name(index: usize, dispatch: &Dispatch) -> String {
    format!("{:02}_{}.wgsl", index + 1, dispatch.pass.name.replace('+', "_"))
}

fn taps_name(slot: Slot) -> String {
    format!("{}.bin", slot.name().replace(' ', "_"))
}
