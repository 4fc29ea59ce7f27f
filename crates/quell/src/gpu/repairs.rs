//! What the border repaired, counted on the GPU and read by whoever wants to know.

use crate::border::{PlaneName, Repair, Sanitised};

/// How many counts there are: each kind of repair of each plane.
pub(super) const COUNTS: usize = PlaneName::ALL.len() * Repair::ALL.len();

/// Counts of one frame: a storage buffer of 32-bit numbers in the order of [`PlaneName::ALL`], for each those of
/// [`Repair::ALL`]. It can be copied from; the host maps its copy and hands the bytes to [`Repairs::read`].
#[derive(Clone, Debug)]
pub struct Repairs {
    buffer: wgpu::Buffer,
}

impl Repairs {
    /// Bytes of the buffer.
    pub const BYTES: u64 = 4 * COUNTS as u64;

    pub(super) fn new(device: &wgpu::Device, label: &str) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let label = format!("{label} repairs");
        let descriptor =
            wgpu::BufferDescriptor { label: Some(&label), size: Self::BYTES, usage, mapped_at_creation: false };
        Self { buffer: device.create_buffer(&descriptor) }
    }

    pub(super) fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.buffer, 0, None);
    }

    /// The buffer, which the next frame that is encoded clears.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// What the buffer's bytes say; `None`: there are fewer than [`Repairs::BYTES`].
    pub fn read(bytes: &[u8]) -> Option<Sanitised> {
        let (counts, _) = bytes.as_chunks::<4>();
        let counts: [u64; COUNTS] = counts
            .iter()
            .map(|b| u64::from(u32::from_le_bytes(*b)))
            .take(COUNTS)
            .collect::<Vec<_>>()
            .try_into()
            .ok()?;
        Some(Sanitised::from_counts(&counts))
    }
}
