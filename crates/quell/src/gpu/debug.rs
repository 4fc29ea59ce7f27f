//! Debug views: a frame's planes, and what the denoiser made of them, as pictures. Most hosts' mistakes blur or streak the
//! result in ways that look alike; each view shows some of them plainly.

use super::error::Error;
use super::kernel::{Kernel, check_stored, workgroups_of};
use super::pass::{Binding, BindingKind, Pass, Sample, WORKGROUP};
use super::sequence;
use super::small::filled;
use super::storage::{Storage, Texel};
use super::uniform::{Value, uniforms};
use crate::pipeline::Image;
use crate::plane::Size;
use glam::{IVec2, Vec3};

const PASS: &str = "debug";

/// What to show of the frame that was encoded last. Background is nearly black blue where a view is of surfaces.
///
/// | mistake | looked for in | looks like |
/// |---|---|---|
/// | motion's sign, or its axes, wrong | [`DebugView::MotionError`] | everything coloured wherever the camera moves, its hue turning with the direction |
/// | motion's scale or unit wrong | [`DebugView::MotionError`] | the same, fainter where things move less; at rest black |
/// | jitter left in the vectors | [`DebugView::MotionError`] | one even, faint colour over the whole image, another one at every frame, even at rest |
/// | device depth given as view depth | [`DebugView::WorldGrid`], [`DebugView::DepthError`] | no squares, or bent ones; evenly red, and everything bright in [`DebugView::MotionError`] |
/// | normals of the camera's space | [`DebugView::NormalError`] | surfaces coloured evenly, more so the farther the camera is turned; they change as it turns |
/// | the previous camera is this one's | [`DebugView::DepthError`], [`DebugView::MotionError`] | coloured wherever the camera moves along its axis; motion as with a wrong sign |
/// | ids that change with the frame | [`DebugView::Rejection`] | whole objects yellow |
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DebugView {
    /// An image of the pipeline, scaled, held to a display's range (c / (1 + c)) and encoded for sRGB. One that did not
    /// run in this frame is an error.
    Light(Image),
    /// View depth, grey, anew from dark to bright with every doubling. Right: bands that follow the surfaces.
    Depth,
    /// Normals as (n + 1) / 2. Right: a colour belongs to a wall, however the camera turns.
    Normal,
    /// Perceptual roughness: black is a mirror.
    Roughness,
    /// A colour for each id. Right: objects keep theirs.
    SurfaceId,
    /// Hit distance over itself and the depth: black touches; blue: the ray left the scene.
    GlossyHit,
    /// Motion: hue is where to (right red, down green, left cyan, up violet), brightness its length by logarithm, full at
    /// 16 px; white: unknown. Right: the hue of where the surface **was**.
    Motion,
    /// The host's trust.
    ConfidenceIn,
    /// A chessboard in the world, one cell a unit of length times `scale`, tinted by the normal. Right: straight squares
    /// that stay on the surfaces whatever the camera does.
    WorldGrid,
    /// The sine of the angle between normals and the surface that depths make: black, red, yellow, white. Right: black but
    /// for edges, bumps of shading normals and curved surfaces.
    NormalError,
    /// Motion less what depth and both cameras give: hue as in [`DebugView::Motion`], brightness from 1/20 px, full at 16.
    /// Right: black, but for objects that move by themselves.
    MotionError,
    /// The depth that lies at the place where the pixel was, less what it should be there, relative: red nearer, blue
    /// farther, full at 5 %; grey: nothing there. Right: black, but for what was hidden and what moves by itself.
    DepthError,
    /// Confidence: red 0, green 1. Right: green after a few frames, red where something was uncovered.
    Confidence,
    /// History length by logarithm: black 1 frame, red 4, yellow 16, white 64. Right: ever brighter at rest.
    HistoryLength,
    /// Why stage 3 took no history. Dark green: it took some. White: there is none at all (first frame, cut). Magenta:
    /// motion unknown. Blue: it was off screen. Violet: the host's trust is 0. Cyan: it moves by itself and has left no
    /// trace. Grey: there was background. Yellow: another id. Orange: another normal. Red: another depth.
    Rejection,
    /// Edge weights of stage 7 between a pixel (green) and every other: black 0, white 1. Right: white over its own surface
    /// and nowhere else.
    WeightsAround([u32; 2]),
    /// What edges leave of the weight of stage 7's taps: black none, white all. Right: white but near edges.
    WeightSum,
}

