//! The path tracer on a GPU: the twin in WGSL of what [`Tracer`] does, file beside file, on WebGPU's default limits. It
//! encodes only: the caller submits, waits and reads back ([`Run`]).
//!
//! ```text
//! mod.rs      GpuTracer: frames and references that are read back
//! live.rs     LiveTracer: frames that stay on the device, as textures (planes.wgsl)
//! scenery.rs  a scene's buffers, bands of rows, what is encoded for them; upload.rs: buffers made and filled
//! kernels.rs  compute pipelines, one set for each kind of scene
//! shader.rs   the program: WGSL files and constants
//! scene.wgsl  buffers of the scene; layout.rs: the same in Rust
//! pack/       a scene as bytes
//! view.rs     cameras
//! jobs.rs     the list of dispatches
//! results.rs  planes read back, into frames and references
//! ```
//!
//! A picture is traced in bands of rows, so that what lies between the passes fits in one binding. For each band the
//! eye's ray is followed first, and every vertex on its way is kept (*slots*); then each *job* traces paths of one kind
//! from one slot of all pixels. The same jobs in the same order serve frames and references.
//!
//! Paths are those of the CPU: the sampler's 64-bit hashes are emulated, so nearly every pixel has the same samples. What
//! differs is rounding, and that light is sampled in single precision.

mod error;
mod jobs;
mod kernels;
mod layout;
mod live;
mod pack;
mod results;
mod scenery;
mod shader;
mod upload;
mod view;

pub use error::GpuError;
pub use kernels::Kernels;
pub use live::{LiveTracer, Planes, TIMED, Unread, View};
pub use wgpu;

use crate::tracer::{Control, Half, Reference, ReferenceKind, RenderOptions, Rendered, TraceError, Tracer};
use jobs::reference_steps;
use results::ReferenceResult;
use scenery::Scenery;
use std::ops::Range;
use std::sync::Arc;

/// Paths and shadow rays of one sample of a reference, about.
const REFERENCE_WORK: usize = 8;

/// One frame of a scene seen by one camera, in a device's memory. Made of a [`Tracer`].
pub struct GpuTracer<'s> {
    tracer: Tracer<'s>,
    scenery: Scenery,
}

/// Submits an encoder's commands and waits for them; then reads the first bytes of a buffer, where one is given.
pub trait Run<E>: FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, E> {}

impl<E, F: FnMut(wgpu::CommandEncoder, Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, E>> Run<E> for F {}

impl<'s> GpuTracer<'s> {
    /// Uploads what `tracer` has prepared. `kernels` are those of the device.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`]: a scene that is larger than the device's buffers.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        kernels: Arc<Kernels>,
        tracer: Tracer<'s>,
    ) -> Result<Self, GpuError> {
        Ok(Self { scenery: Scenery::new(device, queue, kernels, &tracer)?, tracer })
    }

    /// For tests: bands of so many pixels at most.
    #[doc(hidden)]
    pub fn limit_bands(&mut self, pixels: usize) {
        self.scenery.band_pixels = pixels;
    }

    /// For tests: shows one of the differences that are planted in the program ([`Kernels::planted`]); 0: none.
    #[doc(hidden)]
    pub fn show_planted(&mut self, number: u32) {
        self.scenery.light_parts.planted = number;
    }

    /// The CPU's tracer of the same frame.
    pub fn tracer(&self) -> &Tracer<'s> {
        &self.tracer
    }

    /// Traces the frame, as [`Tracer::render`] does.
    ///
    /// # Errors
    /// A size or camera that cannot be used; [`TraceError::Cancelled`]; what `run` fails with.
    pub fn render<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        control: &Control<'_>,
        run: impl Run<E>,
    ) -> Result<Rendered, E> {
        let views = self.tracer.views(options.size, options.jitter).map_err(|e| GpuError::from(TraceError::from(e)))?;
        let notes = self.tracer.notes(options.primary_replacement);
        self.scenery.render(options, &views, self.tracer.frame(), notes, control, run)
    }

    /// Traces samples of one half of a reference, as [`Tracer::reference`] does.
    ///
    /// # Errors
    /// As [`GpuTracer::render`].
    pub fn reference<E: From<GpuError>>(
        &self,
        options: &RenderOptions,
        kind: ReferenceKind,
        half: Half,
        samples: Range<u32>,
        control: &Control<'_>,
        run: impl Run<E>,
    ) -> Result<Reference, E> {
        let variant = self.scenery.variant_of(options);
        let mut result = ReferenceResult::new(options.size, kind, &samples);
        let views = self.tracer.views(options.size, options.jitter).map_err(|e| GpuError::from(TraceError::from(e)))?;
        let bands = self.scenery.bands(options.size, variant, layout::REFERENCE_PLANES, REFERENCE_WORK)?;
        let uniform = self.scenery.uniform(options, &views, self.tracer.frame());
        let steps = reference_steps(options, variant, kind, half, samples);
        self.scenery.trace(&bands, &uniform, &steps, control, run, |rows, bytes| result.take(rows, bytes))?;
        Ok(result.finish())
    }
}
