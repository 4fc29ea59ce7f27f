//! A pass made ready for a device, and encoded into the caller's encoder.

use super::error::Error;
use super::pass::{Binding, BindingKind, Pass, Sample};
use super::storage::Storage;
use super::timing::Timings;
use crate::plane::Size;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError};

/// A compiled pass.
#[derive(Clone, Debug)]
pub struct Kernel {
    pass: Pass,
    storage: Storage,
    label: String,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    /// Where dispatches that nobody else times are timed.
    timings: Option<Arc<Mutex<Timings>>>,
}

/// What is bound to a pass.
#[derive(Clone, Copy, Debug)]
pub enum Bindable<'a> {
    /// To [`BindingKind::Sampled`], [`BindingKind::Stored`], [`BindingKind::Host`], [`BindingKind::Frames`],
    /// [`BindingKind::Picture`] and [`BindingKind::Layers`].
    Plane(&'a wgpu::TextureView),
    /// To [`BindingKind::Taps`].
    Taps(&'a wgpu::Buffer),
    /// To [`BindingKind::Counts`].
    Counts(&'a wgpu::Buffer),
    /// To [`BindingKind::Uniform`].
    Uniform(&'a wgpu::Buffer),
    /// To [`BindingKind::Read`] and [`BindingKind::Write`].
    Buffer(&'a wgpu::Buffer),
}

impl<'a> Bindable<'a> {
    /// For images of `size`. Of a buffer as much as the picture needs: the device limits what is bound.
    fn resource(self, kind: BindingKind, size: Size) -> wgpu::BindingResource<'a> {
        match self {
            Self::Plane(view) => wgpu::BindingResource::TextureView(view),
            Self::Taps(buffer) | Self::Counts(buffer) | Self::Uniform(buffer) => buffer.as_entire_binding(),
            Self::Buffer(buffer) => match plane_bytes(kind, size) {
                None => buffer.as_entire_binding(),
                Some(bytes) => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset: 0,
                    size: NonZeroU64::new(bytes),
                }),
            },
        }
    }
}

/// Bytes of a plane in a storage buffer.
fn plane_bytes(kind: BindingKind, size: Size) -> Option<u64> {
    match kind {
        BindingKind::Read(element) | BindingKind::Write(element) => {
            element.bytes().map(|bytes| bytes.saturating_mul(size.pixels() as u64))
        }
        _ => None,
    }
}

/// Uniform buffers that hold the bytes of [`super::FrameUniforms`] and [`super::SettingsUniforms`].
#[derive(Clone, Copy, Debug)]
pub struct PerFrameUniforms<'a> {
    /// The frame.
    pub frame: &'a wgpu::Buffer,
    /// The settings.
    pub settings: &'a wgpu::Buffer,
}

/// A dispatch that was checked, with what it binds.
#[derive(Debug)]
pub(super) struct Ready<'k> {
    kernel: &'k Kernel,
    group: wgpu::BindGroup,
    groups: [u32; 2],
}

impl Ready<'_> {
    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        self.kernel.dispatch(encoder, &self.group, self.groups, None);
    }
}

impl Kernel {
    /// Compiles a pass on the caller's device. `host_input`: see [`Pass::source`].
    pub fn new(device: &wgpu::Device, pass: Pass, storage: Storage, host_input: bool) -> Self {
        Self::with_source(device, pass, storage, &pass.source(storage, host_input))
    }

