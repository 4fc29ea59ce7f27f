//! Filters one frame of a built-in scene with the offline methods and writes pictures to look at:
//! `cargo run --release -p quell-lab --example 04_offline_methods -- [SCENE] [FOLDER] [SAMPLES] [WIDTHxHEIGHT] [METHODS] [REFERENCE]`.
//!
//! References of 128 samples, or twice REFERENCE, come from the cache where they have been traced before
//! (`QUELL_CACHE`). Times are those of the filter alone, on all threads.

use quell::{Plane, Rgb, Size};
use quell_lab::cache::Cache;
use quell_lab::methods::{Input, parse};
use quell_lab::metrics::{energy, rel_mse};
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_lab::tone::Tone;
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use std::path::Path;
use std::time::Instant;

/// Frame and camera: the demo's scene in the midst of its motion.
const FRAME: i64 = 20;
const CAMERA: usize = 1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = builtin(&arguments.next().unwrap_or("cornell-box".to_owned()))?;
    let folder = arguments.next().unwrap_or("quell-offline".to_owned());
    let samples = arguments.next().map_or(Ok(16), |n| n.parse())?;
    let size = arguments.next().unwrap_or("240x135".to_owned());
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let size = Size::new(width.parse()?, height.parse()?);
    let methods = arguments.next().unwrap_or("none,nlm:colour,nlm,wlr,nfor".to_owned());

    let reference = arguments.next().map_or(Ok(64), |n| n.parse())?;

    let options = RenderOptions { samples, halves: true, variances: true, ..RenderOptions::new(size) };
    let rendered = Tracer::new(&scene, FRAME, CAMERA)?.render(&options, &Control::default())?;
    let halves = rendered.halves.as_ref().map(|[a, b]| [a, b]);
    let frame = rendered.frame.frame(&[]);
    let input = Input { frame: &frame, halves };

    let what = ReferenceOf { scene: &scene, camera: CAMERA, frame: FRAME, options: &options };
    let target = ReferenceTarget { samples: reference, ..ReferenceTarget::default() };
    let cache = Cache::default_place();
    let pair = converge(cache.as_ref(), &what, &target, &Control::default(), |_| ())?;
    let reference = pair.mean()?.beauty;
    println!("{}, {size}, {samples} samples; the reference's own relMSE is {:.5}", scene.name, pair.rel_mse());

    let folder = Path::new(&folder);
    let tone = Tone::automatic([&reference]);
    let save = |name: &str, picture: &Plane<Rgb>| -> Result<(), Box<dyn std::error::Error>> {
        let file = format!("{}-{samples}-{}.png", scene.name, name.replace(':', "-"));
        tone.picture(picture).write_png(&folder.join(file))?;
        Ok(())
    };
    save("reference", &reference)?;
    println!("{:12} {:>9} {:>9} {:>9} {:>10}", "method", "relMSE", "trimmed", "energy", "us a pixel");
    for name in methods.split(',') {
        let mut method = parse(name)?;
        let start = Instant::now();
        let picture = method.denoise(&input)?;
        let time = start.elapsed().as_secs_f64() * 1e6 / size.pixels() as f64;
        let error = rel_mse(&picture, &reference)?;
        let energy = energy(&picture, &reference)?;
        println!("{name:12} {:>9.5} {:>9.5} {energy:>9.4} {time:>10.2}", error.mean, error.trimmed);
        save(name, &picture)?;
    }
    Ok(())
}
