//! Which back end filters frames that lie in memory: one face for those on the CPU and the one on the GPU.

use crate::error::Error;
use quell::pipeline::{Inputs, Stage};
use quell::report::StageTimes;
use quell::sequence::Accelerator;
use quell::{Frame, Output, Settings, Size};
use std::sync::Arc;
use std::time::Duration;

/// A back end, ready to run.
#[derive(Clone, Debug)]
pub enum Backend {
    /// One on the CPU.
    Cpu(quell::Backend),
    /// A GPU.
    #[cfg(feature = "gpu")]
    Gpu(Arc<quell_host::Gpu>),
}

/// Memory on a device, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceMemory {
    /// What outlives a frame: history and the guides of the frame before.
    pub persistent: u64,
    /// What is needed within a frame, results included.
    pub transient: u64,
    /// Frames as they are uploaded.
    pub uploaded: u64,
}

impl DeviceMemory {
    /// For reports.
    pub fn json(&self) -> serde_json::Value {
        let Self { persistent, transient, uploaded } = self;
        serde_json::json!({ "persistent": persistent, "transient": transient, "uploaded": uploaded })
    }
}

impl std::fmt::Display for DeviceMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mib = |bytes: u64| bytes as f64 / 1_048_576.0;
        let [persistent, transient, uploaded] = [self.persistent, self.transient, self.uploaded].map(mib);
        let all = persistent + transient + uploaded;
        write!(
            f,
            "{all:.1} MiB ({persistent:.1} outlive a frame, {transient:.1} are needed within one, {uploaded:.1} hold \
             what is uploaded)"
        )
    }
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

    /// Whether it is a GPU in software, which runs on the CPU.
    pub fn is_software(&self) -> bool {
        match self {
            Self::Cpu(_) => false,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.adapter().is_software(),
        }
    }

    /// Gigabytes a second that copying reaches on a GPU; `None`: it is the CPU.
    ///
    /// # Errors
    /// What the device reports.
    pub fn copy_speed(&self) -> Result<Option<f64>, Error> {
        match self {
            Self::Cpu(_) => Ok(None),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Ok(Some(quell_host::copy_speed(gpu)?)),
        }
    }

    /// The implementation that runs on this processor, where a stage does: the fast one beside a GPU.
    pub fn on_this_processor(&self) -> quell::Backend {
        match self {
            Self::Cpu(backend) => *backend,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => quell::Backend::Cpu,
        }
    }

    /// What runs stages of the filter of sequences in the place of this processor; `None`: it runs all of them itself.
    ///
    /// # Errors
    /// What the device reports.
    pub fn accelerator(&self) -> Result<Option<Arc<dyn Accelerator>>, Error> {
        match self {
            Self::Cpu(_) => Ok(None),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Ok(Some(Arc::new(quell_host::SequenceAccelerator::new(gpu.clone())?))),
        }
    }

    /// [`Backend::accelerator`] with all stages that have a shader on the device, whatever that is, and their passes timed.
    ///
    /// # Errors
    /// What the device reports.
    pub fn timed_accelerator(&self) -> Result<Option<Arc<dyn Accelerator>>, Error> {
        match self {
            Self::Cpu(_) => Ok(None),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => {
                let accelerator = quell_host::SequenceAccelerator::new(gpu.clone())?;
                Ok(Some(Arc::new(accelerator.with_all_stages().with_timings())))
            }
        }
    }

    /// A denoiser for frames of `size`.
    ///
    /// # Errors
    /// A size or a setting that the back end refuses; memory.
    pub fn denoiser(&self, size: Size, settings: &Settings) -> Result<Denoiser, Error> {
        Ok(match self {
            Self::Cpu(backend) => {
                Denoiser::Cpu(*backend, Box::new(quell::Denoiser::with_backend(size, settings, *backend)?))
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Denoiser::Gpu(Box::new(quell_host::Denoiser::new(gpu.clone(), size, settings)?)),
        })
    }
}

/// A denoiser on any back end.
#[derive(Debug)]
pub enum Denoiser {
    /// On the CPU.
    Cpu(quell::Backend, Box<quell::Denoiser>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Box<quell_host::Denoiser>),
}

impl Denoiser {
    /// Filters the next frame.
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; on a GPU what the device reports.
    pub fn denoise(&mut self, frame: &Frame<'_>) -> Result<Output<'_>, Error> {
        match self {
            Self::Cpu(_, denoiser) => Ok(denoiser.denoise(frame)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => Ok(denoiser.denoise(frame)?),
        }
    }

    /// Filters the next frame to see how long it takes: the times of its stages; and on a GPU, where uploading does not
    /// count and nothing is read back, the wall time from encoding to its end.
    ///
    /// `renewed`: its planes are others than last time. If not, a GPU takes its cameras and its number alone, which saves
    /// the upload, many times longer than the frame.
    ///
    /// # Errors
    /// As [`Denoiser::denoise`].
    pub fn time(&mut self, frame: &Frame<'_>, renewed: bool) -> Result<(StageTimes, Option<Duration>), Error> {
        match self {
            Self::Cpu(_, denoiser) => Ok((denoiser.denoise(frame)?.report.times, None)),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => {
                if renewed {
                    denoiser.upload(frame)?;
                } else {
                    denoiser.renumber(frame.camera, frame.previous_camera, frame.index)?;
                }
                let ran = denoiser.run()?;
                Ok((ran.times, Some(ran.wall)))
            }
        }
    }

    /// Whether it runs on the CPU.
    pub const fn is_cpu(&self) -> bool {
        matches!(self, Self::Cpu(..))
    }

    /// Frames before times are steady: those of a GPU whose clock has to rise.
    pub const fn warm_up_frames(&self) -> usize {
        match self {
            Self::Cpu(..) => 1,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => 8,
        }
    }

    /// Bytes a pixel that a stage reads and writes, each plane once for every pass over it, for a frame with all planes
    /// and no joint passes; on a GPU as the last frame ran, and of stages that share a pass the first has all.
    /// `None`: the stage does not run, or nobody has counted.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        match self {
            Self::Cpu(backend, denoiser) => {
                let plan = denoiser.plan(Inputs { jitter: false, ..Inputs::ALL });
                backend.bytes_per_pixel(&plan, denoiser.settings(), stage)
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => denoiser.bytes_per_pixel(stage),
        }
    }

    /// Names of the passes that ran several stages of the last frame: there the first stage has the time and the bytes of
    /// all.
    pub fn shared_passes(&self) -> Vec<&'static str> {
        match self {
            Self::Cpu(..) => Vec::new(),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => denoiser.shared_passes(),
        }
    }

    /// Memory that it takes on a GPU, as of the last frame; `None`: it runs on the CPU.
    pub fn device_memory(&self) -> Option<DeviceMemory> {
        match self {
            Self::Cpu(..) => None,
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => {
                let quell_host::Memory { persistent, transient, uploaded } = denoiser.memory();
                Some(DeviceMemory { persistent, transient, uploaded })
            }
        }
    }

    /// What a user should know of how the last frame ran, in sentences.
    pub fn notes(&self) -> Vec<String> {
        match self {
            Self::Cpu(..) => Vec::new(),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => denoiser.notes(),
        }
    }

    /// Forgets history: the next frame starts afresh.
    pub fn reset(&mut self) {
        match self {
            Self::Cpu(_, denoiser) => denoiser.reset(),
            #[cfg(feature = "gpu")]
            Self::Gpu(denoiser) => denoiser.reset(),
        }
    }
}
