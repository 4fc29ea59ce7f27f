//! Pictures read back, without waiting: a copy is encoded, and the pixels are there some frames later.

use quell::Size;
use quell::gpu::wgpu;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

const WAITS: u8 = 0;
const IS_THERE: u8 = 1;
const FAILED: u8 = 2;

/// A picture on its way from the device: rgba8unorm, encoded for sRGB.
#[derive(Debug)]
pub struct Shot {
    buffer: wgpu::Buffer,
    size: Size,
    row: u32,
    state: Arc<AtomicU8>,
}

impl Shot {
    /// Appends the copy of a texture of four bytes a texel, made with `COPY_SRC`. The caller submits and polls its device.
    pub fn new(device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) -> Self {
        let extent = texture.size();
        let row = (4 * extent.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("quell shot"),
            size: u64::from(row) * u64::from(extent.height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, extent);
        let state = Arc::new(AtomicU8::new(WAITS));
        let told = Arc::clone(&state);
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, .., move |result| {
            told.store(if result.is_ok() { IS_THERE } else { FAILED }, Ordering::Release);
        });
        Self { buffer, size: Size::new(extent.width as usize, extent.height as usize), row, state }
    }

    /// Its extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The pixels, row by row without padding; `None`: they are not there yet. An empty list: the device failed.
    pub fn take(&self) -> Option<Vec<u8>> {
        match self.state.load(Ordering::Acquire) {
            WAITS => None,
            IS_THERE => {
                let Ok(bytes) = self.buffer.get_mapped_range(..) else { return Some(Vec::new()) };
                let rows = bytes.chunks_exact(self.row as usize);
                Some(rows.flat_map(|row| &row[..4 * self.size.width]).copied().collect())
            }
            _ => Some(Vec::new()),
        }
    }
}