impl DebugView {
    const fn index(self) -> u32 {
        match self {
            Self::Light(_) => 0,
            Self::Depth => 1,
            Self::Normal => 2,
            Self::Roughness => 3,
            Self::SurfaceId => 4,
            Self::GlossyHit => 5,
            Self::Motion => 6,
            Self::ConfidenceIn => 7,
            Self::WorldGrid => 8,
            Self::NormalError => 9,
            Self::MotionError => 10,
            Self::DepthError => 11,
            Self::Confidence => 12,
            Self::HistoryLength => 13,
            Self::Rejection => 14,
            Self::WeightsAround(_) => 15,
            Self::WeightSum => 16,
        }
    }
}

/// Every view by the name that hosts in other languages know it by, with its number in the shader.
pub fn debug_view_numbers() -> impl Iterator<Item = (&'static str, u32)> {
    let views = [
        ("light", DebugView::Light(Image::Composite)),
        ("depth", DebugView::Depth),
        ("normal", DebugView::Normal),
        ("roughness", DebugView::Roughness),
        ("surface_id", DebugView::SurfaceId),
        ("glossy_hit", DebugView::GlossyHit),
        ("motion", DebugView::Motion),
        ("confidence_in", DebugView::ConfidenceIn),
        ("world_grid", DebugView::WorldGrid),
        ("normal_error", DebugView::NormalError),
        ("motion_error", DebugView::MotionError),
        ("depth_error", DebugView::DepthError),
        ("confidence", DebugView::Confidence),
        ("history_length", DebugView::HistoryLength),
        ("rejection", DebugView::Rejection),
        ("weights_around", DebugView::WeightsAround([0, 0])),
        ("weight_sum", DebugView::WeightSum),
    ];
    views.into_iter().map(|(name, view)| (name, view.index()))
}

uniforms! {
    /// Twin of `Debug` in `passes/debug.wgsl`.
    pub(super) DebugUniforms as "Debug" {
        eye: Vec3,
        view: u32,
        centre: IVec2,
        scale: f32,
        taps: u32,
        has_confidence: u32,
    }
}

/// The passes that draw debug views of either filter, for one storage and one format of target: made apart, so that a
/// denoiser without them costs nothing.
#[derive(Debug)]
pub struct DebugViews {
    frame: Kernel,
    sequence: Kernel,
    nothing: wgpu::TextureView,
    format: wgpu::TextureFormat,
}

/// Where a view is drawn, and how.
#[derive(Clone, Copy, Debug)]
pub struct DebugTarget<'a> {
    /// A texture of the views' format and the usage `STORAGE_BINDING`, at least of the frame's extent. Values are encoded
    /// for a display (sRGB), alpha is 1.
    pub view: &'a wgpu::TextureView,
    /// Brightness of [`DebugView::Light`]; cells a unit of [`DebugView::WorldGrid`]; sensitivity of the errors. 1 is usual.
    pub scale: f32,
}

