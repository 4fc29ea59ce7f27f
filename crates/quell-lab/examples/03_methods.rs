//! Renders a short sequence, runs methods on it, and writes a PNG of each method's last frame beside noise and reference:
//! `cargo run --release -p quell-lab --example 03_methods -- [OPTION=VALUE]... METHOD...`
//!
//! Options: `scene=glossy-room`, `camera=1`, `from=0`, `frames=20`, `size=240x135`, `spp=1`, `reference=64` (samples of
//! each half; 0: none), `out=quell-methods`. Prints each method's relMSE and the median of its times a frame.

use quell::Size;
use quell_lab::cache::Cache;
use quell_lab::methods::{Input, parse};
use quell_lab::metrics::{energy, rel_mse};
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_lab::tone::Tone;
use quell_trace::{Control, RenderOptions, Rendered, Tracer, builtin};
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (options, methods): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|a| a.split_once('=').is_some_and(|(key, _)| key.chars().all(|c| c.is_ascii_lowercase())));
    let options: HashMap<&str, &str> = options.iter().filter_map(|o| o.split_once('=')).collect();
    let option = |name: &str, default: &'static str| options.get(name).map_or(default.to_owned(), |v| (*v).to_owned());
    let scene = builtin(&option("scene", "glossy-room"))?;
    let camera: usize = option("camera", "1").parse()?;
    let (from, frames): (i64, i64) = (option("from", "0").parse()?, option("frames", "20").parse()?);
    let size = option("size", "240x135");
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let samples: u32 = option("spp", "1").parse()?;
    let render = RenderOptions {
        samples,
        halves: samples > 1,
        ..RenderOptions::new(Size::new(width.parse()?, height.parse()?))
    };
    let out = option("out", "quell-methods");
    let out = Path::new(&out);

    let noisy = (from..from + frames)
        .map(|index| Tracer::new(&scene, index, camera)?.render(&render, &Control::default()))
        .collect::<Result<Vec<Rendered>, quell_trace::TraceError>>()?;
    let target = ReferenceTarget { samples: option("reference", "64").parse()?, ..ReferenceTarget::default() };
    let what = ReferenceOf { scene: &scene, camera, frame: from + frames - 1, options: &render };
    let reference = if target.samples > 0 {
        let cache = Cache::default_place();
        let pair = converge(cache.as_ref(), &what, &target, &Control::default(), |_| ())?;
        println!("reference: its own relMSE (trimmed) {:.5}", pair.rel_mse());
        Some(pair.mean()?.beauty)
    } else {
        None
    };
    let tone = match (&reference, noisy.last()) {
        (Some(reference), _) => Tone::automatic([reference]),
        (None, Some(last)) => Tone::automatic([&last.frame.composite()]),
        (None, None) => return Err("there is no frame".into()),
    };
    if let Some(reference) = &reference {
        tone.picture(reference).write_png(&out.join("reference.png"))?;
    }
    for name in methods {
        let mut method = parse(&name)?;
        let (mut times, mut picture) = (Vec::new(), None);
        for rendered in &noisy {
            let frame = rendered.frame.frame(&[]);
            let input = Input { frame: &frame, halves: rendered.halves.as_ref().map(|[a, b]| [a, b]) };
            let begin = Instant::now();
            let denoised = method.denoise(&input);
            times.push(begin.elapsed());
            match denoised {
                Ok(denoised) => picture = Some(denoised),
                Err(error) => {
                    println!("{name:<24} {error}");
                    break;
                }
            }
        }
        let Some(picture) = picture else { continue };
        times.sort();
        print!("{name:<24} {:8.2} ms", times[times.len() / 2].as_secs_f64() * 1e3);
        if let Some(reference) = &reference {
            let error = rel_mse(&picture, reference)?;
            let energy = energy(&picture, reference)?;
            print!("   relMSE {:.5}, trimmed {:.5}, energy {energy:.4}", error.mean, error.trimmed);
        }
        println!();
        tone.picture(&picture).write_png(&out.join(format!("{}.png", name.replace(':', "-"))))?;
    }
    Ok(())
}
