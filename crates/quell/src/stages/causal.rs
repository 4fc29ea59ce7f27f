//! Stages of the sequence filter in a causal pipeline over the real-time contract: variance, wavelet and stabilise filter
//! [`Frame`]s as they come, on the CPU and as reference. A stage knows no filter: a preset of the real-time filter can take them.

use crate::camera::Camera;
use crate::denoiser::Backend;
use crate::frame::{Frame, FrameBuf, Rgb};
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Gather, Stabilise, Variance, Wavelet};
use crate::sequence::testing::random;
use crate::sequence::{LightKind, stages_of};
use crate::stages::gather::Gathered;
use crate::stages::stabilise::StabiliseFrame;
use crate::window::{Features, LightSlot, MotionPlanes, Rows, SurfacePoint, Vectors};

const SIZE: Size = Size::new(48, 30);
/// Pixels a frame by which the wall moves to the left.
const SPEED: f32 = 1.3;

/// The feature buffers of a real-time frame.
fn features(frame: &Frame<'_>) -> Features {
    let at = |x: usize, y: usize| SurfacePoint {
        inverse_depth: frame.view_depth.map_or(1.0, |depth| 1.0 / depth.at(x, y)),
        normal: frame.normal.map_or([0.0; 3], |normal| normal.at(x, y)),
        position: [0.0; 3],
    };
    let motion = frame.motion.map(|motion| Plane::from_fn(frame.size, |x, y| motion.at(x, y)));
    Features {
        size: frame.size,
        first_row: 0,
        picture_height: frame.size.height,
        surface: Plane::from_fn(frame.size, at).data().to_vec(),
        motion: MotionPlanes { to_previous: motion.map(Vectors::new), ..MotionPlanes::default() },
        seen: None,
        camera_motion: false,
        has_seen: [false; 2],
        albedo_around: None,
        surface_albedo: None,
        albedo: None,
        mirror_colour: None,
        pixel_angle: 0.0,
    }
}

fn truth(x: usize, t: i64) -> f32 {
    if x as f32 + SPEED * t as f32 > 30.0 { 1.0 } else { 0.3 }
}

fn frame(t: i64) -> FrameBuf {
    let camera = Camera::perspective([0.0, 0.0, 3.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.6);
    let mut frame = FrameBuf::new(SIZE, camera);
    frame.index = t;
    let noisy = |k: u64| {
        Plane::from_fn(SIZE, |x, y| -> Rgb { [2.0 * random(x, y, t, k) * truth(x, t); 3].map(|v| v * v.max(0.2)) })
    };
    (frame.matte, frame.glossy) = (Some(noisy(1)), Some(noisy(2)));
    frame.view_depth = Some(Plane::from_fn(SIZE, |_, y| 3.0 + 0.05 * y as f32));
    frame.normal = Some(Plane::filled(SIZE, [0.0, 0.0, 1.0]));
    frame.motion = Some(Plane::filled(SIZE, [SPEED, 0.0]));
    frame
}

/// Matte and glossy light of the last of some frames, and its picture before any filter.
fn run(backend: Backend, count: i64) -> (Plane<Rgb>, Plane<Rgb>) {
    let stages = stages_of(backend);
    let (variance, wavelet) = (Variance::default(), Wavelet::default());
    let mut past: Vec<(Features, Plane<Rgb>)> = Vec::new();
    let mut raw = Plane::filled(SIZE, [0.0; 3]);
    for t in 0..count {
        let buffers = frame(t);
        let passes = buffers.pass_views();
        let frame = buffers.frame(&passes);
        let features = features(&frame);
        let kinds = [LightKind::MatteIndirect, LightKind::GlossyIndirect];
        let slots: Vec<_> =
            (0..).zip(kinds).map(|(i, kind)| LightSlot { kind, light: i, first: i, planes: 1 }).collect();
        // One sample of each signal a pixel: the variance comes from the window.
        let mut gathered = Gathered { slots, colours: Rows::new(SIZE, 6), moments: Rows::new(SIZE, 4) };
        for (p, (x, y)) in (0..SIZE.pixels()).map(|p| (p, (p % SIZE.width, p / SIZE.width))) {
            for (l, signal) in [frame.matte, frame.glossy].into_iter().enumerate() {
                let value = signal.unwrap().at(x, y);
                (0..3).for_each(|c| gathered.colours.set(x, y, 3 * l + c, value[c]));
                (0..3).for_each(|c| raw.data_mut()[p][c] = value[c] + if l == 1 { raw.data()[p][c] } else { 0.0 });
                gathered.moments.set(x, y, 2 * l + 1, 1.0);
            }
        }
        let local = (stages.feature_noise)(&features);
        let spread = (stages.variance)(&local, &gathered, &[], &variance, &wavelet);
        let filtered = (stages.wavelet)(&local, &gathered.slots, gathered.colours, spread, &wavelet);
        let sum = |x, y| [0, 1, 2].map(|c| filtered.at(x, y, c) + filtered.at(x, y, 3 + c));
        past.push((features, Plane::from_fn(SIZE, sum)));
    }
    let window: Vec<_> = past
        .iter()
        .map(|(features, picture)| StabiliseFrame {
            features,
            picture,
            input: picture,
            likeness: None,
            signature: None,
            alpha: None,
            along: None,
        })
        .collect();
    let causal = Gather { future: false, ..Gather::default() };
    // The net reads the input and frames to come.
    let by_hand = Stabilise { net: false, ..Stabilise::default() };
    let (picture, _) = (stages.stabilise)(&window, window.len() - 1, &causal, &by_hand);
    (picture, raw)
}

fn error(picture: &Plane<Rgb>, t: i64) -> f64 {
    let mean = |a: f32, b: f32| f64::from((a - b) * (a - b)) / SIZE.pixels() as f64;
    // Both signals: mean 4/3 of the truth squared, as `noisy` makes them, but for the cut at 0.2.
    let (lit, dark) = (2.67, 2.67 * 0.3f32.powi(2));
    let expected = |i: usize| if truth(i % SIZE.width, t) > 0.5 { lit } else { dark };
    picture.data().iter().enumerate().map(|(i, c)| mean(c[0], expected(i))).sum()
}

#[test]
fn stages_of_the_sequence_filter_filter_real_time_frames() {
    let [(reference, raw), (cpu, _)] = [Backend::Reference, Backend::Cpu].map(|backend| run(backend, 4));
    let apart = |a: &Plane<Rgb>, b: &Plane<Rgb>| {
        let pairs = a.data().iter().flatten().zip(b.data().iter().flatten());
        pairs.map(|(a, b)| (a - b).abs() / (1e-3 + a.abs().max(b.abs()))).fold(0.0, f32::max)
    };
    assert!(apart(&reference, &cpu) < 1e-3, "{}", apart(&reference, &cpu));
    assert!(apart(&reference, &run(Backend::Cpu, 3).0) > 0.1, "another frame is seen");
    let (before, after) = (error(&raw, 3), error(&cpu, 3));
    assert!(after < 0.1 * before, "squared error {before} before, {after} after");
    let sum = |p: &Plane<Rgb>| p.data().iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sum(&cpu) / sum(&raw) - 1.0).abs() < 0.05, "energy {}", sum(&cpu) / sum(&raw));
}
