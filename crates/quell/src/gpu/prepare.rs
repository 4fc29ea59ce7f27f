//! The border on the GPU: one dispatch makes a host's textures into guides that every stage may trust, and counts what it
//! repaired; a second one, where it is asked for, counts what stages repair as they load colours.

use super::compute::{self, Compute, Kind};
use super::convention::PrepareUniforms;
use super::denoiser::filled;
use super::error::Error;
use super::inputs::{self, Asks, GuideTextures, Scalar};
use super::repairs::{COUNTS, Repairs};
use super::storage::{Storage, Texel};
use crate::camera::Camera;
use crate::plane::Size;

/// The guides' textures in the order of their bindings.
const TEXTURES: [(&str, Kind); 8] = [
    ("depth_texture", Kind::Depth),
    ("view_depth_texture", Kind::Float),
    ("normal_texture", Kind::Float),
    ("motion_texture", Kind::Float),
    ("roughness_texture", Kind::Float),
    ("glossy_hit_texture", Kind::Float),
    ("id_texture", Kind::Uint),
    ("confidence_texture", Kind::Float),
];

/// The colours' names, in the order of [`crate::border::PlaneName`].
const COLOURS: [&str; 7] =
    ["direct", "matte", "glossy", "direct_matte", "direct_glossy", "matte_weight", "glossy_weight"];

const HEAD: [(&str, Kind); 3] = [
    ("frame", Kind::Uniform("Frame")),
    ("prepare", Kind::Uniform("Prepare")),
    ("repairs", Kind::Counts(COUNTS as u32)),
];

const FRAME: &str = include_str!("frame.wgsl");
const BORDER: &str = include_str!("passes/prepare.wgsl");

fn guide_bindings(storage: Storage) -> Vec<(&'static str, Kind)> {
    let out = [("geometry_out", Texel::Geometry), ("surface_out", Texel::Surface), ("moving_out", Texel::Moving)];
    let out = out.map(|(name, texel)| (name, Kind::Stored(texel.format(storage))));
    HEAD.into_iter().chain(TEXTURES).chain(out).collect()
}

fn count_bindings() -> Vec<(&'static str, Kind)> {
    HEAD.into_iter().chain(COLOURS.map(|name| (name, Kind::Float))).collect()
}

/// The shader that makes guides.
pub fn prepare_source(storage: Storage) -> String {
    let pieces = [
        FRAME,
        include_str!("guides/types.wgsl"),
        storage.wgsl(),
        include_str!("guides/store.wgsl"),
        include_str!("input_colour.wgsl"),
        BORDER,
        include_str!("passes/prepare_guides.wgsl"),
    ];
    compute::source(&guide_bindings(storage), &pieces)
}

/// The shader that counts repairs of colours.
pub fn count_source() -> String {
    let pieces = [FRAME, include_str!("input_colour.wgsl"), BORDER, include_str!("passes/count_colours.wgsl")];
    compute::source(&count_bindings(), &pieces)
}

/// Stands in for a plane that is not there: WebGPU has no empty binding.
#[derive(Debug)]
struct Absent {
    float: wgpu::TextureView,
    depth: wgpu::TextureView,
    uint: wgpu::TextureView,
}

impl Absent {
    fn new(device: &wgpu::Device) -> Self {
        let view = |format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("quell absent plane"),
                size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            float: view(wgpu::TextureFormat::R8Unorm),
            depth: view(wgpu::TextureFormat::Depth32Float),
            uint: view(wgpu::TextureFormat::R8Uint),
        }
    }

    fn of(&self, kind: Kind) -> &wgpu::TextureView {
        match kind {
            Kind::Depth => &self.depth,
            Kind::Uint => &self.uint,
            _ => &self.float,
        }
    }
}

/// What the border reads of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Border<'a> {
    /// The camera that took the frame; with depths of [`super::DepthKind::Device`] its row z counts.
    pub camera: Camera,
    /// The camera of the frame before.
    pub previous_camera: Camera,
    /// The frame's extent.
    pub size: Size,
    /// The guides; `None`: they are there already.
    pub planes: Option<GuideTextures<'a>>,
    /// Colours whose repairs are counted, in the order direct, matte, glossy, direct_matte, direct_glossy, matte_weight,
    /// glossy_weight; `None`: none is.
    pub colours: Option<[Option<&'a wgpu::TextureView>; 7]>,
}

/// Both passes on a device.
#[derive(Debug)]
pub struct Prepare {
    guides: Compute,
    count: Compute,
    absent: Absent,
    repairs: Repairs,
}

