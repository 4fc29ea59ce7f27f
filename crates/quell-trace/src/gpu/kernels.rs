//! Compute pipelines, one set for each kind of scene.

use super::jobs::Kernel;
use super::layout;
use super::shader::{self, Variant};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Threads of a workgroup along both axes (`@workgroup_size` in WGSL).
pub(super) const GROUP: u32 = 8;

/// Bytes from one job to the next in its uniform buffer: WebGPU's default alignment.
pub(super) const JOB_STRIDE: usize = 256;

/// The pipelines of one kind of scene.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) scene_layout: wgpu::BindGroupLayout,
    pub(super) band_layout: wgpu::BindGroupLayout,
    primary: wgpu::ComputePipeline,
    direct: wgpu::ComputePipeline,
    paths: wgpu::ComputePipeline,
    accumulate: wgpu::ComputePipeline,
}

/// Pipelines that were made for a device, to be used again: making them takes longer than a small frame.
#[derive(Debug, Default)]
pub struct Kernels {
    made: Mutex<HashMap<Variant, Arc<Pipelines>>>,
    /// What tests put in the place of parts of the program: from, to.
    planted: Vec<(String, String)>,
}

impl Kernels {
    /// For tests: kernels of a program in which each first text is replaced by its second.
    #[doc(hidden)]
    pub fn planted(texts: &[(&str, &str)]) -> Self {
        let planted = texts.iter().map(|&(from, to)| (from.to_owned(), to.to_owned())).collect();
        Self { planted, ..Self::default() }
    }

    /// The pipelines of a kind of scene.
    pub(super) fn of(&self, device: &wgpu::Device, variant: Variant) -> Arc<Pipelines> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let new = || {
            let mut text = shader::source(variant);
            for (from, to) in &self.planted {
                text = text.replace(from.as_str(), to);
            }
            Arc::new(Pipelines::new(device, &text))
        };
        Arc::clone(made.entry(variant).or_insert_with(new))
    }
}

fn storage(binding: u32, read_only: bool) -> wgpu::BindGroupLayoutEntry {
    entry(
        binding,
        wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
    )
}

fn uniform<T>(binding: u32, has_dynamic_offset: bool) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BufferBindingType::Uniform;
    let min_binding_size = wgpu::BufferSize::new(size_of::<T>() as u64);
    entry(binding, wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size })
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

impl Pipelines {
    fn new(device: &wgpu::Device, text: &str) -> Self {
        let texels = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2Array,
            multisampled: false,
        };
        let mut scene = vec![uniform::<layout::Frame>(0, false)];
        scene.extend((1..=6).map(|binding| storage(binding, true)));
        scene.push(entry(7, texels));
        let band = [storage(0, false), storage(1, false), uniform::<layout::Job>(2, true)];
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let (scene_layout, band_layout) = (layout("quell scene", &scene), layout("quell band", &band));
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("quell tracer"),
            bind_group_layouts: &[Some(&scene_layout), Some(&band_layout)],
            ..Default::default()
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("quell tracer"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = |name| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let [primary, direct, paths, accumulate] = ["primary", "direct", "paths", "accumulate"].map(pipeline);
        Self { scene_layout, band_layout, primary, direct, paths, accumulate }
    }

    pub(super) fn of(&self, kernel: Kernel) -> &wgpu::ComputePipeline {
        match kernel {
            Kernel::Primary => &self.primary,
            Kernel::Direct => &self.direct,
            Kernel::Paths => &self.paths,
            Kernel::Accumulate => &self.accumulate,
        }
    }
}
