//! A moving picture of what `quell render` wrote: noisy, denoised, reference.
//!
//!     quell render glossy-room -o strip --size 260x146 --frames 12-23 --reference 48
//!     cargo run --release -p quell-lab --example 02_moving_picture -- strip strip.png

use quell_frames::{find_frames, read_frame};
use quell_lab::report::strip::{StripOptions, write_animation};
use quell_lab::tone::{Picture, Tone};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(folder), Some(target)) = (arguments.next(), arguments.next()) else {
        return Err("usage: 02_moving_picture FOLDER_OF_QUELL_RENDER TARGET.png".into());
    };
    let mut panels: Vec<Vec<Picture>> = Vec::new();
    for kind in ["noisy", "denoised", "reference"] {
        let mut pictures = Vec::new();
        for (_, path) in find_frames(&Path::new(&folder).join(kind), kind)? {
            let file = read_frame(&path)?;
            let composite = file.composite.ok_or("a frame without a composite")?;
            pictures.push(Tone { exposure: EXPOSURE }.picture(&composite));
        }
        panels.push(pictures);
    }
    let views: Vec<&[Picture]> = panels.iter().map(Vec::as_slice).collect();
    let written = write_animation(Path::new(&target), &views, &StripOptions::default())?;
    println!("{target}: {} bytes", written.bytes);
    Ok(())
}

/// What `glossy-room` suggests.
const EXPOSURE: f32 = 1.25;
