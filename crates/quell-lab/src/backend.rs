//! Which back end filters frames that lie in memory: one face for those on the CPU and the one on the GPU.

use crate::error::Error;
use quell::pipeline::{Plan, Stage};
use quell::{Frame, Output, Settings, Size};

/// A back end, ready to run.
#[derive(Clone, Debug)]
pub enum Backend {
    /// One on the CPU.
    Cpu(quell::Backend),
    /// A GPU.
    #[cfg(feature = "gpu")]
    Gpu(std::sync::Arc<crate::gpu::Gpu>),
}

impl Backend {
    /// As on the command line.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Cpu(quell::Backend::Cpu) => "cpu",
            Self::Cpu(quell::Backend::Reference) => "reference",
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => "gpu",
        }
    }

    /// The GPU that it runs on.
    pub fn adapter(&self) -> Option<String> {
        match self {
            Self::Cpu(_) => None,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Some(gpu.adapter().to_string()),
        }
    }

    /// Bytes a pixel that a stage reads and writes, each plane once for every pass over it, for a frame with all planes
    /// and no joint passes. `None`: the stage does not run, or nobody has counted.
    pub fn bytes_per_pixel(&self, plan: &Plan, settings: &Settings, stage: Stage) -> Option<u32> {
        match self {
            Self::Cpu(backend) => backend.bytes_per_pixel(plan, settings, stage),
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => None,
        }
    }

    /// A denoiser for frames of `size`.
    ///
    /// # Errors
    /// A size or a setting that the back end refuses; memory.
    pub fn denoiser(&self, size: Size, settings: &Settings) -> Result<Denoiser, Error> {
        Ok(match self {
            Self::Cpu(backend) => Denoiser::Cpu(Box::new(quell::Denoiser::with_backend(size, settings, *backend)?)),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Denoiser::Gpu(Box::new(crate::gpu::Denoiser::new(gpu.clone(), size, settings)?)),
        })
    }
}

/// A denoiser on any back end.
#[derive(Debug)]
pub enum Denoiser {
    /// On the CPU.
    Cpu(Box<quell::Denoiser>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Box<crate::gpu::Denoiser>),
}

impl Denoiser {
    /// Filters the next frame.
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; on a GPU joint passes, and what the device reports.
    pub fn denoise(&mut self, frame: &Frame<'_>) -> Result<Output<'_>, Error> {
        match self {
            Self::Cpu(denoiser) => Ok(denoiser.denoise(frame)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => Ok(denoiser.denoise(frame)?),
        }
    }

    /// Forgets history: the next frame starts afresh.
    pub fn reset(&mut self) {
        match self {
            Self::Cpu(denoiser) => denoiser.reset(),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => denoiser.reset(),
        }
    }
}