    /// [`Kernel::new`] from changed WGSL with the same bindings and entry point: for tests that plant a difference.
    pub fn with_source(device: &wgpu::Device, pass: Pass, storage: Storage, source: &str) -> Self {
        let name = format!("quell {}", pass.name);
        let label = Some(name.as_str());
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let uniforms = (0..pass.first_binding()).map(|_| uniform);
        let types = uniforms.chain(pass.bindings.iter().map(|binding| binding_type(binding.kind, storage)));
        let entry = |(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let entries: Vec<_> = (0..).zip(types).map(entry).collect();
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(pass.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { pass, storage, label: name, layout, pipeline, timings: None }
    }

    /// The same, timed from now on, where there are timings.
    pub(super) fn timed(self, timings: Option<&Arc<Mutex<Timings>>>) -> Self {
        Self { timings: timings.cloned(), ..self }
    }

    /// What it runs.
    pub(super) fn pass(&self) -> &Pass {
        &self.pass
    }

    /// Appends the pass over images of `size` to the caller's encoder; submits nothing. `uniforms`: those of a pass that is
    /// [`Pass::per_frame`]. `bound` are the resources of [`Pass::bindings`], in that order; a plane that is written must not
    /// be bound twice.
    ///
    /// # Errors
    /// A resource too many or too few, of another kind, too small, of another format or without its usage; a size beyond
    /// the device's limits.
    pub fn encode<'a>(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        uniforms: impl Into<Option<PerFrameUniforms<'a>>>,
        bound: &[Bindable<'a>],
        size: Size,
    ) -> Result<(), Error> {
        self.ready(device, uniforms, bound, size)?.encode(encoder);
        Ok(())
    }

    /// [`Kernel::encode`], checked and ready for an encoder.
    pub(super) fn ready<'a>(
        &self,
        device: &wgpu::Device,
        uniforms: impl Into<Option<PerFrameUniforms<'a>>>,
        bound: &[Bindable<'a>],
        size: Size,
    ) -> Result<Ready<'_>, Error> {
        let uniforms = uniforms.into().filter(|_| self.pass.per_frame);
        let groups = self.check(device, uniforms, bound, size)?;
        let uniforms = uniforms.into_iter().flat_map(|u| [u.frame, u.settings]).map(wgpu::Buffer::as_entire_binding);
        let bound = self.pass.bindings.iter().zip(bound).map(|(binding, b)| b.resource(binding.kind, size));
        let group = self.group(device, uniforms.chain(bound).collect());
        Ok(Ready { kernel: self, group, groups })
    }

    /// The resources as the pass binds them: frame and settings where it is per frame, then those of [`Pass::bindings`].
    pub(super) fn group(&self, device: &wgpu::Device, resources: Vec<wgpu::BindingResource<'_>>) -> wgpu::BindGroup {
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let label = Some(self.label.as_str());
        device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout: &self.layout, entries: &entries })
    }

    pub(super) fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        group: &wgpu::BindGroup,
        groups: [u32; 2],
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        let label = Some(self.label.as_str());
        let mut timings = self.timings.as_deref().map(|timings| timings.lock().unwrap_or_else(PoisonError::into_inner));
        let own = timings.as_mut().filter(|_| timestamp_writes.is_none());
        let timestamp_writes = timestamp_writes.or_else(|| own.and_then(|timings| timings.next(&self.pass)));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes });
        pass.set_bind_group(0, group, &[]);
        pass.set_pipeline(&self.pipeline);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }

    /// Everything that can be known before the device sees it; the number of workgroups.
    fn check(
        &self,
        device: &wgpu::Device,
        uniforms: Option<PerFrameUniforms<'_>>,
        bound: &[Bindable<'_>],
        size: Size,
    ) -> Result<[u32; 2], Error> {
        let pass = self.pass.name;
        let groups = workgroups(device, &self.pass, size)?;
        if bound.len() != self.pass.bindings.len() {
            let expected = self.pass.bindings.len();
            return Err(Error::Count { pass, expected, found: bound.len() });
        }
        if self.pass.per_frame && uniforms.is_none() {
            return Err(Error::Kind { pass, binding: "frame", expected: "a uniform buffer" });
        }
        for (name, uniform) in uniforms.iter().flat_map(|u| [("frame", u.frame), ("settings", u.settings)]) {
            check_usage(pass, name, uniform, wgpu::BufferUsages::UNIFORM)?;
        }
        for (binding, given) in self.pass.bindings.iter().zip(bound) {
            self.check_bound(device, binding, given, size)?;
        }
        Ok(groups)
    }

    fn check_bound(
        &self,
        device: &wgpu::Device,
        binding: &Binding,
        given: &Bindable<'_>,
        size: Size,
    ) -> Result<(), Error> {
        let (pass, name) = (self.pass.name, binding.name);
        // Of these the extent is whoever's that binds it: what stands in has one texel.
        let any = Size::new(1, 1);
        match (binding.kind, given) {
            (BindingKind::Taps, Bindable::Taps(buffer)) | (BindingKind::Counts(_), Bindable::Counts(buffer)) => {
                check_usage(pass, name, buffer, wgpu::BufferUsages::STORAGE)
            }
            (BindingKind::Uniform(_), Bindable::Uniform(buffer)) => {
                check_usage(pass, name, buffer, wgpu::BufferUsages::UNIFORM)
            }
            (kind @ (BindingKind::Read(_) | BindingKind::Write(_)), Bindable::Buffer(buffer)) => {
                check_usage(pass, name, buffer, wgpu::BufferUsages::STORAGE)?;
                let (needed, found) = (plane_bytes(kind, size).unwrap_or(0), buffer.size());
                if needed > device.limits().max_storage_buffer_binding_size {
                    return Err(Error::Size { pass, size, limit: "max_storage_buffer_binding_size" });
                }
                if found < needed {
                    return Err(Error::BufferSize { pass, binding: name, size, needed, found });
                }
                Ok(())
            }
            (BindingKind::Host(sample), Bindable::Plane(view)) => {
                check_sampled(pass, name, view, sample.sample_type(), any)
            }
            (BindingKind::Frames, Bindable::Plane(view)) => {
                check_sampled(pass, name, view, Sample::Float.sample_type(), any)
            }
            (BindingKind::Sampled(texel), Bindable::Plane(view)) => {
                check_sampled(pass, name, view, texel.sample_type(), size)
            }
            (BindingKind::Stored(texel), Bindable::Plane(view)) => {
                let (format, expected) = (texel.format(self.storage), texel.format_name(self.storage));
                check_stored(pass, name, view.texture(), (format, expected), size)
            }
            (BindingKind::Layers(format), Bindable::Plane(view)) => {
                check_stored(pass, name, view.texture(), (format, "the format of the pass"), size)
            }
            (BindingKind::Picture(format), Bindable::Plane(view)) => {
                let expected = "the format that the views were made for";
                check_stored(pass, name, view.texture(), (format, expected), size)
            }
            (kind, _) => {
                let expected = match kind {
                    BindingKind::Taps => "a buffer of taps",
                    BindingKind::Counts(_) => "a buffer of counts",
                    BindingKind::Uniform(_) => "a uniform buffer",
                    BindingKind::Read(_) | BindingKind::Write(_) => "a storage buffer",
                    _ => "a texture",
                };
                Err(Error::Kind { pass, binding: name, expected })
            }
        }
    }
}

