//! The border on the GPU: one dispatch makes a host's textures into guides that every stage may trust, and counts what it
//! repaired; a second one, where it is asked for, counts what stages repair as they load colours.

use super::convention::PrepareUniforms;
use super::error::Error;
use super::inputs::{self, Asks, GuideTextures, Scalar};
use super::repairs::Repairs;
use crate::camera::Camera;
use crate::plane::Size;

/// How a shader declares a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Float,
    Depth,
    Uint,
}

/// The guides' textures in the order of their bindings.
const TEXTURES: [(&str, Class); 8] = [
    ("depth_texture", Class::Depth),
    ("view_depth", Class::Float),
    ("normal", Class::Float),
    ("motion", Class::Float),
    ("roughness", Class::Float),
    ("glossy_hit_distance", Class::Float),
    ("surface_id", Class::Uint),
    ("confidence_in", Class::Float),
];

/// The colours', in the order of [`crate::border::PlaneName`].
const COLOURS: [&str; 7] =
    ["direct", "matte", "glossy", "direct_matte", "direct_glossy", "matte_weight", "glossy_weight"];

/// Binding of the first texture, after the frame's uniform, this pass's and the counts.
const FIRST: u32 = 3;

const FRAME: &str = include_str!("frame.wgsl");
const GUIDES: &str = include_str!("guides/types.wgsl");
const BORDER: &str = include_str!("passes/prepare.wgsl");
const BORDER_GUIDES: &str = include_str!("passes/prepare_guides.wgsl");

impl Class {
    const fn wgsl(self) -> &'static str {
        match self {
            Self::Float => "texture_2d<f32>",
            Self::Depth => "texture_depth_2d",
            Self::Uint => "texture_2d<u32>",
        }
    }

    const fn sample_type(self) -> wgpu::TextureSampleType {
        match self {
            Self::Float => wgpu::TextureSampleType::Float { filterable: false },
            Self::Depth => wgpu::TextureSampleType::Depth,
            Self::Uint => wgpu::TextureSampleType::Uint,
        }
    }
}