impl Prepare {
    /// Compiles them on the caller's device.
    pub fn new(device: &wgpu::Device, storage: Storage) -> Self {
        Self::with_source(device, storage, prepare_source(storage))
    }

    /// Likewise, guides from changed WGSL: for tests that plant a difference.
    pub fn with_source(device: &wgpu::Device, storage: Storage, source: String) -> Self {
        Self {
            guides: Compute::new(device, "prepare_guides", &guide_bindings(storage), source),
            count: Compute::new(device, "count_colours", &count_bindings(), count_source()),
            absent: Absent::new(device),
            repairs: Repairs::new(device),
        }
    }

    /// Where the counts of the last frame that was encoded lie once it has run.
    pub fn repairs(&self) -> &Repairs {
        &self.repairs
    }

    /// Appends both passes to the caller's encoder: guides into `out`, planes for [`Texel::Geometry`], [`Texel::Surface`]
    /// and [`Texel::Moving`] as [`super::pack_guides`] packs them. `frame` is a uniform buffer that holds the bytes of
    /// [`super::FrameUniforms`].
    ///
    /// # Errors
    /// A texture that does not fit its plane; a camera that cannot be used. Nothing was encoded then.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::Buffer,
        border: &Border<'_>,
        out: [&wgpu::TextureView; 3],
    ) -> Result<(), Error> {
        border.check()?;
        let guides = border.planes.unwrap_or_default();
        let uniforms = border.uniforms(&guides)?.bytes();
        let uniforms = filled(device, "quell prepare", &uniforms, wgpu::BufferUsages::UNIFORM);
        self.repairs.clear(encoder);
        let head = || [frame, &uniforms, self.repairs.buffer()].map(wgpu::Buffer::as_entire_binding).into_iter();
        if border.planes.is_some() {
            let scalar = |plane: Option<Scalar<'_>>| plane.map(|s| s.view.clone());
            let (depth_texture, view_depth) = match guides.view_depth {
                Some(v) if inputs::is_depth(v.texture().format()) => (Some(v.clone()), None),
                other => (None, other.cloned()),
            };
            let given = [
                depth_texture,
                view_depth,
                guides.normal.cloned(),
                guides.motion.cloned(),
                scalar(guides.roughness),
                scalar(guides.glossy_hit_distance),
                guides.surface_id.cloned(),
                scalar(guides.confidence_in),
            ];
            let views = given.iter().zip(TEXTURES).map(|(v, (_, kind))| v.as_ref().unwrap_or(self.absent.of(kind)));
            let resources = head().chain(views.chain(out).map(wgpu::BindingResource::TextureView));
            self.guides.encode(device, encoder, resources, border.size);
        }
        if let Some(colours) = border.colours {
            let views = colours.map(|v| wgpu::BindingResource::TextureView(v.unwrap_or(&self.absent.float)));
            self.count.encode(device, encoder, head().chain(views), border.size);
        }
        Ok(())
    }
}

impl Border<'_> {
    fn check(&self) -> Result<(), Error> {
        self.planes.map_or(Ok(()), |planes| planes.check(self.size))?;
        for (name, view) in COLOURS.into_iter().zip(self.colours.into_iter().flatten()) {
            view.map_or(Ok(()), |view| inputs::check(name, view, Asks::Channels(3), self.size))?;
        }
        Ok(())
    }

    fn uniforms(&self, planes: &GuideTextures<'_>) -> Result<PrepareUniforms, Error> {
        let projection = self.camera.projection(self.size).ok_or(crate::Error::Camera { which: "camera" })?;
        let channel = |s: Option<Scalar<'_>>| s.map_or(0, |s| s.channel as u32);
        let format = planes.normal.map(|v| v.texture().format());
        let depth = planes.view_depth.map(|v| inputs::is_depth(v.texture().format()));
        let there = [
            depth == Some(true),
            depth.is_some(),
            planes.normal.is_some(),
            planes.motion.is_some(),
            planes.roughness.is_some(),
            planes.glossy_hit_distance.is_some(),
            planes.surface_id.is_some(),
            planes.confidence_in.is_some(),
        ];
        Ok(PrepareUniforms::new(
            &planes.convention,
            [&self.camera, &self.previous_camera],
            &projection,
            self.size,
            format.map_or(crate::border::UNIT_TOLERANCE, inputs::unit_tolerance),
            [planes.roughness, planes.glossy_hit_distance, planes.confidence_in].map(channel),
            (0..).zip(there).fold(0, |mask, (bit, there)| mask | u32::from(there) << bit),
        ))
    }
}