/// A binding as the device has it.
fn binding_type(kind: BindingKind, storage: Storage) -> wgpu::BindingType {
    use wgpu::BufferBindingType as Buffer;
    use wgpu::TextureViewDimension as Dimension;
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let sampled =
        |sample_type, view_dimension| wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
    let stored = |format, view_dimension| wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format,
        view_dimension,
    };
    match kind {
        BindingKind::Sampled(texel) => sampled(texel.sample_type(), Dimension::D2),
        BindingKind::Host(sample) => sampled(sample.sample_type(), Dimension::D2),
        BindingKind::Frames => sampled(Sample::Float.sample_type(), Dimension::D2Array),
        BindingKind::Stored(texel) => stored(texel.format(storage), Dimension::D2),
        BindingKind::Picture(format) => stored(format, Dimension::D2),
        BindingKind::Layers(format) => stored(format, Dimension::D2Array),
        BindingKind::Taps | BindingKind::Read(_) => buffer(Buffer::Storage { read_only: true }),
        BindingKind::Counts(_) | BindingKind::Write(_) => buffer(Buffer::Storage { read_only: false }),
        BindingKind::Uniform(_) => buffer(Buffer::Uniform),
    }
}

fn check_usage(
    pass: &'static str,
    binding: &'static str,
    buffer: &wgpu::Buffer,
    usage: wgpu::BufferUsages,
) -> Result<(), Error> {
    if buffer.usage().contains(usage) {
        return Ok(());
    }
    let usage = if usage == wgpu::BufferUsages::UNIFORM { "UNIFORM" } else { "STORAGE" };
    Err(Error::Usage { pass, binding, usage })
}

