//! The device, its queue, and what goes wrong with them.

use crate::adapter::{self, Adapter, Wanted};
use crate::error::Error;
use crate::readback::Readback;
use quell::gpu::wgpu;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

/// Futures of native back ends are ready when they are made.
pub(super) fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
        std::thread::yield_now();
    }
}

/// What a device reported by itself.
#[derive(Clone, Debug)]
enum Trouble {
    OutOfMemory,
    Lost(String),
    Refused(String),
}

/// A device of this program's own.
#[derive(Debug)]
pub struct Gpu {
    adapter: Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    trouble: Arc<Mutex<Option<Trouble>>>,
}

impl Gpu {
    /// Opens the adapter that is meant, with WebGPU's default limits (buffers and textures as large as the adapter allows) and
    /// timestamps where it has them.
    ///
    /// # Errors
    /// There is none; its driver gives no device.
    pub fn open(wanted: Wanted<'_>) -> Result<Self, Error> {
        let found = adapter::find(wanted)?;
        let adapter = Adapter::of(&found.get_info());
        let most = found.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("quell"),
            required_features: found.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: wgpu::Limits {
                max_buffer_size: most.max_buffer_size,
                max_texture_dimension_2d: most.max_texture_dimension_2d,
                max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
                ..wgpu::Limits::default()
            },
            ..Default::default()
        };
        let (device, queue) = now(found.request_device(&descriptor))
            .map_err(|e| Error::NoDevice { adapter: adapter.to_string(), reason: e.to_string() })?;
        let trouble = Arc::new(Mutex::new(None));
        // The first is kept: what follows follows from it.
        let note = |trouble: &Mutex<Option<Trouble>>, new| {
            trouble.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(new);
        };
        let noted = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let new = match error {
                wgpu::Error::OutOfMemory { .. } => Trouble::OutOfMemory,
                wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                    Trouble::Refused(description)
                }
            };
            note(&noted, new);
        }));
        let noted = Arc::clone(&trouble);
        device.set_device_lost_callback(move |reason, words| {
            // The program itself lets go of it at its end.
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&noted, Trouble::Lost(words));
            }
        });
        Ok(Self { adapter, device, queue, trouble })
    }

    /// What a user sees of it.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// The device.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// An encoder for commands.
    pub fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }

    /// A buffer without contents.
    pub fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let size = bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Fails with what the device reported since it was opened; `what` was being done.
    ///
    /// # Errors
    /// Memory ran out, the device was lost, wgpu refused a call.
    pub fn check(&self, what: &str) -> Result<(), Error> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (adapter, what) = (self.adapter.name.clone(), what.to_owned());
        match trouble {
            None => Ok(()),
            Some(Trouble::OutOfMemory) => Err(Error::OutOfMemory { adapter, what }),
            Some(Trouble::Lost(reason)) => Err(Error::Lost { adapter, what, reason }),
            Some(Trouble::Refused(reason)) => Err(Error::Refused { adapter, what, reason }),
        }
    }

    /// Submits what was encoded; returns when it has run.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn run(&self, encoder: wgpu::CommandEncoder, what: &str) -> Result<(), Error> {
        self.queue.submit([encoder.finish()]);
        self.wait(what)
    }

    /// Returns when everything submitted has run.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn wait(&self, what: &str) -> Result<(), Error> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check(what)?;
        waited.map(|_| ()).map_err(|e| self.refused(what, &e))
    }

    /// A texture of one plane that holds these texels, row by row without padding.
    pub fn texture(
        &self,
        label: &str,
        size: quell::Size,
        format: wgpu::TextureFormat,
        texels: &[u8],
    ) -> wgpu::TextureView {
        let view = self.empty_texture(label, size, format);
        self.write_texture(view.texture(), texels, [0; 2], size);
        view
    }

    /// A texture of one plane, for [`Gpu::write_texture`].
    pub fn empty_texture(&self, label: &str, size: quell::Size, format: wgpu::TextureFormat) -> wgpu::TextureView {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: extent_of(size),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        texture.create_view(&wgpu::TextureViewDescriptor { label: Some(label), ..Default::default() })
    }

    /// Fills a texture with part of a picture of extent `whole`, whose texels lie row by row without padding: from
    /// `origin` on, which lies in the picture with all of the texture.
    pub fn write_texture(&self, texture: &wgpu::Texture, texels: &[u8], origin: [usize; 2], whole: quell::Size) {
        let texel = texture.format().block_copy_size(None).unwrap_or(0);
        let [x, y] = origin;
        let offset = (y * whole.width + x) as u64 * u64::from(texel);
        let row = Some(texel * extent_of(whole).width);
        let layout = wgpu::TexelCopyBufferLayout { offset, bytes_per_row: row, rows_per_image: None };
        self.queue.write_texture(texture.as_image_copy(), texels, layout, texture.size());
    }

    /// The texels of textures, row by row without padding, once everything submitted has run.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn read_textures(&self, textures: &[&wgpu::Texture], what: &str) -> Result<Vec<Vec<u8>>, Error> {
        let mut encoder = self.encoder("quell host reads");
        let mut readback = Readback::default();
        textures.iter().for_each(|texture| readback.texture(self, &mut encoder, texture));
        readback.read(self, encoder, what)
    }

    pub(crate) fn refused(&self, what: &str, reason: &dyn std::fmt::Display) -> Error {
        Error::Refused { adapter: self.adapter.name.clone(), what: what.to_owned(), reason: reason.to_string() }
    }
}

fn extent_of(size: quell::Size) -> wgpu::Extent3d {
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    wgpu::Extent3d { width: side(size.width), height: side(size.height), depth_or_array_layers: 1 }
}
