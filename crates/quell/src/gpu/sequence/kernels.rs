//! The sequence filter's passes, compiled.

use super::finish::FinishKernels;
use super::residual::ResidualKernels;
use super::wavelet::SequenceWavelet;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::Pass;
use crate::gpu::storage::Storage;
use crate::gpu::timing::{MOST_OF_SEQUENCE, Timing, Timings};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Every pass of the sequence filter, compiled for a device.
#[derive(Clone, Debug)]
pub struct SequenceKernels {
    pub(super) feature_noise: Kernel,
    pub(super) gather: Kernel,
    pub(super) variance: Kernel,
    pub(super) wavelet: SequenceWavelet,
    pub(super) residual: ResidualKernels,
    /// Of the stages after the filtered light: compiled where they are first asked for.
    finish: OnceLock<FinishKernels>,
    /// Of dispatches since the last [`SequenceKernels::resolve_timings`].
    timings: Option<Arc<Mutex<Timings>>>,
}

/// A pass that has no planes of the real-time filter: how these are stored does not matter to it.
pub(super) fn kernel(device: &wgpu::Device, pass: Pass, source: Option<&str>) -> Kernel {
    match source {
        None => Kernel::new(device, pass, Storage::Float, false),
        Some(source) => Kernel::with_source(device, pass, Storage::Float, source),
    }
}

impl SequenceKernels {
    /// Compiles them on the caller's device.
    pub fn new(device: &wgpu::Device) -> Self {
        Self {
            feature_noise: kernel(device, Pass::FEATURE_NOISE, None),
            gather: kernel(device, Pass::GATHER, None),
            variance: kernel(device, Pass::VARIANCE, None),
            wavelet: SequenceWavelet::new(device),
            residual: ResidualKernels::new(device),
            finish: OnceLock::new(),
            timings: None,
        }
    }

    /// The same with one of [`Pass::SEQUENCE`], [`Pass::RESIDUAL`] or [`Pass::FINISH`] from changed WGSL, with the same bindings and
    /// entry point: for tests that plant a difference. Another pass changes nothing.
    #[must_use]
    pub fn with_source(&self, device: &wgpu::Device, pass: Pass, source: &str) -> Self {
        let mut changed = self.clone();
        if Pass::FINISH.iter().any(|other| other.name == pass.name) {
            let mut finish = self.finish(device).clone();
            finish.with_source(device, pass, source);
            changed.finish = OnceLock::from(finish);
            return changed;
        }
        if changed.residual.with_source(device, pass, source) {
            return changed;
        }
        let place = [&mut changed.feature_noise, &mut changed.gather, &mut changed.variance];
        match place.into_iter().find(|kernel| kernel.pass().name == pass.name) {
            Some(place) => *place = kernel(device, pass, Some(source)),
            None => changed.wavelet = changed.wavelet.with_source(device, pass, source),
        }
        changed
    }

    pub(super) fn finish(&self, device: &wgpu::Device) -> &FinishKernels {
        self.finish.get_or_init(|| FinishKernels::new(device).timed(self.timings.as_ref()))
    }

    /// Times every dispatch, where the device has the feature `TIMESTAMP_QUERY`. All windows share the queries: for one at a time.
    #[must_use]
    #[cfg_attr(
        target_arch = "wasm32",
        expect(clippy::arc_with_non_send_sync, reason = "buffers of a browser belong to one thread")
    )]
    pub fn with_timings(self, device: &wgpu::Device) -> Self {
        let timings = Timings::new(device, "quell sequence", MOST_OF_SEQUENCE).map(|t| Arc::new(Mutex::new(t)));
        let of = timings.as_ref();
        Self {
            feature_noise: self.feature_noise.timed(of),
            gather: self.gather.timed(of),
            variance: self.variance.timed(of),
            wavelet: self.wavelet.timed(of),
            residual: self.residual.timed(of),
            finish: OnceLock::new(),
            timings,
        }
    }

    /// Appends to the encoder, after the dispatches, what reads their timestamps; at most 512 are timed at once. Once the host has submitted
    /// it and polled its device, [`SequenceKernels::take_timings`] has them.
    pub fn resolve_timings(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        if let Some(timings) = &self.timings {
            timings.lock().unwrap_or_else(PoisonError::into_inner).resolve(device, encoder);
        }
    }

    /// Of the oldest encoder that has run. `None`: none is there, or dispatches are not timed.
    pub fn take_timings(&self, queue: &wgpu::Queue) -> Option<Vec<Timing>> {
        let period = f64::from(queue.get_timestamp_period());
        self.timings.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner).take(period)
    }

    /// Stage 3 alone.
    pub fn wavelet(&self) -> &SequenceWavelet {
        &self.wavelet
    }
}
