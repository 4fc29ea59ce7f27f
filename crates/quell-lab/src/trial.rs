//! Frames to try a host in another language with: what goes in, as bytes for its textures, and what the CPU makes of it
//! (docs/shaders.md).

use crate::error::Error;
use quell::gpu::{GuidePlane, PackedFrame, PackedSignal, Program, Role, Slot};
use quell::pipeline::{Image, Plan};
use quell::{Backend, Camera, Denoiser, FrameBuf, Plane, Rgb};
use quell_host::manifest::{Choice, File};
use quell_trace::{Control, RenderOptions, Scene, Tracer};
use serde_json::{Value, json};

/// Name of the file that lists the frames.
pub const FRAMES: &str = "frames.json";
/// Shadow rays a pixel, as a renderer takes them that has no time.
pub const DIRECT_SAMPLES: u32 = 16;

/// Traces the first `count` frames of a scene, one path of each kind a pixel, and gives a file for each, then
/// [`FRAMES`], last. What comes out of the filter is by [`Backend::Reference`].
///
/// # Errors
/// What tracing or filtering finds; what `give` returns.
pub fn frames<E: From<Error>>(
    choice: &Choice<'_>,
    scene: &Scene,
    count: u32,
    control: &Control<'_>,
    mut give: impl FnMut(File) -> Result<(), E>,
) -> Result<(), E> {
    let contents = choice.contents;
    let plan = Plan::new(choice.settings, contents.inputs());
    let program = Program::new(&plan, contents, choice.storage, choice.fuse);
    let options =
        RenderOptions { jitter: contents.jitter, direct_samples: DIRECT_SAMPLES, ..RenderOptions::new(choice.size) };
    let mut denoiser = Denoiser::with_backend(choice.size, choice.settings, Backend::Reference).map_err(Error::from)?;
    let mut listed = Vec::new();
    for index in 0..i64::from(count) {
        let tracer = Tracer::new(scene, index, 1).map_err(|e| Error::from(quell_trace::TraceError::from(e)))?;
        let mut frame = tracer.render(&options, control).map_err(Error::from)?.frame;
        drop(tracer);
        if contents.matte.is_none() {
            (frame.matte, frame.matte_weight) = (None, None);
        }
        if contents.glossy.is_none() {
            (frame.glossy, frame.glossy_weight) = (None, None);
        }
        let (planes, bytes) = inputs(&frame, &program)?;
        let mut bytes = bytes;
        let output = denoiser.denoise(&frame.frame(&[])).map_err(Error::from)?;
        let expected = placed("composite", RGBA, &mut bytes, colours(output.composite));
        let name = format!("frame_{index:03}.bin");
        listed.push(json!({
            "index": index,
            "file": name,
            "camera": camera(&frame.camera),
            "previous_camera": camera(&frame.previous_camera),
            "has_glossy_hit": frame.glossy_hit_distance.is_some(),
            "has_roughness": frame.roughness.is_some(),
            "planes": planes,
            "expected": [expected],
        }));
        give(File { name, bytes })?;
    }
    let list = json!({
        "scene": scene.name,
        "exposure": scene.exposure,
        "size": { "width": choice.size.width, "height": choice.size.height },
        "frames": listed,
    });
    give(File { name: FRAMES.to_owned(), bytes: format!("{list:#}\n").into_bytes() })
}

/// What a host would have in textures: the manifest's name of each, its format, where its rows lie in the bytes. Guides as
/// textures mean what they mean in [`quell::Frame`].
fn inputs(frame: &FrameBuf, program: &Program) -> Result<(Vec<Value>, Vec<u8>), Error> {
    let packed = PackedFrame::new(&frame.frame(&[]), program.storage)?;
    let part = |signal: &Option<PackedSignal>, of: fn(&PackedSignal) -> Option<Vec<u8>>| signal.as_ref().and_then(of);
    let colour = |data: Option<Vec<u8>>| data.map(|data| (RGBA, data));
    let number = |plane: &Option<Plane<f32>>| Some((R, floats(plane.as_ref()?.data().iter().copied())));
    let (mut planes, mut bytes) = (Vec::new(), Vec::new());
    for resource in program.resources.iter().filter(|r| matches!(r.role, Role::Input | Role::Guides)) {
        let own = |data: &Vec<u8>| Some((resource.texel()?.format_name(program.storage), data.clone()));
        let data = match resource.slot {
            Slot::Geometry => own(&packed.guides.geometry),
            Slot::Surface => own(&packed.guides.surface),
            Slot::Moving => own(&packed.guides.moving),
            Slot::Image(Image::DirectInput) => colour(Some(packed.direct.clone())),
            Slot::Image(Image::MatteInput) => colour(part(&packed.matte, |s| Some(s.light.clone()))),
            Slot::MatteWeight => colour(part(&packed.matte, |s| s.weight.clone())),
            Slot::DirectMatte => colour(part(&packed.matte, |s| s.direct.clone())),
            Slot::Image(Image::GlossyInput) => colour(part(&packed.glossy, |s| Some(s.light.clone()))),
            Slot::GlossyWeight => colour(part(&packed.glossy, |s| s.weight.clone())),
            Slot::DirectGlossy => colour(part(&packed.glossy, |s| s.direct.clone())),
            Slot::Guide(GuidePlane::ViewDepth) => number(&frame.view_depth),
            Slot::Guide(GuidePlane::Roughness) => number(&frame.roughness),
            Slot::Guide(GuidePlane::GlossyHit) => number(&frame.glossy_hit_distance),
            Slot::Guide(GuidePlane::ConfidenceIn) => number(&frame.confidence_in),
            Slot::Guide(GuidePlane::Normal) => frame.normal.as_ref().map(|p| (RGBA, colours(p))),
            Slot::Guide(GuidePlane::Motion) => {
                frame.motion.as_ref().map(|p| (RG, floats(p.data().iter().flatten().copied())))
            }
            Slot::Guide(GuidePlane::SurfaceId) => {
                let bytes = |p: &Plane<u32>| p.data().iter().flat_map(|id| id.to_le_bytes()).collect();
                frame.surface_id.as_ref().map(|p| (ID, bytes(p)))
            }
            _ => None,
        };
        if let Some((format, data)) = data {
            planes.push(placed(resource.slot.name(), format, &mut bytes, data));
        }
    }
    Ok((planes, bytes))
}

/// Names of formats, as WebGPU has them.
const RGBA: &str = "rgba32float";
const RG: &str = "rg32float";
const R: &str = "r32float";
const ID: &str = "r32uint";

fn floats(values: impl Iterator<Item = f32>) -> Vec<u8> {
    values.flat_map(f32::to_le_bytes).collect()
}

/// Appends a plane and says where it lies.
fn placed(name: &str, format: &str, bytes: &mut Vec<u8>, plane: Vec<u8>) -> Value {
    let value = json!({ "name": name, "format": format, "offset": bytes.len(), "bytes": plane.len() });
    bytes.extend(plane);
    value
}

fn colours(plane: &Plane<Rgb>) -> Vec<u8> {
    floats(plane.data().iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]))
}

fn camera(camera: &Camera) -> Value {
    json!({ "clip_from_world": camera.clip_from_world, "jitter": camera.jitter })
}
