//! A device for the tests, and pictures traced on it.

use quell_host::{Gpu, Readback, Wanted};
use quell_trace::gpu::{GpuError, GpuTracer, Kernels, wgpu};
use quell_trace::{Control, Half, Reference, ReferenceKind, RenderOptions, Rendered, Scene, Tracer};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A device and the kernels that were made for it.
pub struct Device {
    gpu: Gpu,
    kernels: Arc<Kernels>,
}

/// Any device, the same for all tests. `None`: there is none, which fails where `QUELL_REQUIRE_GPU` is set.
pub fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    DEVICE.get_or_init(|| Device::with(Kernels::default())).as_ref()
}

impl Device {
    pub fn with(kernels: Kernels) -> Option<Self> {
        match Gpu::open(Wanted::Named("")) {
            Ok(gpu) => Some(Self { gpu, kernels: Arc::new(kernels) }),
            Err(error) => {
                assert!(std::env::var_os("QUELL_REQUIRE_GPU").is_none(), "{error}");
                println!("SKIPPED: {error}");
                None
            }
        }
    }

    /// Whether a processor plays the GPU.
    pub fn is_software(&self) -> bool {
        self.gpu.adapter().is_software()
    }

    pub fn tracer<'s>(&self, scene: &'s Scene, frame: i64, camera: usize) -> GpuTracer<'s> {
        let tracer = Tracer::new(scene, frame, camera).unwrap();
        GpuTracer::new(self.gpu.device(), self.gpu.queue(), Arc::clone(&self.kernels), tracer).unwrap()
    }

    fn run(&self, mut encoder: wgpu::CommandEncoder, read: Option<(&wgpu::Buffer, u64)>) -> Result<Vec<u8>, GpuError> {
        let mut readback = Readback::default();
        if let Some((buffer, bytes)) = read {
            readback.buffer(&self.gpu, &mut encoder, buffer, bytes);
        }
        let read = readback.read(&self.gpu, encoder, "tracing").unwrap_or_else(|error| panic!("{error}"));
        Ok(read.into_iter().next().unwrap_or_default())
    }

    pub fn render(&self, tracer: &GpuTracer<'_>, options: &RenderOptions) -> Result<Rendered, GpuError> {
        tracer.render(options, &Control::default(), |encoder, read| self.run(encoder, read))
    }

    /// The first half of a reference.
    pub fn reference(
        &self,
        tracer: &GpuTracer<'_>,
        options: &RenderOptions,
        kind: ReferenceKind,
        samples: Range<u32>,
    ) -> Result<Reference, GpuError> {
        let control = Control::default();
        tracer.reference(options, kind, Half::A, samples, &control, |encoder, read| self.run(encoder, read))
    }
}
