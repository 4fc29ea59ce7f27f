//! Which tracer makes frames and references: one face for the CPU's and the GPU's.

use crate::backend::Backend;
use crate::error::Error;
use quell_trace::{
    Control, Half, Reference, ReferenceKind, RenderOptions, Rendered, Scene, SceneError, TraceError, Tracer,
};
use std::ops::Range;

#[cfg(feature = "gpu")]
use {
    quell_host::{Gpu, Readback},
    quell_trace::gpu::{GpuTracer, Kernels, wgpu},
    std::sync::Arc,
};

/// A tracer, ready for any scene.
#[derive(Clone, Debug, Default)]
pub enum TraceOn {
    /// The one on the CPU: the same bits on every machine.
    #[default]
    Cpu,
    /// Its twin on a GPU, and the kernels that were made for it.
    #[cfg(feature = "gpu")]
    Gpu(Arc<Gpu>, Arc<Kernels>),
}

impl TraceOn {
    /// The tracer that runs where a back end does.
    pub fn backend(backend: &Backend) -> Self {
        match backend {
            Backend::Cpu(_) => Self::Cpu,
            #[cfg(feature = "gpu")]
            Backend::Gpu(gpu) => Self::Gpu(Arc::clone(gpu), Arc::default()),
        }
    }

    /// `cpu` or `gpu`.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            #[cfg(feature = "gpu")]
            Self::Gpu(..) => "gpu",
        }
    }

    /// What headers and descriptions say of frames of this tracer; nothing for the CPU's.
    pub const fn label(&self) -> &'static str {
        match self {
            Self::Cpu => "",
            #[cfg(feature = "gpu")]
            Self::Gpu(..) => ", traced on a GPU",
        }
    }

    /// What names this tracer in the cache of references; nothing for the CPU's, which was there first.
    pub(crate) const fn key_suffix(&self) -> &'static str {
        match self {
            Self::Cpu => "",
            #[cfg(feature = "gpu")]
            Self::Gpu(..) => "-gpu",
        }
    }

    /// A scene at one frame, seen by camera number `camera` (from 1).
    ///
    /// # Errors
    /// Those of [`Tracer::new`]; on a GPU a scene that its buffers do not hold.
    pub fn tracer<'s>(&self, scene: &'s Scene, frame: i64, camera: usize) -> Result<FrameTracer<'s>, Error> {
        let scene_error = |e: SceneError| Error::Trace(TraceError::Scene(e));
        let tracer = Tracer::new(scene, frame, camera).map_err(scene_error)?;
        Ok(match self {
            Self::Cpu => FrameTracer::Cpu(Box::new(tracer)),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu, kernels) => {
                let tracer = GpuTracer::new(gpu.device(), gpu.queue(), Arc::clone(kernels), tracer)?;
                FrameTracer::Gpu(Arc::clone(gpu), Box::new(tracer))
            }
        })
    }
}

/// A scene at one frame, on one of the tracers.
pub enum FrameTracer<'s> {
    /// On the CPU.
    Cpu(Box<Tracer<'s>>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Arc<Gpu>, Box<GpuTracer<'s>>),
}

impl FrameTracer<'_> {
    /// Traces the frame.
    ///
    /// # Errors
    /// Those of [`Tracer::render`]; what a device reports.
    pub fn render(&self, options: &RenderOptions, control: &Control<'_>) -> Result<Rendered, Error> {
        match self {
            Self::Cpu(tracer) => Ok(tracer.render(options, control)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu, tracer) => tracer.render(options, control, |encoder, read| run(gpu, encoder, read)),
        }
    }

    /// Traces samples of one half of a reference.
    ///
    /// # Errors
    /// Those of [`Tracer::reference`]; what a device reports.
    pub fn reference(
        &self,
        options: &RenderOptions,
        kind: ReferenceKind,
        half: Half,
        samples: Range<u32>,
        control: &Control<'_>,
    ) -> Result<Reference, Error> {
        match self {
            Self::Cpu(tracer) => Ok(tracer.reference(options, kind, half, samples, control)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu, tracer) => {
                tracer.reference(options, kind, half, samples, control, |encoder, read| run(gpu, encoder, read))
            }
        }
    }
}

/// Submits, waits, and reads what is asked for.
#[cfg(feature = "gpu")]
fn run(gpu: &Gpu, mut encoder: wgpu::CommandEncoder, read: Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, Error> {
    let mut readback = Readback::default();
    if let Some((buffer, bytes)) = read {
        readback.buffer(gpu, &mut encoder, buffer, bytes);
    }
    let read = readback.read(gpu, encoder, "tracing")?;
    Ok(read.into_iter().next().unwrap_or_default())
}
