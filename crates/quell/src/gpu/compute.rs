//! A compute pipeline whose bindings are not those of a stage: the debug views'.

use super::pass::WORKGROUP;
use super::storage::Texel;
use crate::plane::Size;

/// How a shader declares a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Uniform(&'static str),
    /// Taps, which are only read.
    Taps,
    Float,
    Uint,
    /// A storage texture that is written.
    Stored(wgpu::TextureFormat),
}

impl Kind {
    /// A plane of the denoiser's own that is read.
    pub(super) fn sampled(texel: Texel) -> Self {
        if texel.component() == "u32" { Self::Uint } else { Self::Float }
    }

    fn binding_type(self) -> wgpu::BindingType {
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let view_dimension = wgpu::TextureViewDimension::D2;
        let texture = |sample_type| wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
        match self {
            Self::Uniform(_) => buffer(wgpu::BufferBindingType::Uniform),
            Self::Taps => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Self::Float => texture(wgpu::TextureSampleType::Float { filterable: false }),
            Self::Uint => texture(wgpu::TextureSampleType::Uint),
            Self::Stored(format) => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format,
                view_dimension,
            },
        }
    }

    fn declared(self, binding: u32, name: &str) -> String {
        let (space, ty) = match self {
            Self::Uniform(ty) => ("<uniform>", ty.to_owned()),
            Self::Taps => ("<storage, read>", "array<SpiralTap>".to_owned()),
            Self::Float => ("", "texture_2d<f32>".to_owned()),
            Self::Uint => ("", "texture_2d<u32>".to_owned()),
            Self::Stored(format) => {
                ("", format!("texture_storage_2d<{}, write>", format!("{format:?}").to_lowercase()))
            }
        };
        format!("@group(0) @binding({binding}) var{space} {name}: {ty};\n")
    }
}

/// Names and kinds of a shader's bindings, in order from 0.
pub(super) type Bindings = [(&'static str, Kind)];

/// The shader: its bindings, then its pieces.
pub(super) fn source(bindings: &Bindings, pieces: &[&str]) -> String {
    let declared: String = (0..).zip(bindings).map(|(i, (name, kind))| kind.declared(i, name)).collect();
    std::iter::once(declared.as_str()).chain(pieces.iter().copied()).collect::<Vec<_>>().join("\n")
}

/// Compiles a shader whose bindings are all in group 0: its layout, and a pipeline for each entry point, under one label.
pub(super) fn compiled<const N: usize>(
    device: &wgpu::Device,
    label: &str,
    points: [&str; N],
    source: &str,
    entries: &[wgpu::BindGroupLayoutEntry],
) -> (wgpu::BindGroupLayout, [wgpu::ComputePipeline; N]) {
    let label = Some(label);
    let module = device
        .create_shader_module(wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(source.into()) });
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = |point| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    };
    (layout, points.map(pipeline))
}

/// Such a pipeline on a device.
#[derive(Debug)]
pub(super) struct Compute {
    label: String,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Compute {
    pub(super) fn new(device: &wgpu::Device, entry: &str, bindings: &Bindings, source: String) -> Self {
        let label = format!("quell {entry}");
        let entries: Vec<_> = (0..)
            .zip(bindings)
            .map(|(binding, (_, kind))| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: kind.binding_type(),
                count: None,
            })
            .collect();
        let (layout, [pipeline]) = compiled(device, &label, [entry], &source, &entries);
        Self { label, layout, pipeline }
    }

    /// Appends it over an image of `size`; `resources` in the order of the bindings.
    pub(super) fn encode<'a>(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
        size: Size,
    ) {
        let label = Some(self.label.as_str());
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let descriptor = wgpu::BindGroupDescriptor { label, layout: &self.layout, entries: &entries };
        let group = device.create_bind_group(&descriptor);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let groups = |extent: usize| (extent as u32).div_ceil(WORKGROUP);
        pass.dispatch_workgroups(groups(size.width), groups(size.height), 1);
    }
}
