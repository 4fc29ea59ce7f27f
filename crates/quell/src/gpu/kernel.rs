//! A pass made ready for a device, and encoded into the caller's encoder.

use super::compute::compiled;
use super::error::Error;
use super::pass::{BindingKind, FIRST_BINDING, Pass, WORKGROUP};
use super::storage::Storage;
use crate::plane::Size;

/// A compiled pass.
#[derive(Clone, Debug)]
pub struct Kernel {
    pass: Pass,
    storage: Storage,
    label: String,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

/// What is bound to a pass.
#[derive(Clone, Copy, Debug)]
pub enum Bindable<'a> {
    /// To [`BindingKind::Sampled`], [`BindingKind::Stored`] and [`BindingKind::Host`].
    Plane(&'a wgpu::TextureView),
    /// To [`BindingKind::Taps`].
    Taps(&'a wgpu::Buffer),
    /// To [`BindingKind::Counts`].
    Counts(&'a wgpu::Buffer),
    /// To [`BindingKind::Uniform`].
    Uniform(&'a wgpu::Buffer),
}

impl<'a> Bindable<'a> {
    fn resource(self) -> wgpu::BindingResource<'a> {
        match self {
            Self::Plane(view) => wgpu::BindingResource::TextureView(view),
            Self::Taps(buffer) | Self::Counts(buffer) | Self::Uniform(buffer) => buffer.as_entire_binding(),
        }
    }
}

/// Uniform buffers that hold the bytes of [`super::FrameUniforms`] and [`super::SettingsUniforms`].
#[derive(Clone, Copy, Debug)]
pub struct Told<'a> {
    /// The frame.
    pub frame: &'a wgpu::Buffer,
    /// The settings.
    pub settings: &'a wgpu::Buffer,
}

impl Kernel {
    /// Compiles a pass on the caller's device. `host_input`: see [`Pass::source`].
    pub fn new(device: &wgpu::Device, pass: Pass, storage: Storage, host_input: bool) -> Self {
        Self::with_source(device, pass, storage, &pass.source(storage, host_input))
    }

    /// Likewise from changed WGSL with the same bindings and entry point: for tests that plant a difference.
    pub fn with_source(device: &wgpu::Device, pass: Pass, storage: Storage, source: &str) -> Self {
        let label = format!("quell {}", pass.name);
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let uniforms = (0..FIRST_BINDING).map(|i| entry(i, buffer(wgpu::BufferBindingType::Uniform)));
        let rest = (FIRST_BINDING..).zip(pass.bindings).map(|(i, b)| {
            let view_dimension = wgpu::TextureViewDimension::D2;
            let sampled = |sample_type| wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
            let ty = match b.kind {
                BindingKind::Sampled(texel) => sampled(texel.sample_type()),
                BindingKind::Host(sample) => sampled(sample.sample_type()),
                BindingKind::Stored(texel) => wgpu::BindingType::StorageTexture {
                    access: wgpu::StorageTextureAccess::WriteOnly,
                    format: texel.format(storage),
                    view_dimension,
                },
                BindingKind::Taps => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
                BindingKind::Counts(_) => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
                BindingKind::Uniform(_) => buffer(wgpu::BufferBindingType::Uniform),
            };
            entry(i, ty)
        });
        let entries: Vec<_> = uniforms.chain(rest).collect();
        let (layout, [pipeline]) = compiled(device, &label, [pass.entry], source, &entries);
        Self { pass, storage, label, layout, pipeline }
    }

    /// Appends the pass over images of `size` to the caller's encoder; submits nothing. `bound` are the resources of
    /// [`Pass::bindings`], in that order; a plane that is written must not be bound twice.
    ///
    /// # Errors
    /// A resource too many or too few, of another kind, too small, of another format or without its usage; a size beyond
    /// the device's limits.
    pub fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        told: Told<'_>,
        bound: &[Bindable<'_>],
        size: Size,
    ) -> Result<(), Error> {
        let groups = self.check(device, told, bound, size)?;
        let told = [told.frame, told.settings].map(wgpu::Buffer::as_entire_binding).into_iter();
        let group = self.group(device, told.chain(bound.iter().map(|b| b.resource())).collect());
        self.dispatch(encoder, &group, groups, None);
        Ok(())
    }

    /// The resources as the pass binds them: frame, settings, then those of [`Pass::bindings`].
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
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes });
        pass.set_bind_group(0, group, &[]);
        pass.set_pipeline(&self.pipeline);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }

    /// Everything that can be known before the device sees it; the number of workgroups.
    fn check(
        &self,
        device: &wgpu::Device,
        told: Told<'_>,
        bound: &[Bindable<'_>],
        size: Size,
    ) -> Result<[u32; 2], Error> {
        let pass = self.pass.name;
        let groups = workgroups(device, pass, size)?;
        if bound.len() != self.pass.bindings.len() {
            let expected = self.pass.bindings.len();
            return Err(Error::Count { pass, expected, found: bound.len() });
        }
        for (binding, uniform) in [("frame", told.frame), ("settings", told.settings)] {
            if !uniform.usage().contains(wgpu::BufferUsages::UNIFORM) {
                return Err(Error::Usage { pass, binding, usage: "UNIFORM" });
            }
        }
        for (binding, given) in self.pass.bindings.iter().zip(bound) {
            let name = binding.name;
            match (binding.kind, given) {
                (BindingKind::Taps, Bindable::Taps(buffer)) | (BindingKind::Counts(_), Bindable::Counts(buffer)) => {
                    if !buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
                        return Err(Error::Usage { pass, binding: name, usage: "STORAGE" });
                    }
                }
                (BindingKind::Uniform(_), Bindable::Uniform(buffer)) => {
                    if !buffer.usage().contains(wgpu::BufferUsages::UNIFORM) {
                        return Err(Error::Usage { pass, binding: name, usage: "UNIFORM" });
                    }
                }
                // The extent is whoever's that binds it: what stands in has one texel.
                (BindingKind::Host(sample), Bindable::Plane(view)) => {
                    check_sampled(pass, name, view, sample.sample_type(), Size::new(1, 1))?;
                }
                (BindingKind::Sampled(texel), Bindable::Plane(view)) => {
                    check_sampled(pass, name, view, texel.sample_type(), size)?;
                }
                (BindingKind::Stored(texel), Bindable::Plane(view)) => {
                    let (texture, format) = (view.texture(), texel.format(self.storage));
                    if texture.format() != format {
                        let (expected, found) = (texel.format_name(self.storage), texture.format());
                        return Err(Error::Format { pass, binding: name, expected, found });
                    }
                    if !texture.usage().contains(wgpu::TextureUsages::STORAGE_BINDING) {
                        return Err(Error::Usage { pass, binding: name, usage: "STORAGE_BINDING" });
                    }
                    check_extent(pass, name, texture, size)?;
                }
                (kind, _) => {
                    let expected = match kind {
                        BindingKind::Taps => "a buffer of taps",
                        BindingKind::Counts(_) => "a buffer of counts",
                        BindingKind::Uniform(_) => "a uniform buffer",
                        _ => "a texture",
                    };
                    return Err(Error::Kind { pass, binding: name, expected });
                }
            }
        }
        Ok(groups)
    }
}

/// Workgroups along each axis.
pub(super) fn workgroups(device: &wgpu::Device, pass: &'static str, size: Size) -> Result<[u32; 2], Error> {
    let most = device.limits().max_compute_workgroups_per_dimension;
    let groups = |extent: usize| {
        u32::try_from(extent)
            .ok()
            .map(|n| n.div_ceil(WORKGROUP))
            .filter(|n| (1..=most).contains(n))
            .ok_or(Error::Size { pass, size, limit: "max_compute_workgroups_per_dimension" })
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
