//! The twins agree.

use quell::denoiser::Backend;
use quell::{Camera, Denoiser, FrameBuf, Plane, Settings, Size};

#[test]
fn quick() {
    for (w, h) in [(67, 41), (5, 3), (1, 1), (1, 9), (130, 20)] {
        let size = Size::new(w, h);
        let settings = Settings::default();
        let mut a = Denoiser::with_backend(size, &settings, Backend::Reference).unwrap();
        let mut b = Denoiser::with_backend(size, &settings, Backend::Cpu).unwrap();
        for i in 0..5 {
            let mut camera = Camera::perspective(
                [0.1 * i as f32, 1.0, 4.0],
                [0.1, -0.2, -1.0],
                [0.0, 1.0, 0.0],
                0.9,
                w as f32 / h as f32,
            );
            camera.jitter = [0.1 * i as f32, -0.2];
            let mut f = FrameBuf::new(size, camera);
            f.previous_camera = Camera::perspective(
                [0.1 * i as f32 - 0.1, 1.0, 4.0],
                [0.1, -0.2, -1.0],
                [0.0, 1.0, 0.0],
                0.9,
                w as f32 / h as f32,
            );
            f.index = i;
            let p = camera.projection(size).unwrap();
            f.view_depth = Some(Plane::from_fn(size, |x, y| {
                let d =
                    p.ray_direction(glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + glam::Vec2::from(camera.jitter));
                if d.y < 0.0 { 1.0f32 / -d.y } else { f32::INFINITY }
            }));
            f.normal = Some(Plane::filled(size, [0.0, 1.0, 0.0]));
            f.glossy_hit_distance = Some(Plane::filled(size, 2.0));
            f.roughness = Some(Plane::from_fn(size, |x, _| (x % 7) as f32 / 7.0));
            f.matte = Some(Plane::from_fn(size, |x, y| {
                [((x * 7 + y * 13 + i as usize * 5) % 11) as f32 * 0.1, 0.3, 0.1 * (x % 3) as f32]
            }));
            f.glossy = Some(Plane::from_fn(size, |x, y| {
                [((x * 5 + y * 3 + i as usize * 7) % 13) as f32 * 0.1, 0.3, 0.1 * (x % 3) as f32]
            }));
            f.direct = Some(Plane::from_fn(size, |x, y| {
                [((x * 3 + y * 5 + i as usize * 3) % 17) as f32 * 0.1, 0.3, 0.1 * (x % 3) as f32]
            }));
            let x = a.denoise(&f.frame(&[])).unwrap();
            let y = b.denoise(&f.frame(&[])).unwrap();
            let worst = |p: &Plane<[f32; 3]>, q: &Plane<[f32; 3]>| {
                p.data()
                    .iter()
                    .zip(q.data())
                    .flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()))
                    .fold(0.0f32, f32::max)
            };
            let s = |p: &Plane<f32>, q: &Plane<f32>| {
                p.data().iter().zip(q.data()).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max)
            };
            println!(
                "{size} {i}: m {} g {} d {} c {} conf {} len {} had {}",
                worst(x.matte.unwrap(), y.matte.unwrap()),
                worst(x.glossy.unwrap(), y.glossy.unwrap()),
                worst(x.direct, y.direct),
                worst(x.composite, y.composite),
                s(x.confidence, y.confidence),
                s(x.history_length, y.history_length),
                y.report.had_history
            );
        }
    }
}
