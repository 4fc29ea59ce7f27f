//! The GPU back end for hosts in other languages: its shaders as files, and a manifest that says what to make, to fill, to
//! bind and to dispatch. Both come from the program that [`quell::gpu::Denoiser`] walks (docs/shaders.md).

use quell::gpu::{
    Bound, Contents, Dispatch, FIRST_BINDING, Program, Resource, Role, SettingsUniforms, Slot, Storage, TAP_FRAMES,
    Texel, Uniform, WORKGROUP, layouts, pack_taps,
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

/// The shaders of every dispatch, tables of taps, and the manifest, last.
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
    let manifest = manifest(choice, &program);
    files.push(File { name: MANIFEST.to_owned(), bytes: format!("{manifest:#}\n").into_bytes() });
    Ok(files)
}

fn manifest(choice: &Choice<'_>, program: &Program) -> Value {
    let structs = layouts();
    let settings = SettingsUniforms::of(choice.settings, choice.size, choice.contents).bytes();
    let named = |index: usize| program.resources.get(index).map(|r| r.slot.name());
    let shown = program.shown;
    json!({
        "format": FORMAT,
        "quell": env!("CARGO_PKG_VERSION"),
        "size": { "width": choice.size.width, "height": choice.size.height },
        "storage": match program.storage { Storage::Half => "half", Storage::Float => "float" },
        "resources": program.resources.iter().map(|r| resource(choice, program, r)).collect::<Vec<_>>(),
        "structs": reached(&structs, &["Frame", "Settings", "SpiralTap"]).into_iter().map(layout).collect::<Map<_, _>>(),
        "uniforms": [
            { "name": "frame", "binding": 0, "struct": "Frame" },
            { "name": "settings", "binding": 1, "struct": "Settings", "values": values(&structs, "Settings", &settings) },
        ],
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
    })
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
    let further = match resource.texel {
        Some(texel) if resource.role == Role::Input => {
            json!({ "kind": "texture_2d", "format": "any of floats", "sample_type": sample_type(texel),
                    "width": "width", "height": "height" })
        }
        Some(texel) => json!({
            "kind": "texture_2d",
            "format": texel.format_name(program.storage),
            "bytes_per_texel": texel.bytes(program.storage),
            "width": "width",
            "height": "height",
        }),
        None => {
            let bytes = pack_taps(choice.settings, resource.slot, choice.size.height, 0).len();
            json!({ "kind": "buffer", "struct": "SpiralTap", "bytes": bytes, "file": taps_name(resource.slot),
                    "period": TAP_FRAMES })
        }
    };
    if let (Value::Object(value), Value::Object(further)) = (&mut value, further) {
        value.extend(further);
    }
    value
}

fn dispatch(program: &Program, index: usize, dispatch: &Dispatch) -> Value {
    let uniforms = [("frame", 0), ("settings", 1)]
        .map(|(name, binding)| json!({ "binding": binding, "name": name, "kind": "uniform", "uniform": name }));
    let bindings = (FIRST_BINDING..).zip(dispatch.pass.bindings).zip(&dispatch.bound);
    let bindings = bindings.map(|((number, binding), bound)| {
        let Bound { resource, before } = *bound;
        let mut value = json!({
            "binding": number,
            "name": binding.name,
            "resource": program.resources.get(resource).map(|r| r.slot.name()),
            "copy": if before { "before" } else { "this" },
        });
        use quell::gpu::BindingKind as Kind;
        let further = match binding.kind {
            Kind::Sampled(texel) => json!({ "kind": "texture", "sample_type": sample_type(texel) }),
            Kind::Stored(texel) => json!({ "kind": "storage_texture", "access": "write-only",
                                           "format": texel.format_name(program.storage) }),
            Kind::Taps => json!({ "kind": "read-only-storage" }),
        };
        if let (Value::Object(value), Value::Object(further)) = (&mut value, further) {
            value.extend(further);
        }
        value
    });
    json!({
        "name": dispatch.pass.name,
        "stages": dispatch.pass.stages.iter().map(|s| s.name()).collect::<Vec<_>>(),
        "file": shader_name(index, dispatch),
        "entry_point": dispatch.pass.entry,
        "workgroup_size": [WORKGROUP, WORKGROUP, 1],
        "workgroups": [format!("ceil(width / {WORKGROUP})"), format!("ceil(height / {WORKGROUP})"), "1".to_owned()],
        "group": 0,
        "bindings": uniforms.into_iter().chain(bindings).collect::<Vec<_>>(),
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
    }
}

fn sample_type(texel: Texel) -> &'static str {
    if texel.component() == "u32" { "uint" } else { "unfilterable-float" }
}

fn shader_name(index: usize, dispatch: &Dispatch) -> String {
    format!("{:02}_{}.wgsl", index + 1, dispatch.pass.name.replace('+', "_"))
}

fn taps_name(slot: Slot) -> String {
    format!("{}.bin", slot.name().replace(' ', "_"))
}
