//! Debug views of the sequence filter, as pictures on this processor.

use crate::device::Gpu;
use crate::error::Error;
use crate::readback::Readback;
use quell::Size;
use quell::gpu::wgpu::{TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureViewDescriptor};
use quell::gpu::{DebugTarget, DebugViews, SequenceStage, SequenceView, SequenceWindow, Storage};
use quell::sequence::EstimateJob;
use std::sync::Arc;

/// A debug view of a frame of a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SequencePicture {
    /// The frame's number.
    pub frame: i64,
    /// The last stage that ran before it was drawn.
    pub stage: SequenceStage,
    /// What it shows.
    pub view: SequenceView,
    /// Its extent: the frame's, or of the band of rows that was at work.
    pub size: Size,
    /// Four bytes a pixel, encoded for sRGB; alpha is 255.
    pub rgba: Vec<u8>,
}

/// Takes the pictures; called from the thread that filters.
pub type ShowSequence = dyn Fn(SequencePicture) + Send + Sync;

/// Draws them.
pub(crate) struct Views {
    views: DebugViews,
    show: Arc<ShowSequence>,
}

impl std::fmt::Debug for Views {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Views").field("views", &self.views).finish_non_exhaustive()
    }
}

impl Views {
    pub(crate) fn new(gpu: &Gpu, show: Arc<ShowSequence>) -> Result<Self, Error> {
        let views = DebugViews::new(gpu.device(), Storage::Half, TextureFormat::Rgba8Unorm)?;
        gpu.check("compiling debug views")?;
        Ok(Self { views, show })
    }

    /// Runs the job up to each of its stages, and shows what that stage made.
    pub(crate) fn draw(&self, gpu: &Gpu, window: &mut SequenceWindow, job: &EstimateJob<'_>) -> Result<(), Error> {
        for stage in SequenceStage::ALL {
            let mut encoder = gpu.encoder("quell host views");
            let estimated = window.encode(gpu.device(), &mut encoder, job, stage)?;
            let lights: Vec<usize> =
                estimated.planes.iter().filter(|(_, plane, _)| *plane == 0).map(|(light, ..)| *light).collect();
            let views = views_of(stage, &lights, job.has_seen());
            let mut readback = Readback::default();
            for view in &views {
                let target = target(gpu, job.size());
                let drawn = DebugTarget { view: &target, scale: 1.0 };
                window.encode_debug(gpu.device(), &mut encoder, &self.views, *view, drawn)?;
                readback.texture(gpu, &mut encoder, target.texture());
            }
            let pictures = readback.read(gpu, encoder, "drawing debug views")?;
            for (view, rgba) in views.into_iter().zip(pictures) {
                let (frame, size) = (job.frame(job.centre()).number, job.size());
                (self.show)(SequencePicture { frame, stage, view, size, rgba });
            }
        }
        Ok(())
    }
}

/// What a stage changes.
fn views_of(stage: SequenceStage, lights: &[usize], has_seen: [bool; 2]) -> Vec<SequenceView> {
    let of = |view: fn(usize) -> SequenceView| lights.iter().map(move |light| view(*light));
    let light = |light| SequenceView::Light { light, plane: 0 };
    let deviation = |light| SequenceView::Deviation { light };
    match stage {
        SequenceStage::Gather => {
            let mut views = vec![SequenceView::Depth, SequenceView::Normal, SequenceView::FeatureNoise];
            let seen = [SequenceView::SeenColour, SequenceView::SeenNormal];
            views.extend(seen.into_iter().zip(has_seen).filter_map(|(view, has)| has.then_some(view)));
            views.extend((!lights.is_empty()).then_some(SequenceView::Samples));
            views.extend(of(light).chain(of(deviation)).chain(of(|light| SequenceView::Counts { light })));
            views
        }
        SequenceStage::Variance => of(deviation).collect(),
        SequenceStage::Wavelet | SequenceStage::Residual => of(light).collect(),
    }
}

fn target(gpu: &Gpu, size: Size) -> quell::gpu::wgpu::TextureView {
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let texture = gpu.device().create_texture(&TextureDescriptor {
        label: Some("quell host view"),
        size: quell::gpu::wgpu::Extent3d {
            width: side(size.width),
            height: side(size.height),
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba8Unorm,
        usage: TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    texture.create_view(&TextureViewDescriptor::default())
}