fn declared(textures: impl IntoIterator<Item = (&'static str, Class)>) -> String {
    let line = |(binding, (name, class)): (u32, (&str, Class))| {
        format!("@group(0) @binding({binding}) var {name}: {};\n", class.wgsl())
    };
    (FIRST..).zip(textures).map(line).collect()
}

const HEAD: &str = "@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> prepare: Prepare;
@group(0) @binding(2) var<storage, read_write> repairs: array<atomic<u32>, 56>;
";

/// The shader that makes guides.
pub fn prepare_source() -> String {
    let textures = declared(TEXTURES);
    let last = FIRST + TEXTURES.len() as u32;
    let out = format!(
        "@group(0) @binding({last}) var<storage, read_write> guides: array<Guide>;\n\
         fn sample_position(pixel: vec2i) -> vec2f {{ return vec2f(pixel) + 0.5 + frame.jitter; }}\n\
         fn index_of(pixel: vec2i) -> u32 {{ return u32(pixel.y) * frame.size.x + u32(pixel.x); }}\n"
    );
    [HEAD, &textures, &out, FRAME, GUIDES, BORDER, BORDER_GUIDES].join("\n")
}

/// The shader that counts repairs of colours.
pub fn count_source() -> String {
    let textures = declared(COLOURS.map(|name| (name, Class::Float)));
    [HEAD, &textures, FRAME, BORDER, include_str!("passes/count_colours.wgsl")].join("\n")
}

/// A pipeline and the layout of its bindings.
#[derive(Debug)]
struct Compiled {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

fn compiled(device: &wgpu::Device, name: &str, source: String, rest: Vec<wgpu::BindingType>) -> Compiled {
    let label = format!("quell {name}");
    let label = Some(label.as_str());
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let first = [
        buffer(wgpu::BufferBindingType::Uniform),
        buffer(wgpu::BufferBindingType::Uniform),
        buffer(wgpu::BufferBindingType::Storage { read_only: false }),
    ];
    let entries: Vec<_> = (0..)
        .zip(first.into_iter().chain(rest))
        .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        })
        .collect();
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
    let module = device
        .create_shader_module(wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(source.into()) });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&pipeline_layout),
        module: &module,
        entry_point: Some(name),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    Compiled { layout, pipeline }
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

    fn of(&self, class: Class) -> &wgpu::TextureView {
        match class {
            Class::Float => &self.float,
            Class::Depth => &self.depth,
            Class::Uint => &self.uint,
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
    /// The guides.
    pub planes: GuideTextures<'a>,
    /// Colours whose repairs are counted, in the order direct, matte, glossy, direct_matte, direct_glossy, matte_weight,
    /// glossy_weight; `None`: none is.
    pub colours: Option<[Option<&'a wgpu::TextureView>; 7]>,
}

/// Both passes on a device.
#[derive(Debug)]
pub struct Prepare {
    guides: Compiled,
    count: Compiled,
    absent: Absent,
    repairs: Repairs,
}

impl Prepare {
    /// Compiles them on the caller's device.
    pub fn new(device: &wgpu::Device) -> Self {
        Self::with_source(device, prepare_source())
    }

    /// Likewise, guides from changed WGSL: for tests that plant a difference.
    pub fn with_source(device: &wgpu::Device, source: String) -> Self {
        let texture = |class: Class| wgpu::BindingType::Texture {
            sample_type: class.sample_type(),
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let mut rest: Vec<_> = TEXTURES.iter().map(|(_, class)| texture(*class)).collect();
        rest.push(wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: false },
            has_dynamic_offset: false,
            min_binding_size: None,
        });
        Self {
            guides: compiled(device, "prepare_guides", source, rest),
            count: compiled(device, "count_colours", count_source(), vec![texture(Class::Float); COLOURS.len()]),
            absent: Absent::new(device),
            repairs: Repairs::new(device),
        }
    }

    /// Where the counts of the last frame that was encoded lie once it has run.
    pub fn repairs(&self) -> &Repairs {
        &self.repairs
    }

    /// Appends both passes to the caller's encoder: guides into `out`, 48 bytes a pixel as [`super::pack_guides`] makes
    /// them. `frame` is a uniform buffer that holds the bytes of [`super::FrameUniforms`].
    ///
    /// # Errors
    /// A texture that does not fit its plane; a camera that cannot be used. Nothing was encoded then.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::Buffer,
        border: &Border<'_>,
        out: &wgpu::Buffer,
    ) -> Result<(), Error> {
        let Border { size, planes, colours, .. } = border;
        border.check()?;
        let uniforms = border.uniforms()?.bytes();
        let uniforms = super::denoiser::filled(device, "quell prepare", &uniforms, wgpu::BufferUsages::UNIFORM);
        self.repairs.clear(encoder);
        let view = |plane: Option<Scalar<'_>>| plane.map(|s| s.view.clone());
        let (depth_texture, view_depth) = match planes.view_depth {
            Some(v) if inputs::is_depth(v.texture().format()) => (Some(v.clone()), None),
            other => (None, other.cloned()),
        };
        let given = [
            depth_texture,
            view_depth,
            planes.normal.cloned(),
            planes.motion.cloned(),
            view(planes.roughness),
            view(planes.glossy_hit_distance),
            planes.surface_id.cloned(),
            view(planes.confidence_in),
        ];
        let views = given.iter().zip(TEXTURES).map(|(v, (_, class))| v.as_ref().unwrap_or(self.absent.of(class)));
        let views = views.map(wgpu::BindingResource::TextureView);
        let head = || [frame, &uniforms, self.repairs.buffer()].map(wgpu::Buffer::as_entire_binding);
        let resources: Vec<_> = head().into_iter().chain(views).chain([out.as_entire_binding()]).collect();
        run(device, encoder, "quell prepare", &self.guides, resources, *size);
        if let Some(colours) = colours {
            let views = colours.map(|v| wgpu::BindingResource::TextureView(v.unwrap_or(&self.absent.float)));
            let resources = head().into_iter().chain(views).collect();
            run(device, encoder, "quell count repairs", &self.count, resources, *size);
        }
        Ok(())
    }
}

impl Border<'_> {
    fn check(&self) -> Result<(), Error> {
        self.planes.check(self.size)?;
        for (name, view) in COLOURS.into_iter().zip(self.colours.into_iter().flatten()) {
            view.map_or(Ok(()), |view| inputs::check(name, view, Asks::Channels(3), self.size))?;
        }
        Ok(())
    }

    fn uniforms(&self) -> Result<PrepareUniforms, Error> {
        let planes = &self.planes;
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

fn run(
    device: &wgpu::Device,
    encoder: &mut wgpu::CommandEncoder,
    label: &str,
    compiled: &Compiled,
    resources: Vec<wgpu::BindingResource<'_>>,
    size: Size,
) {
    let label = Some(label);
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    let descriptor = wgpu::BindGroupDescriptor { label, layout: &compiled.layout, entries: &entries };
    let group = device.create_bind_group(&descriptor);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
    pass.set_pipeline(&compiled.pipeline);
    pass.set_bind_group(0, &group, &[]);
    let groups = |extent: usize| (extent as u32).div_ceil(super::pass::WORKGROUP);
    pass.dispatch_workgroups(groups(size.width), groups(size.height), 1);
}