/// What a view is drawn from.
pub(super) struct DebugInputs<'a> {
    /// Frame and settings.
    pub(super) uniforms: [wgpu::BindingResource<'a>; 2],
    /// Geometry, surface, moving; geometry and surface of the frame before.
    pub(super) guides: [&'a wgpu::TextureView; 5],
    pub(super) image: &'a wgpu::TextureView,
    pub(super) length: &'a wgpu::TextureView,
    /// Of stage 7, where it ran.
    pub(super) taps: Option<wgpu::BindingResource<'a>>,
    pub(super) tap_count: u32,
    pub(super) eye: Vec3,
    pub(super) has_confidence: bool,
    pub(super) size: Size,
}

/// Formats of targets.
const FORMATS: [wgpu::TextureFormat; 3] =
    [wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureFormat::Rgba16Float, wgpu::TextureFormat::Rgba32Float];

const fn sampled(name: &'static str, texel: Texel) -> Binding {
    Binding { name, kind: BindingKind::Sampled(texel) }
}

/// Of images that may be absent.
const fn image(name: &'static str) -> Binding {
    Binding { name, kind: BindingKind::Host(Sample::Float) }
}

/// What is drawn into, of one of [`FORMATS`].
pub(super) const fn picture(format: usize) -> Binding {
    Binding { name: "target_texture", kind: BindingKind::Picture(FORMATS[format]) }
}

const fn bindings(format: usize) -> [Binding; 10] {
    [
        Binding { name: "debug", kind: BindingKind::Uniform("Debug") },
        sampled("geometry", Texel::Geometry),
        sampled("surface", Texel::Surface),
        sampled("moving", Texel::Moving),
        sampled("geometry_before", Texel::Geometry),
        sampled("surface_before", Texel::Surface),
        image("image"),
        image("history_length"),
        Binding { name: "spiral", kind: BindingKind::Taps },
        picture(format),
    ]
}

const fn pass(bindings: &'static [Binding]) -> Pass {
    Pass {
        name: "debug",
        stages: &[],
        per_frame: true,
        entry: "show",
        bindings,
        pieces: &[
            include_str!("guides/depth.wgsl"),
            include_str!("guides/surface.wgsl"),
            include_str!("guides/moving.wgsl"),
            include_str!("guides/before.wgsl"),
            include_str!("../kernels/math.wgsl"),
            include_str!("../kernels/edge.wgsl"),
            include_str!("../kernels/spiral.wgsl"),
            include_str!("../kernels/reproject.wgsl"),
            COLOURS,
            include_str!("passes/debug.wgsl"),
        ],
    }
}

pub(super) const COLOURS: &str = include_str!("passes/debug_colours.wgsl");

const PASSES: [Pass; 3] = [pass(&const { bindings(0) }), pass(&const { bindings(1) }), pass(&const { bindings(2) })];

impl Pass {
    /// The debug views of either filter, for targets of rgba8unorm.
    pub const DEBUG: [Self; 2] = [PASSES[0], sequence::DEBUG_PASSES[0]];
}

impl DebugViews {
    /// Compiles the passes. `storage`: the denoiser's, which does not matter to the sequence filter; `format`: of the targets:
    /// rgba8unorm, rgba16float or rgba32float.
    ///
    /// # Errors
    /// Another format.
    pub fn new(device: &wgpu::Device, storage: Storage, format: wgpu::TextureFormat) -> Result<Self, Error> {
        let passes = FORMATS.into_iter().zip(PASSES).zip(sequence::DEBUG_PASSES);
        let Some((frame, of_sequence)) = passes.filter(|((f, _), _)| *f == format).map(|((_, a), b)| (a, b)).next()
        else {
            let expected = "rgba8unorm, rgba16float or rgba32float";
            return Err(Error::Format { pass: PASS, binding: "target", expected, found: format });
        };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("quell debug: nothing"),
            size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Ok(Self {
            frame: Kernel::new(device, frame, storage, false),
            sequence: Kernel::new(device, of_sequence, storage, false),
            nothing: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            format,
        })
    }

    /// The same with the sequence filter's pass from changed WGSL, with the same bindings and entry point: for tests that plant
    /// a difference.
    #[must_use]
    pub fn with_sequence_source(mut self, device: &wgpu::Device, source: &str) -> Self {
        self.sequence = Kernel::with_source(device, *self.sequence.pass(), Storage::Float, source);
        self
    }

    /// Stands in for an image that is not there.
    pub(super) fn nothing(&self) -> &wgpu::TextureView {
        &self.nothing
    }

    /// The pass that shows the sequence filter's buffers.
    pub(super) fn sequence(&self) -> &Kernel {
        &self.sequence
    }

    pub(super) fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        inputs: &DebugInputs<'_>,
        view: DebugView,
        target: DebugTarget<'_>,
    ) -> Result<(), Error> {
        let expected = "the format that the views were made for";
        check_stored(PASS, "target", target.view.texture(), (self.format, expected), inputs.size)?;
        let groups = workgroups_of(device, PASS, WORKGROUP, inputs.size)?;
        let centre = match view {
            DebugView::WeightsAround([x, y]) => {
                let held = |v: u32, extent: usize| v.min(extent as u32 - 1) as i32;
                IVec2::new(held(x, inputs.size.width), held(y, inputs.size.height))
            }
            _ => IVec2::ZERO,
        };
        let uniforms = DebugUniforms {
            eye: inputs.eye,
            view: view.index(),
            centre,
            scale: target.scale,
            taps: inputs.taps.as_ref().map_or(0, |_| inputs.tap_count),
            has_confidence: u32::from(inputs.has_confidence),
        };
        let mut bytes = Vec::new();
        uniforms.write(&mut bytes);
        let uniforms = filled(device, "quell debug", &bytes, wgpu::BufferUsages::UNIFORM);
        let no_taps = filled(device, "quell debug: no taps", &[0; 16], wgpu::BufferUsages::STORAGE);
        let buffers = inputs.uniforms.clone().into_iter().chain([uniforms.as_entire_binding()]);
        let views = inputs.guides.into_iter().chain([inputs.image, inputs.length]);
        let taps = inputs.taps.clone().unwrap_or(no_taps.as_entire_binding());
        let target = wgpu::BindingResource::TextureView(target.view);
        let resources = buffers.chain(views.map(wgpu::BindingResource::TextureView)).chain([taps, target]);
        let group = self.frame.group(device, resources.collect());
        self.frame.dispatch(encoder, &group, groups, None);
        Ok(())
    }
}
