//! Shaders of the sequence filter's stages 1 and 2, compiled; the wavelet's is in `sequence.rs`.

use super::compute::compiled;
use super::sequence::{GUIDED, Level, SequenceWavelet};
use super::uniform::{Uniform, uniforms};
use glam::{UVec2, Vec4};

uniforms! {
    pub(super) Local as "Local" {
        pub(super) size: UVec2,
        pub(super) layer: i32,
        pub(super) seen: u32,
    }
    pub(super) Gather as "Gather" {
        pub(super) size: UVec2,
        pub(super) first_row: i32,
        pub(super) picture_height: i32,
        pub(super) count: i32,
        pub(super) centre: i32,
        pub(super) steps: i32,
        pub(super) future: u32,
        pub(super) farthest: f32,
        pub(super) plane_distance: f32,
        pub(super) round_trip: f32,
        pub(super) seen_albedo: f32,
        pub(super) seen_normal: f32,
        pub(super) seen: u32,
        pub(super) reflected: u32,
        pub(super) planes: u32,
        pub(super) begins: u32,
        pub(super) decay: Vec4,
    }
}

/// How a shader of the sequence filter binds a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceBinding {
    /// A uniform buffer.
    Uniform,
    /// An array of textures, a layer a frame.
    Frames,
    /// A storage buffer that is only read.
    Read,
    /// A storage buffer that is written.
    Write,
}

use SequenceBinding::{Frames, Read, Uniform as Told, Write};

const GUIDES: [(&str, SequenceBinding); 9] = [
    ("local", Told),
    ("surfaces", Frames),
    ("surface_normals", Frames),
    ("seen_colours", Frames),
    ("seen_normals", Frames),
    ("local_geometry", Write),
    ("local_normals", Write),
    ("local_colours", Write),
    ("local_seen_normals", Write),
];

const GATHER: [(&str, SequenceBinding); 20] = [
    ("told", Told),
    ("surfaces", Frames),
    ("surface_normals", Frames),
    ("seen_colours", Frames),
    ("seen_normals", Frames),
    ("to_previous", Frames),
    ("to_next", Frames),
    ("reflection_to_previous", Frames),
    ("reflection_to_next", Frames),
    ("samples_0", Frames),
    ("samples_1", Frames),
    ("samples_2", Frames),
    ("samples_3", Frames),
    ("members", Read),
    ("mean_0", Write),
    ("mean_1", Write),
    ("mean_2", Write),
    ("mean_3", Write),
    ("counts", Write),
    ("most", Write),
];

const VARIANCE: [(&str, SequenceBinding); 9] = [
    ("level", Told),
    ("geometry", Read),
    ("normals", Read),
    ("guide_colours", Read),
    ("seen_normals", Read),
    ("light", Read),
    ("counts", Read),
    ("given", Read),
    ("pooled", Write),
];

/// Colour planes that one dispatch of stage 1 takes.
pub(super) const TOGETHER: usize = 4;

/// A shader of stages 1 and 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceShader {
    /// Guides of the frame made ready: slopes of the depth, noise.
    Guides,
    /// Stage 1.
    Gather,
    /// Stage 2.
    Variance,
}

impl SequenceShader {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Guides, Self::Gather, Self::Variance];

    /// The WGSL.
    pub fn source(self) -> String {
        match self {
            Self::Guides => include_str!("../sequence/guides.wgsl").to_owned(),
            Self::Gather => {
                [include_str!("../sequence/weight.wgsl"), include_str!("../sequence/gather.wgsl")].join("\n")
            }
            Self::Variance => [GUIDED, include_str!("../sequence/variance.wgsl")].join("\n"),
        }
    }

    /// Its entry point.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Guides => "make_local",
            Self::Gather => "accumulate",
            Self::Variance => "variance",
        }
    }

    /// Its bindings, from 0 on.
    pub fn bindings(self) -> &'static [(&'static str, SequenceBinding)] {
        match self {
            Self::Guides => &GUIDES,
            Self::Gather => &GATHER,
            Self::Variance => &VARIANCE,
        }
    }

    /// The struct that it is told.
    pub fn layout(self) -> Uniform {
        match self {
            Self::Guides => Local::layout(),
            Self::Gather => Gather::layout(),
            Self::Variance => Level::layout(),
        }
    }
}

/// Stages 1 to 3, compiled for a device.
#[derive(Clone, Debug)]
pub struct SequenceShaders {
    guides: Compiled,
    gather: Compiled,
    variance: Compiled,
    pub(super) wavelet: SequenceWavelet,
}

impl SequenceShaders {
    /// Compiles them on the caller's device.
    pub fn new(device: &wgpu::Device) -> Self {
        let compiled = |shader: SequenceShader| Compiled::new(device, shader, &shader.source());
        Self {
            guides: compiled(SequenceShader::Guides),
            gather: compiled(SequenceShader::Gather),
            variance: compiled(SequenceShader::Variance),
            wavelet: SequenceWavelet::new(device),
        }
    }

    /// The same with one of them from changed WGSL, with the same bindings and entry point: for tests that plant a
    /// difference.
    #[must_use]
    pub fn with_source(&self, device: &wgpu::Device, shader: SequenceShader, source: &str) -> Self {
        let mut changed = self.clone();
        let place = match shader {
            SequenceShader::Guides => &mut changed.guides,
            SequenceShader::Gather => &mut changed.gather,
            SequenceShader::Variance => &mut changed.variance,
        };
        *place = Compiled::new(device, shader, source);
        changed
    }

    /// Stage 3 alone.
    pub fn wavelet(&self) -> &SequenceWavelet {
        &self.wavelet
    }

    pub(super) fn get(&self, shader: SequenceShader) -> &Compiled {
        match shader {
            SequenceShader::Guides => &self.guides,
            SequenceShader::Gather => &self.gather,
            SequenceShader::Variance => &self.variance,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Compiled {
    label: String,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Compiled {
    fn new(device: &wgpu::Device, shader: SequenceShader, source: &str) -> Self {
        let label = format!("quell sequence {}", shader.entry());
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let ty = |kind| match kind {
            Told => buffer(wgpu::BufferBindingType::Uniform),
            Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
            Frames => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2Array,
                multisampled: false,
            },
        };
        let entry = |(binding, (_, kind)): (u32, &(&str, SequenceBinding))| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: ty(*kind),
            count: None,
        };
        let entries: Vec<_> = (0..).zip(shader.bindings()).map(entry).collect();
        let (layout, [pipeline]) = compiled(device, &label, [shader.entry()], source, &entries);
        Self { label, layout, pipeline }
    }

    /// Appends it; resources in the order of its bindings.
    pub(super) fn encode<'a>(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
        groups: [u32; 2],
    ) {
        let label = Some(self.label.as_str());
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout: &self.layout, entries: &entries });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }
}
