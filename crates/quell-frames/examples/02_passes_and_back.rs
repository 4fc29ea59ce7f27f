//! Reads a sequence of any renderer, makes frames of the filter, puts their light back unfiltered, and writes the files.
//!
//! `cargo run --release -p quell-frames --example 02_passes_and_back -- OUT IN...` prints what was mapped to what and
//! what each step costs.

use quell_frames::{AdaptOptions, Adapter, ImageWriteOptions, Links, MapOptions, find_sequence, map_roles};
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let Some(out) = arguments.next() else { return Err("OUT IN...".into()) };
    let sequence = find_sequence(&arguments.collect::<Vec<_>>())?;
    for (first, last) in &sequence.gaps {
        println!("no frames {first} to {last}");
    }
    let sources = &sequence.frames[0];
    let headers = sources.read_headers()?;
    for mapping in map_roles(&sources.named(&headers), &MapOptions::default())? {
        let canvas = headers.iter().map(|image| image.full_window()).reduce(|a, b| a.union(b)).ok_or("no files")?;
        let first = sources.read(&mapping)?;
        let second = sequence.frames.get(1).map(|sources| sources.read(&mapping)).transpose()?;
        let adapter = Adapter::new(mapping.clone(), canvas, &first, second.as_deref(), &AdaptOptions::default())?;
        println!("{}{}", adapter.describe(), adapter.warnings().join("\n"));
        let mut links = Links::default();
        for sources in &sequence.frames {
            let begin = Instant::now();
            let mut images = sources.read(&mapping)?;
            let read = begin.elapsed();
            let made = adapter.frame(sources.number, &images, &mut links)?;
            let adapted = begin.elapsed();
            let lights: Vec<_> = made.frame.lights.iter().map(|light| light.light.clone()).collect();
            adapter.write_back(&mut images, &made.frame, &lights, None)?;
            adapter.sign(&mut images, "")?;
            let back = begin.elapsed();
            for image in &images {
                let name = image.path().file_name().ok_or("a file without a name")?;
                image.write(&out.join(name), &ImageWriteOptions::default())?;
            }
            let all = begin.elapsed();
            println!(
                "frame {}: read {read:.0?}, made {:.0?}, put back {:.0?}, written {:.0?} {}",
                sources.number,
                adapted - read,
                back - adapted,
                all - back,
                made.notes.join("; ")
            );
        }
    }
    Ok(())
}
