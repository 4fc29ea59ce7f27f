//! The denoiser's own textures: one for each plane of the program, two where it alternates.

use super::error::Error;
use super::program::{Holds, Memory, Program, Role};
use super::slot::Slot;
use super::storage::Storage;
use crate::denoiser::MAX_EXTENT;
use crate::plane::Size;
use std::collections::HashMap;

/// Textures of one image size. What a program lacks is added when it first runs.
#[derive(Debug)]
pub(super) struct Planes {
    size: Size,
    label: String,
    storage: Storage,
    copies: HashMap<Slot, Vec<wgpu::TextureView>>,
}

impl Planes {
    /// # Errors
    /// A size without pixels, or beyond what this crate or the device takes.
    pub(super) fn new(device: &wgpu::Device, size: Size, label: &str, storage: Storage) -> Result<Self, Error> {
        check_size(&device.limits(), size)?;
        Ok(Self { size, label: label.to_owned(), storage, copies: HashMap::new() })
    }

    /// Makes what a program needs and is not there yet.
    pub(super) fn ensure(&mut self, device: &wgpu::Device, program: &Program) {
        for resource in &program.resources {
            use wgpu::TextureUsages as U;
            let (size, format, usage) = match (resource.holds, resource.role) {
                (_, Role::Input) => continue,
                _ if resource.shares.is_some() => continue,
                (Holds::Plane(texel), _) => {
                    let usage = U::TEXTURE_BINDING | U::STORAGE_BINDING | U::COPY_SRC | U::COPY_DST;
                    (self.size, texel.format(self.storage), usage)
                }
                // Nobody writes it: what a texture holds at first is zero.
                (Holds::Host(sample), _) => (Size::new(1, 1), sample.absent_format(), U::TEXTURE_BINDING),
                (Holds::Taps | Holds::Counts(_) | Holds::Uniform(_), _) => continue,
            };
            let whose = match resource.slot {
                Slot::Joint { index, .. } => format!(" of joint plane {index}"),
                _ => String::new(),
            };
            let label = format!("{} {}{whose}", self.label, resource.slot.name());
            let copies = self.copies.entry(resource.slot).or_default();
            let names: &[&str] = if resource.alternates { &["", " (other)"] } else { &[""] };
            if copies.len() < names.len() {
                let make = |other: &&str| {
                    let label = format!("{label}{other}");
                    let texture = device.create_texture(&wgpu::TextureDescriptor {
                        label: Some(&label),
                        size: extent_of(size),
                        mip_level_count: 1,
                        sample_count: 1,
                        dimension: wgpu::TextureDimension::D2,
                        format,
                        usage,
                        view_formats: &[],
                    });
                    let descriptor = wgpu::TextureViewDescriptor { label: Some(&label), ..Default::default() };
                    texture.create_view(&descriptor)
                };
                *copies = names.iter().map(make).collect();
            }
        }
    }

    /// Bytes of all textures that were made, whichever program needed them; what stands in for absent ones left out.
    pub(super) fn memory(&self) -> Memory {
        let mut memory = Memory::default();
        for (slot, copies) in &self.copies {
            let textures = copies.iter().map(wgpu::TextureView::texture);
            let bytes = textures.map(|texture| {
                let texel = texture.format().block_copy_size(None).unwrap_or_default();
                u64::from(texel) * u64::from(texture.width()) * u64::from(texture.height())
            });
            match (slot, copies.len()) {
                (Slot::Absent(_), _) => {}
                (_, 1) => memory.transient += bytes.sum::<u64>(),
                _ => memory.persistent += bytes.sum::<u64>(),
            }
        }
        memory
    }

    /// The plane that a frame of this turn writes (`before`: that the one before wrote).
    pub(super) fn view(&self, slot: Slot, before: bool, turn: usize) -> Option<&wgpu::TextureView> {
        let copies = self.copies.get(&slot)?;
        copies.get((turn + usize::from(before)) % copies.len())
    }
}

pub(super) fn extent_of(size: Size) -> wgpu::Extent3d {
    wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 }
}

/// Whether planes of this size fit a device.
pub(super) fn check_size(limits: &wgpu::Limits, size: Size) -> Result<(), Error> {
    if size.width == 0 || size.height == 0 {
        return Err(crate::Error::EmptySize { size }.into());
    }
    if size.width > MAX_EXTENT || size.height > MAX_EXTENT {
        return Err(crate::Error::SizeTooLarge { size, limit: MAX_EXTENT }.into());
    }
    if size.width.max(size.height) > limits.max_texture_dimension_2d as usize {
        return Err(Error::Size { pass: "denoiser", size, limit: "max_texture_dimension_2d" });
    }
    Ok(())
}
