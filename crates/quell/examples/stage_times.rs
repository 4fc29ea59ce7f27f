//! Prints the time of every stage for a synthetic moving picture: `stage_times [WIDTHxHEIGHT] [FRAMES] [reference] [PARAMETER=VALUE]...`.

use quell::denoiser::Backend;
use quell::pipeline::Stage;
use quell::{Camera, Denoiser, FrameBuf, Plane, Settings, Size};
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let size = arguments.first().map_or("1280x720", String::as_str);
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let size = Size::new(width.parse()?, height.parse()?);
    let frames: usize = arguments.get(1).map_or(Ok(12), |n| n.parse())?;
    let reference = arguments.iter().any(|a| a == "reference");
    let backend = if reference { Backend::Reference } else { Backend::Cpu };

    let mut settings = Settings::default();
    for (name, value) in arguments.iter().filter_map(|a| a.split_once('=')) {
        settings.set(name, value)?;
    }
    let mut denoiser = Denoiser::with_backend(size, &settings, backend)?;
    let mut times: Vec<(String, Vec<Duration>)> = Vec::new();
    let mut record = |name: &str, time: Duration| match times.iter_mut().find(|(n, _)| n == name) {
        Some((_, list)) => list.push(time),
        None => times.push((name.to_owned(), vec![time])),
    };
    // The frames are made one by one: a list of them would not fit at large sizes.
    let mut buffer = frame(size, 0);
    for index in 0..frames {
        update(&mut buffer, index as i64);
        let begin = Instant::now();
        let output = denoiser.denoise(&buffer.frame(&[]))?;
        let total = begin.elapsed();
        if index < 2 {
            continue; // buffers are still being made
        }
        for stage in Stage::ALL {
            if let Some(time) = output.report.times.get(stage) {
                record(stage.paper_stage(), time);
            }
        }
        record("border", output.report.times.border);
        record("total", total);
    }
    println!("{size}, median and least of {} frames, milliseconds", frames.saturating_sub(2));
    for (name, mut list) in times {
        list.sort();
        let ms = |d: Duration| d.as_secs_f64() * 1e3;
        println!("{name:<26} {:8.2} {:8.2}", ms(list[list.len() / 2]), ms(list[0]));
    }
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        status.lines().filter(|l| l.starts_with("VmHWM")).for_each(|l| println!("{l}"));
    }
    Ok(())
}

fn camera(size: Size, index: i64) -> Camera {
    let t = index as f32 * 0.01;
    let forward = [0.2 + 0.3 * t, -0.15, -1.0];
    let aspect = size.width as f32 / size.height as f32;
    let mut camera = Camera::perspective([0.3 * t, 1.5, 4.0 - 0.5 * t], forward, [0.0, 1.0, 0.0], 0.9, aspect);
    camera.jitter = [0.37 * (index % 3 - 1) as f32, 0.29 * (index % 2) as f32];
    camera
}

fn frame(size: Size, index: i64) -> FrameBuf {
    let mut f = FrameBuf::new(size, camera(size, index));
    let black = || Some(Plane::filled(size, [0.0; 3]));
    let zero = || Some(Plane::filled(size, 0.0));
    (f.direct, f.matte, f.glossy, f.matte_weight, f.glossy_weight) = (black(), black(), black(), black(), black());
    (f.normal, f.motion) = (Some(Plane::filled(size, [0.0; 3])), Some(Plane::filled(size, [0.0; 2])));
    (f.view_depth, f.roughness, f.glossy_hit_distance) = (zero(), zero(), zero());
    f.surface_id = Some(Plane::filled(size, 0));
    f
}

fn noise(x: usize, y: usize, index: i64, k: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B) ^ (index as u32) << 20 ^ k;
    for _ in 0..2 {
        h = (h ^ h >> 15).wrapping_mul(0x2C1B_3C6D);
    }
    (h >> 8) as f32 / (1 << 24) as f32
}

/// A floor, a wall, a sphere before it, sky above the wall.
fn update(f: &mut FrameBuf, index: i64) {
    let size = f.size;
    (f.index, f.camera, f.previous_camera) = (index, camera(size, index), camera(size, index - 1));
    let (Some(view), Some(before)) = (f.camera.projection(size), f.previous_camera.projection(size)) else { return };
    for y in 0..size.height {
        for x in 0..size.width {
            let pixel = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + glam::Vec2::from(f.camera.jitter);
            let (o, d) = (view.ray_origin(pixel), view.ray_direction(pixel));
            let centre = glam::Vec3::new(0.8, 1.0, -1.0);
            let (b, c) = ((o - centre).dot(d), (o - centre).length_squared() - 1.0);
            let discriminant = b * b - d.length_squared() * c;
            let mut best = (f32::INFINITY, [0.0f32; 3], 0u32);
            if d.y < 0.0 {
                best = (-o.y / d.y, [0.0, 1.0, 0.0], 1);
            }
            let wall = (-5.0 - o.z) / d.z;
            if wall > 0.0 && wall < best.0 && (o + d * wall).y < 3.5 {
                best = (wall, [0.0, 0.0, 1.0], 2);
            }
            if discriminant > 0.0 {
                let t = (-b - discriminant.sqrt()) / d.length_squared();
                if t > 0.0 && t < best.0 {
                    best = (t, (o + d * t - centre).to_array(), 3);
                }
            }
            let (depth, normal, id) = best;
            let world = if depth.is_finite() { before.pixel(o + d * depth) } else { before.pixel_of_direction(d) };
            let motion = world.map_or([f32::NAN; 2], |p| (p - pixel).to_array());
            let set = |plane: &mut Option<Plane<f32>>, v: f32| {
                if let Some(p) = plane {
                    p.set(x, y, v);
                }
            };
            let colour = |plane: &mut Option<Plane<[f32; 3]>>, v: [f32; 3]| {
                if let Some(p) = plane {
                    p.set(x, y, v);
                }
            };
            set(&mut f.view_depth, depth);
            set(&mut f.roughness, [1.0, 0.4, 0.8, 0.2][id as usize]);
            set(&mut f.glossy_hit_distance, if id == 1 { depth * 0.5 } else { 2.0 });
            colour(&mut f.normal, normal);
            let lit = |k| if noise(x, y, index, k) < 0.2 { 5.0 * noise(x, y, index, k + 7) } else { 0.0 };
            colour(&mut f.matte, [lit(1), 0.8 * lit(1), 0.6 * lit(2)]);
            colour(&mut f.glossy, [lit(3), lit(4), 0.6 * lit(3)]);
            colour(&mut f.direct, [0.2 * id as f32, 0.1, 0.3]);
            colour(&mut f.matte_weight, [0.8, 0.7, 0.6]);
            colour(&mut f.glossy_weight, [0.04; 3]);
            if let (Some(m), Some(i)) = (&mut f.motion, &mut f.surface_id) {
                m.set(x, y, motion);
                i.set(x, y, id);
            }
        }
    }
}
