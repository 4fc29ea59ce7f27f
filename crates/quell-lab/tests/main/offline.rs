//! The offline methods on traced light.

use quell::{Plane, Rgb, Size};
use quell_lab::methods::{Input, parse};
use quell_lab::references::{ReferenceOf, ReferencePair, ReferenceTarget, converge};
use quell_lab::tone::luminance;
use quell_trace::{Control, RenderOptions, Tracer, builtin};

/// relMSE without the reference's own noise: each half stands in one factor of the square. Without the worst 1 % of the
/// pixels: in a picture as small as this a lamp's edge outweighs the rest.
fn rel_mse(picture: &Plane<Rgb>, pair: &ReferencePair) -> f64 {
    let (a, b) = (pair.a.beauty.data(), pair.b.beauty.data());
    let count = a.len() as f64;
    let mean = a.iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / count;
    let pixels = picture.data().iter().zip(a).zip(b);
    let mut squares: Vec<f64> = pixels
        .map(|((d, a), b)| {
            let of = |c: usize| {
                let (d, a, b) = (f64::from(d[c]), f64::from(a[c]), f64::from(b[c]));
                (d - a) * (d - b) / (0.25 * (a + b).powi(2) + 0.01 * mean * mean)
            };
            (of(0) + of(1) + of(2)) / 3.0
        })
        .collect();
    squares.sort_by(f64::total_cmp);
    let kept = squares.len() - squares.len().div_ceil(100);
    squares[..kept].iter().sum::<f64>() / kept as f64
}

/// Bitterli et al. 2016 show their result several times below its input at few paths a pixel, still below it at more, and
/// falling as paths are added, more slowly than the input does. A sample has one matte and one glossy path.
#[test]
fn nfor_is_well_below_its_input_at_16_to_64_paths_and_falls() {
    let scene = builtin("cornell-box").unwrap();
    let options = RenderOptions { direct_samples: 2, halves: true, ..RenderOptions::new(Size::new(112, 63)) };
    let what = ReferenceOf { scene: &scene, camera: 4, frame: 0, options: &RenderOptions { seed: 5, ..options } };
    let target = ReferenceTarget { samples: 48, batch: 48, ..ReferenceTarget::default() };
    let pair = converge(None, &what, &target, &Control::default(), |_| {}).unwrap();
    let errors = [8, 32].map(|samples| {
        let rendered = Tracer::new(&scene, 0, 4).unwrap();
        let rendered = rendered.render(&RenderOptions { samples, ..options }, &Control::default()).unwrap();
        let halves = rendered.halves.as_ref().map(|[a, b]| [a, b]);
        let frame = rendered.frame.frame(&[]);
        ["none", "nfor"].map(|name| {
            let picture = parse(name).unwrap().denoise(&Input { frame: &frame, halves }).unwrap();
            rel_mse(&picture, &pair)
        })
    });
    println!("none and nfor at 16 paths {:.5?}, at 64 paths {:.5?}", errors[0], errors[1]);
    let [[none_16, nfor_16], [none_64, nfor_64]] = errors;
    assert!(nfor_16 < none_16 / 4.0 && nfor_64 < none_64 / 2.0, "{errors:?}");
    assert!(nfor_64 < 0.9 * nfor_16, "four times the paths: {errors:?}");
}
