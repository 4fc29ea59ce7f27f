//! Debug views of the sequence filter reach the host's caller, and change nothing of what is filtered.

use super::gpu;
use quell::gpu::{SequenceStage, SequenceView};
use quell::sequence::{Filtered, Light, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings};
use quell::{Plane, Size};
use quell_host::{SequenceAccelerator, SequencePicture};
use std::sync::{Arc, Mutex};

const SIZE: Size = Size::new(24, 16);

/// A wall with a step, lit by noise; nothing moves.
fn frame(t: i64) -> SequenceFrame {
    let mut frame = SequenceFrame::new(t, SIZE);
    let noise = move |x: usize, y: usize| {
        let bits = (x as u32 * 73_856_093) ^ (y as u32 * 19_349_663) ^ (t as u32 * 83_492_791);
        (bits.wrapping_mul(0x9e37_79b1) >> 8) as f32 / 16_777_216.0
    };
    frame.lights.push(Light::new(
        "lamp",
        LightKind::MatteIndirect,
        Plane::from_fn(SIZE, |x, y| [2.0 * noise(x, y); 3]),
    ));
    frame.depth = Some(Plane::from_fn(SIZE, |x, _| if x < 12 { 2.0 } else { 3.0 }));
    frame.normal = Some(Plane::filled(SIZE, [0.0, 0.0, 1.0]));
    frame.motion_to_previous = Some(Plane::filled(SIZE, [0.0; 2]));
    frame.motion_to_next = Some(Plane::filled(SIZE, [0.0; 2]));
    frame
}

fn run(accelerator: SequenceAccelerator) -> Vec<Filtered> {
    let mut denoiser =
        SequenceDenoiser::with_accelerator(SequenceSettings::default(), Arc::new(accelerator)).expect("a denoiser");
    let mut filtered = Vec::new();
    for t in 0..3 {
        filtered.extend(denoiser.push(frame(t), true).expect("a frame"));
    }
    filtered.extend(denoiser.finish().expect("frames"));
    filtered
}

#[test]
fn views_of_every_stage_come_back() {
    let Some(gpu) = gpu() else { return };
    let pictures: Arc<Mutex<Vec<SequencePicture>>> = Arc::default();
    let taken = Arc::clone(&pictures);
    let plain = run(SequenceAccelerator::new(gpu.clone()).expect("shaders"));
    let accelerator = SequenceAccelerator::new(gpu).expect("shaders");
    let shown = run(accelerator.with_views(Arc::new(move |p| taken.lock().expect("a lock").push(p))).expect("views"));
    assert_eq!(plain, shown);
    let pictures = pictures.lock().expect("a lock");
    let of = |frame, stage, view| {
        let is = |p: &&SequencePicture| (p.frame, p.stage, p.view) == (frame, stage, view);
        &pictures.iter().find(is).unwrap_or_else(|| panic!("{frame}, {stage:?}, {view:?}")).rgba
    };
    let light = SequenceView::Light { light: 0, plane: 0 };
    for t in 0..3 {
        use SequenceStage::{Gather, Variance, Wavelet};
        let gathered = of(t, Gather, light);
        assert_eq!(gathered.len(), 4 * SIZE.pixels());
        assert!(gathered.chunks_exact(4).all(|p| p[3] == 255));
        // The wavelet leaves less noise.
        let spread = |rgba: &[u8]| {
            rgba.chunks_exact(4).map(|p| p[0]).max().unwrap() - rgba.chunks_exact(4).map(|p| p[0]).min().unwrap()
        };
        assert!(spread(of(t, Wavelet, light)) < spread(gathered), "frame {t}");
        let deviation = SequenceView::Deviation { light: 0 };
        assert_ne!(of(t, Gather, deviation), of(t, Variance, deviation));
        // Two depths, one normal, three samples everywhere.
        let colours =
            |rgba: &[u8]| rgba.chunks_exact(4).map(<[u8]>::to_vec).collect::<std::collections::HashSet<_>>().len();
        assert_eq!(colours(of(t, Gather, SequenceView::Depth)), 2);
        assert_eq!(colours(of(t, Gather, SequenceView::Normal)), 1);
        of(t, Gather, SequenceView::Samples);
        of(t, Gather, SequenceView::Counts { light: 0 });
        of(t, Gather, SequenceView::FeatureNoise);
    }
    assert!(pictures.iter().all(|p| p.size == SIZE));
}

/// Every stage on the device gives what the CPU gives; in a shot that follows another, too.
#[test]
fn all_stages_on_the_device_give_what_the_cpu_gives() {
    let Some(gpu) = gpu() else { return };
    let settings = SequenceSettings::default();
    let passes = |mut denoiser: SequenceDenoiser| -> Vec<f32> {
        let mut filtered = Vec::new();
        for number in [0, 1, 2, 7, 8, 9] {
            filtered.extend(denoiser.push(frame(number), true).expect("a frame"));
        }
        filtered.extend(denoiser.finish().expect("frames"));
        let planes = filtered.iter().flat_map(|f| f.lights.iter().flat_map(|light| &light.planes));
        planes.flat_map(|plane| plane.data().as_flattened()).copied().collect()
    };
    let cpu = passes(SequenceDenoiser::new(settings.clone()).expect("a denoiser"));
    let accelerator = SequenceAccelerator::new(gpu).expect("shaders").with_all_stages();
    let device = passes(SequenceDenoiser::with_accelerator(settings, Arc::new(accelerator)).expect("a denoiser"));
    assert_eq!(cpu.len(), device.len());
    let most = cpu.iter().zip(&device).map(|(a, b)| (a - b).abs() / (a.abs() + 0.1)).fold(0.0, f32::max);
    println!("largest difference {most:.1e}");
    assert!(most < 2e-3 && cpu != device, "{most}");
}
