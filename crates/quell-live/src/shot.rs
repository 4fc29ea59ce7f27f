//! Pictures read back, without waiting: a copy is encoded, and the pixels are there some frames later.

use crate::error::LiveError;
use quell::Size;
use quell::gpu::wgpu;
use quell_trace::Rendered;
use quell_trace::gpu::Unread;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

const WAITS: u8 = 0;
const IS_THERE: u8 = 1;
const FAILED: u8 = 2;

/// A buffer on its way to memory.
#[derive(Debug)]
struct Arriving {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
}

impl Arriving {
    /// Of so many bytes; filled by `copy`, mapped once the encoder has run.
    fn new(
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        size: u64,
        copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Self {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("quell shot"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        copy(encoder, &buffer);
        let state = Arc::new(AtomicU8::new(WAITS));
        let told = Arc::clone(&state);
        encoder.map_buffer_on_submit(&buffer, wgpu::MapMode::Read, .., move |result| {
            told.store(if result.is_ok() { IS_THERE } else { FAILED }, Ordering::Release);
        });
        Self { buffer, state }
    }

    fn state(&self) -> u8 {
        self.state.load(Ordering::Acquire)
    }
}

/// A picture on its way from the device: rgba8unorm, encoded for sRGB.
#[derive(Debug)]
pub struct Shot {
    arriving: Arriving,
    size: Size,
    row: u32,
}

impl Shot {
    /// Appends the copy of a texture of four bytes a texel, made with `COPY_SRC`. The caller submits and polls its device.
    pub fn new(device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) -> Self {
        let extent = texture.size();
        let row = (4 * extent.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = u64::from(row) * u64::from(extent.height);
        let arriving = Arriving::new(device, encoder, bytes, |encoder, buffer| {
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
            let to = wgpu::TexelCopyBufferInfo { buffer, layout };
            encoder.copy_texture_to_buffer(texture.as_image_copy(), to, extent);
        });
        Self { arriving, size: Size::new(extent.width as usize, extent.height as usize), row }
    }

    /// Its extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The pixels, row by row without padding; `None`: they are not there yet. An empty list: the device failed.
    pub fn take(&self) -> Option<Vec<u8>> {
        match self.arriving.state() {
            WAITS => None,
            IS_THERE => {
                let Ok(bytes) = self.arriving.buffer.get_mapped_range(..) else { return Some(Vec::new()) };
                let rows = bytes.chunks_exact(self.row as usize);
                Some(rows.flat_map(|row| &row[..4 * self.size.width]).copied().collect())
            }
            _ => Some(Vec::new()),
        }
    }
}

/// A frame's planes on their way from the device: what `quell render` would write.
#[derive(Debug)]
pub struct PlanesShot {
    unread: Option<Unread>,
    bands: Vec<Arriving>,
}

impl PlanesShot {
    /// Traces the frame by `read_back`, which is handed what submits ([`quell_trace::gpu::LiveTracer::read_back`]). The caller polls
    /// its device.
    pub(crate) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        read_back: impl FnOnce(&mut Submit<'_>) -> Result<Unread, LiveError>,
    ) -> Result<Self, LiveError> {
        let mut bands = Vec::new();
        let mut submit = |mut encoder: wgpu::CommandEncoder, read: Option<(&wgpu::Buffer, u64)>| {
            bands.extend(read.map(|(from, bytes)| {
                Arriving::new(device, &mut encoder, bytes, |encoder, to| {
                    encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
                })
            }));
            queue.submit([encoder.finish()]);
            Ok(())
        };
        let unread = Some(read_back(&mut submit)?);
        Ok(Self { unread, bands })
    }

    /// The frame; `None`: it is not there yet, or was taken already.
    ///
    /// # Errors
    /// [`LiveError::Device`]: the device did not hand it over.
    pub fn take(&mut self) -> Option<Result<Rendered, LiveError>> {
        let failed = || LiveError::Device("the device did not hand over the frame's planes".to_owned());
        let states: Vec<u8> = self.bands.iter().map(Arriving::state).collect();
        if states.contains(&WAITS) && !states.contains(&FAILED) {
            return None;
        }
        let unread = self.unread.take()?;
        let read = |band: Arriving| Ok(band.buffer.get_mapped_range(..).map_err(|_| failed())?.to_vec());
        let has_failed = states.contains(&FAILED);
        let bands: Result<Vec<Vec<u8>>, LiveError> =
            if has_failed { Err(failed()) } else { self.bands.drain(..).map(read).collect() };
        Some(bands.map(|bands| unread.finish(bands)))
    }
}

/// Submits an encoder's commands, with a copy of a buffer's first bytes where one is given.
pub(crate) type Submit<'a> =
    dyn FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<(), LiveError> + 'a;
