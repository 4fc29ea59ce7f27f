//! Results read back from the device: however many planes a frame has, the host waits once.

use crate::device::Gpu;
use crate::error::Error;
use quell::gpu::wgpu;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// A staging buffer, and how a plane lies in it.
#[derive(Debug)]
struct Copy {
    staging: wgpu::Buffer,
    /// Bytes of a row, and from one row to the next.
    row: usize,
    pitch: usize,
}

/// Copies that an encoder makes after the commands before them, each into a staging buffer of its own; all are mapped
/// together.
#[derive(Debug, Default)]
pub struct Readback(Vec<Copy>);

impl Readback {
    /// Appends a copy of a buffer's first `bytes`.
    pub fn buffer(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer, bytes: u64) {
        let staging = staging(gpu, bytes);
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        let row = bytes as usize;
        self.0.push(Copy { staging, row, pitch: row });
    }

    /// Appends a copy of a texture of one plane.
    pub fn texture(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) {
        let row = texture.format().block_copy_size(None).unwrap_or(0) * texture.width();
        let pitch = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = staging(gpu, u64::from(pitch) * u64::from(texture.height()));
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(pitch), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
        self.0.push(Copy { staging, row: row as usize, pitch: pitch as usize });
    }

    /// Submits the encoder that these copies are in and waits for it; what each copy holds, in order, rows without gaps.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn read(self, gpu: &Gpu, encoder: wgpu::CommandEncoder, what: &str) -> Result<Vec<Vec<u8>>, Error> {
        self.wait(gpu, encoder, what)?;
        self.0.iter().map(|copy| copy.bytes().map_err(|e| gpu.refused(what, &e))).collect()
    }

    /// [`Readback::read`] of buffers alone, which are lent as they are mapped: a copy of large planes, by one thread, takes as long as the
    /// device does.
    ///
    /// # Errors
    /// As [`Gpu::check`]; those of `take`.
    pub fn lend<T>(
        self,
        gpu: &Gpu,
        encoder: wgpu::CommandEncoder,
        what: &str,
        take: impl FnOnce(&[&[u8]]) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.wait(gpu, encoder, what)?;
        let mapped = self.0.iter().map(|copy| copy.staging.get_mapped_range(..).map_err(|e| gpu.refused(what, &e)));
        let mapped = mapped.collect::<Result<Vec<_>, _>>()?;
        let lent: Vec<&[u8]> = mapped.iter().map(|range| range.as_ref()).collect();
        take(&lent)
    }

    /// Until all copies are mapped.
    fn wait(&self, gpu: &Gpu, encoder: wgpu::CommandEncoder, what: &str) -> Result<(), Error> {
        gpu.queue().submit([encoder.finish()]);
        let (done, mapped) = mpsc::channel();
        for copy in &self.0 {
            // Whether it went well shows where the range is taken.
            let done = done.clone();
            copy.staging.map_async(wgpu::MapMode::Read, .., move |_| done.send(()).unwrap_or(()));
        }
        drop(done);
        gpu.wait(what)?;
        // Another thread that polls the device may be about to map them.
        let mut waiting = self.0.len();
        while waiting > 0 {
            match mapped.recv_timeout(Duration::from_millis(10)) {
                Ok(()) => waiting -= 1,
                Err(RecvTimeoutError::Timeout) => gpu.wait(what)?,
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        Ok(())
    }
}

impl Copy {
    fn bytes(&self) -> Result<Vec<u8>, wgpu::MapRangeError> {
        let range = self.staging.get_mapped_range(..)?;
        if self.row == self.pitch {
            return Ok(range.get(..).unwrap_or_default().to_vec());
        }
        let rows = range.chunks_exact(self.pitch.max(1));
        Ok(rows.flat_map(|row| row.get(..self.row).unwrap_or_default()).copied().collect())
    }
}

fn staging(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.buffer("quell host reads", bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
}
