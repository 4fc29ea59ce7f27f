//! A pass made ready for a device, and encoded into the caller's encoder.

use super::error::Error;
use super::pass::{Access, Binding, FIRST_STORAGE, Pass, WORKGROUP};
use crate::plane::Size;
use std::num::NonZeroU64;

/// A compiled pass.
#[derive(Clone, Debug)]
pub struct Kernel {
    pass: Pass,
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<wgpu::ComputePipeline>,
}

impl Kernel {
    /// Compiles a pass on the caller's device.
    pub fn new(device: &wgpu::Device, pass: Pass) -> Self {
        Self::with_source(device, pass, &pass.source())
    }

    /// Likewise from changed WGSL with the same bindings and entry points: for tests that plant a difference.
    pub fn with_source(device: &wgpu::Device, pass: Pass, source: &str) -> Self {
        let label = format!("quell {}", pass.name);
        let label = Some(label.as_str());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let mut entries: Vec<_> = (0..FIRST_STORAGE).map(|i| entry(i, wgpu::BufferBindingType::Uniform)).collect();
        entries.extend(
            (FIRST_STORAGE..)
                .zip(pass.bindings)
                .map(|(i, b)| entry(i, wgpu::BufferBindingType::Storage { read_only: b.access == Access::Read })),
        );
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipelines = pass
            .entries
            .iter()
            .map(|entry| {
                device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label,
                    layout: Some(&pipeline_layout),
                    module: &module,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    cache: None,
                })
            })
            .collect();
        Self { pass, layout, pipelines }
    }

    /// Appends the pass over images of `size` to the caller's encoder; submits nothing.
    ///
    /// `frame` and `settings` are uniform buffers that hold the bytes of [`super::FrameUniforms`] and
    /// [`super::SettingsUniforms`]; `buffers` are those of [`Pass::bindings`], in that order. A buffer that is written
    /// must not be bound twice.
    ///
    /// # Errors
    /// A buffer too many or too few, too small or without its usage; a size beyond the device's limits.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::Buffer,
        settings: &wgpu::Buffer,
        buffers: &[&wgpu::Buffer],
        size: Size,
    ) -> Result<(), Error> {
        let groups = self.check(device, frame, settings, buffers, size)?;
        let label = format!("quell {}", self.pass.name);
        let label = Some(label.as_str());
        let bound = |buffer, bytes| {
            wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: NonZeroU64::new(bytes) })
        };
        // Of a plane only what it needs: the caller's buffer may be larger than a binding may be.
        let planes = self.pass.bindings.iter().zip(buffers);
        let planes = planes.map(|(b, buffer)| bound(buffer, if b.is_plane { bytes(b, size) } else { buffer.size() }));
        let entries: Vec<_> = [frame, settings]
            .map(|uniform| bound(uniform, uniform.size()))
            .into_iter()
            .chain(planes)
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout: &self.layout, entries: &entries });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        pass.set_bind_group(0, &group, &[]);
        for pipeline in &self.pipelines {
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        Ok(())
    }

    /// Everything that can be known before the device sees it; the number of workgroups.
    fn check(
        &self,
        device: &wgpu::Device,
        frame: &wgpu::Buffer,
        settings: &wgpu::Buffer,
        buffers: &[&wgpu::Buffer],
        size: Size,
    ) -> Result<[u32; 2], Error> {
        let (pass, limits) = (self.pass.name, device.limits());
        let beyond = |limit| Error::Size { pass, size, limit };
        let groups = |extent: usize| {
            u32::try_from(extent)
                .ok()
                .map(|n| n.div_ceil(WORKGROUP))
                .filter(|n| (1..=limits.max_compute_workgroups_per_dimension).contains(n))
                .ok_or_else(|| beyond("max_compute_workgroups_per_dimension"))
        };
        let groups = [groups(size.width)?, groups(size.height)?];
        if buffers.len() != self.pass.bindings.len() {
            let expected = self.pass.bindings.len();
            return Err(Error::BufferCount { pass, expected, found: buffers.len() });
        }
        for (binding, uniform) in [("frame", frame), ("settings", settings)] {
            if !uniform.usage().contains(wgpu::BufferUsages::UNIFORM) {
                return Err(Error::BufferUsage { pass, binding, usage: "UNIFORM" });
            }
        }
        for (binding, buffer) in self.pass.bindings.iter().zip(buffers) {
            if !buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
                return Err(Error::BufferUsage { pass, binding: binding.name, usage: "STORAGE" });
            }
            let needed = bytes(binding, size);
            if buffer.size() < needed {
                let found = buffer.size();
                return Err(Error::BufferSize { pass, binding: binding.name, size, needed, found });
            }
            if needed > limits.max_storage_buffer_binding_size {
                return Err(beyond("max_storage_buffer_binding_size"));
            }
        }
        Ok(groups)
    }
}

/// Bytes that a binding holds at the least.
fn bytes(binding: &Binding, size: Size) -> u64 {
    if binding.is_plane { binding.stride * size.pixels() as u64 } else { binding.stride }
}
