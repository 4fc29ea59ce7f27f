//! Traces one frame of a built-in scene and writes a tone-mapped PNG, for looking at scenes.
//!
//! `cargo run --release -p quell-trace --example trace -- SCENE CAMERA FRAME WIDTHxHEIGHT SAMPLES OUT.png [PLANE
//! [DIRECT_SAMPLES]]`, PLANE one of `composite` (default), `direct`, `matte`, `glossy`, `normal`; or `reference` (the full integral) and
//! `factored` (the frame's own estimators), both with SAMPLES samples.

use quell::{Plane, Rgb, Size};
use quell_trace::{Control, Half, ReferenceKind, RenderOptions, Tracer, builtin};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, camera, frame, size, samples, out, rest @ ..] = arguments.as_slice() else {
        return Err("usage: trace SCENE CAMERA FRAME WIDTHxHEIGHT SAMPLES OUT.png [PLANE [DIRECT_SAMPLES]]".into());
    };
    let scene = builtin(scene)?;
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let size = Size::new(width.parse()?, height.parse()?);
    let start = Instant::now();
    let tracer = Tracer::new(&scene, frame.parse()?, camera.parse()?)?;
    let built = start.elapsed();
    let mut options = RenderOptions { samples: samples.parse()?, ..RenderOptions::new(size) };
    if let Some(count) = rest.get(1) {
        options.direct_samples = count.parse()?;
    }
    let plane = rest.first().map_or("composite", String::as_str);
    let control = Control::default();
    let start = Instant::now();
    let (picture, rays): (Plane<Rgb>, _) = match plane {
        "reference" => {
            let r = tracer.reference(&options, ReferenceKind::FullIntegral, Half::A, 0..options.samples, &control)?;
            (r.beauty, r.rays)
        }
        "factored" => {
            let r = tracer.reference(&options, ReferenceKind::Factored, Half::A, 0..options.samples, &control)?;
            (r.beauty, r.rays)
        }
        _ => {
            let rendered = tracer.render(&options, &control)?;
            let frame = rendered.frame;
            let picked = match plane {
                "direct" => frame.direct,
                "matte" => frame.matte,
                "glossy" => frame.glossy,
                "normal" => frame.normal,
                _ => Some(frame.composite()),
            };
            (picked.ok_or("the frame has no such plane")?, rendered.rays)
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    eprintln!(
        "{} triangles, {} lights, built in {:.1} ms; traced in {seconds:.2} s: {:.1} rays a pixel, {:.2} million rays/s",
        tracer.triangles(),
        tracer.lights(),
        built.as_secs_f64() * 1e3,
        rays.total() as f64 / size.pixels() as f64,
        rays.total() as f64 / seconds / 1e6
    );
    let mean = picture.data().iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / (3 * size.pixels()) as f64;
    eprintln!("mean {mean:.4}");
    let mut bytes = Vec::with_capacity(size.pixels() * 3);
    for pixel in picture.data() {
        for c in pixel {
            // A filmic curve (Narkowicz's fit) and sRGB's power, near enough for looking.
            let x = (c * scene.exposure).max(0.0);
            let x =
                if plane == "normal" { c * 0.5 + 0.5 } else { x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14) };
            bytes.push((x.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8);
        }
    }
    image::save_buffer(out, &bytes, width.parse()?, height.parse()?, image::ColorType::Rgb8)?;
    Ok(())
}
