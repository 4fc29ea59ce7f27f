//! Many samples: no difference but noise, from samples that are not the CPU's.

use super::device::{Device, device};
use quell::Size;
use quell_trace::gpu::GpuError;
use quell_trace::{Control, Half, Reference, ReferenceKind, RenderOptions, Scene, builtin, builtin_scenes};

/// Standard deviations that the mean difference of all pixels may have, and share of pixels beyond four.
const MOST_MEAN: f64 = 4.0;
const MOST_FAR: f64 = 0.02;

/// Of all pixels and channels: sum of z over its deviation, and share of |z| > 4.
fn z(a: &Reference, b: &Reference) -> (f64, f64) {
    let (mut sum, mut count, mut far) = (0.0, 0.0, 0.0);
    for i in 0..a.beauty.data().len() {
        for c in 0..3 {
            let variance = f64::from(a.variance.data()[i][c]) + f64::from(b.variance.data()[i][c]);
            let difference = f64::from(a.beauty.data()[i][c]) - f64::from(b.beauty.data()[i][c]);
            if variance > 0.0 {
                let z = difference / variance.sqrt();
                // Channels go together: a third of them counts.
                sum += z / 3.0;
                count += 1.0 / 3.0;
                far += if z.abs() > 4.0 { 1.0 / 3.0 } else { 0.0 };
            } else {
                let scale = f64::from(b.beauty.data()[i][c]).abs();
                assert!(difference.abs() <= 1e-3 * scale + 1e-6, "pixel {i} has no noise: {difference} of {scale}");
            }
        }
    }
    (sum / f64::sqrt(count), far / count)
}

fn compare(device: &Device, scene: &Scene, options: &RenderOptions, kind: ReferenceKind, samples: u32) {
    let gpu = device.tracer(scene, 2, 1);
    let ours = device.reference(&gpu, options, kind, 0..samples).unwrap();
    let expected = gpu.tracer().reference(options, kind, Half::B, 0..samples, &Control::default()).unwrap();
    let (mean, far) = z(&ours, &expected);
    println!("{}, {kind:?}: mean z {mean:.2}, {far:.4} beyond 4", scene.name);
    assert!(mean.abs() < MOST_MEAN && far < MOST_FAR, "{}, {kind:?}: mean z {mean:.2}, {far:.4} beyond 4", scene.name);
    assert_eq!((ours.samples, ours.kind, ours.size), (u64::from(samples), kind, options.size));
}

#[test]
fn references_differ_by_noise_only() {
    let Some(device) = device() else { return };
    let options = RenderOptions::new(Size::new(32, 18));
    for info in builtin_scenes() {
        compare(device, &builtin(info.name).unwrap(), &options, ReferenceKind::Factored, 32);
    }
    compare(device, &builtin("mirror-hall").unwrap(), &options, ReferenceKind::FullIntegral, 32);
    let options = RenderOptions { jitter: true, ..options };
    compare(device, &builtin("thin-things").unwrap(), &options, ReferenceKind::Factored, 32);
    compare(device, &builtin("mirror-hall").unwrap(), &options, ReferenceKind::FullIntegral, 32);
}

#[test]
fn a_picture_without_pixels_is_refused() {
    let Some(device) = device() else { return };
    let scene = builtin("cornell-box").unwrap();
    let empty = RenderOptions::new(Size::new(0, 4));
    assert!(matches!(device.render(&device.tracer(&scene, 0, 1), &empty), Err(GpuError::Trace(_))));
}
