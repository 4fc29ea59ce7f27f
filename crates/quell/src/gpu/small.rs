//! What a frame has for its passes besides planes: per-frame uniforms and tables of taps, in one buffer that the encoder itself fills
//! before the frame's dispatches. So frames that are encoded before one submit each find their own.

use super::slot::Slot;
use std::num::NonZero;
use std::ops::Range;

/// A part of the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// [`super::FrameUniforms`].
    Frame,
    /// [`super::SettingsUniforms`].
    Settings,
    /// A resource of the program's.
    Resource(Slot),
}

#[derive(Debug)]
pub(super) struct Small {
    label: String,
    buffer: Option<wgpu::Buffer>,
    parts: Vec<(Part, Range<u64>)>,
}

/// The least size of a part: WebGPU binds nothing empty.
const LEAST: usize = 16;

impl Small {
    pub(super) fn new(label: &str) -> Self {
        Self { label: format!("{label} uniforms and taps"), buffer: None, parts: Vec::new() }
    }

    /// Appends to the encoder what fills the buffer with these parts. True: some lie at other offsets than before, and what was
    /// bound must be bound anew.
    pub(super) fn fill(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        contents: &[(Part, Vec<u8>)],
    ) -> bool {
        let limits = device.limits();
        let align = limits.min_uniform_buffer_offset_alignment.max(limits.min_storage_buffer_offset_alignment) as usize;
        let (mut bytes, mut parts) = (Vec::new(), Vec::new());
        for (part, content) in contents {
            let start = bytes.len();
            bytes.extend_from_slice(content);
            bytes.resize(start + content.len().next_multiple_of(4).max(LEAST), 0);
            parts.push((*part, start as u64..bytes.len() as u64));
            bytes.resize(bytes.len().next_multiple_of(align), 0);
        }
        let size = bytes.len() as u64;
        let staging = filled(device, &self.label, &bytes, wgpu::BufferUsages::COPY_SRC);
        let is_new = self.buffer.as_ref().is_none_or(|buffer| buffer.size() < size);
        if is_new {
            use wgpu::BufferUsages as U;
            self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(&self.label),
                size,
                usage: U::UNIFORM | U::STORAGE | U::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.buffer {
            encoder.copy_buffer_to_buffer(&staging, 0, buffer, 0, size);
        }
        let moved = is_new || parts != self.parts;
        self.parts = parts;
        moved
    }

    /// Where a part lies; `None`: the last frame had none.
    pub(super) fn binding(&self, part: Part) -> Option<wgpu::BindingResource<'_>> {
        let (_, range) = self.parts.iter().find(|(p, _)| *p == part)?;
        let size = NonZero::new(range.end - range.start);
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.buffer.as_ref()?,
            offset: range.start,
            size,
        }))
    }
}

/// A new buffer that holds these bytes.
pub(super) fn filled(device: &wgpu::Device, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let size = bytes.len().next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT as usize).max(LEAST) as u64;
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: true };
    let buffer = device.create_buffer(&descriptor);
    // A device that is lost or out of memory has no range to write; the host hears of it from its device, and not again from
    // here by an error of validation.
    if let Ok(mut range) = buffer.get_mapped_range_mut(..bytes.len() as u64) {
        range.copy_from_slice(bytes);
        drop(range);
        buffer.unmap();
    }
    buffer
}