/// A texture that a shader writes: the format, and how an error names it.
pub(super) fn check_stored(
    pass: &'static str,
    binding: &'static str,
    texture: &wgpu::Texture,
    (format, expected): (wgpu::TextureFormat, &'static str),
    size: Size,
) -> Result<(), Error> {
    if texture.format() != format {
        return Err(Error::Format { pass, binding, expected, found: texture.format() });
    }
    if !texture.usage().contains(wgpu::TextureUsages::STORAGE_BINDING) {
        return Err(Error::Usage { pass, binding, usage: "STORAGE_BINDING" });
    }
    check_extent(pass, binding, texture, size)
}

/// Workgroups of a pass along each axis.
pub(super) fn workgroups(device: &wgpu::Device, pass: &Pass, size: Size) -> Result<[u32; 2], Error> {
    workgroups_of(device, pass.name, pass.workgroup(), size)
}

/// The same of workgroups that cover `side` pixels along each axis.
pub(super) fn workgroups_of(
    device: &wgpu::Device,
    pass: &'static str,
    side: u32,
    size: Size,
) -> Result<[u32; 2], Error> {
    let most = device.limits().max_compute_workgroups_per_dimension;
    let groups = |extent: usize| {
        u32::try_from(extent).ok().map(|n| n.div_ceil(side)).filter(|n| (1..=most).contains(n)).ok_or(Error::Size {
            pass,
            size,
            limit: "max_compute_workgroups_per_dimension",
        })
    };
    Ok([groups(size.width)?, groups(size.height)?])
}

/// A texture that a shader loads from.
pub(super) fn check_sampled(
    pass: &'static str,
    binding: &'static str,
    view: &wgpu::TextureView,
    wanted: wgpu::TextureSampleType,
    size: Size,
) -> Result<(), Error> {
    let texture = view.texture();
    use wgpu::TextureSampleType as T;
    let fits = match (texture.format().sample_type(None, None), wanted) {
        (Some(T::Uint), T::Uint) | (Some(T::Float { .. }), T::Float { .. }) => true,
        (_, T::Depth) => super::inputs::is_depth(texture.format()),
        _ => false,
    };
    if !fits {
        let expected = match wanted {
            T::Uint => "a format of unsigned integers",
            T::Depth => "a depth format",
            _ => "a colour format of floats",
        };
        return Err(Error::Format { pass, binding, expected, found: texture.format() });
    }
    check_texture(pass, binding, texture, size)
}

/// Usage, samples, dimension and extent of a texture that a shader loads from.
pub(super) fn check_texture(
    pass: &'static str,
    binding: &'static str,
    texture: &wgpu::Texture,
    size: Size,
) -> Result<(), Error> {
    if !texture.usage().contains(wgpu::TextureUsages::TEXTURE_BINDING) {
        return Err(Error::Usage { pass, binding, usage: "TEXTURE_BINDING" });
    }
    if texture.sample_count() != 1 || texture.dimension() != wgpu::TextureDimension::D2 {
        return Err(Error::Kind { pass, binding, expected: "a 2D texture of one sample" });
    }
    check_extent(pass, binding, texture, size)
}

pub(super) fn check_extent(
    pass: &'static str,
    binding: &'static str,
    texture: &wgpu::Texture,
    size: Size,
) -> Result<(), Error> {
    let found = Size::new(texture.width() as usize, texture.height() as usize);
    if found.width < size.width || found.height < size.height {
        return Err(Error::TextureSize { pass, binding, needed: size, found });
    }
    Ok(())
}
