//! What the nets of the stages `stabilise` and `blend` choose from and by, for the training scripts of `benchmarks/nets`.
//!
//!     cargo run --release -p quell-frames --example blend_views -- SEQUENCE OUT FRAMES EVERY [NAME=VALUE ...]
//!
//! For every frame of FRAMES (as 6-8) one file OUT/NNNN.npy of 32-bit floats, (height, width, 36): three candidates of three
//! channels, the noise, what the net of `blend` reads. For one pixel in EVERY (0: none) the taps of `stabilise`: OUT/NNNN.head, 32-bit
//! floats, a row of 30 for each pixel: column, row, one over the brightness, noise, three candidates over the brightness,
//! statistics; OUT/NNNN.taps, 16-bit floats, rows of 63 taps of 12 numbers: colour and the input's over brightness,
//! squared differences of four parts of the signature, squared distance, 1 + frames between (0.5: the pixel itself; 0: no
//! tap).
use quell::sequence::{BlendView, SequenceDenoiser, SequenceSettings};
use quell_frames::{AdaptOptions, Adapter, Links, MapOptions, find_sequence};
use std::error::Error;
use std::io::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, input, out, frames, every, settings_of @ ..] = &args[..] else {
        return Err("arguments: SEQUENCE OUT FRAMES EVERY [NAME=VALUE ...]".into());
    };
    let (first, last) = frames.split_once('-').unwrap_or((frames, frames));
    let wanted: std::ops::RangeInclusive<i64> = first.parse()?..=last.parse()?;
    let mut settings = SequenceSettings::default();
    for word in settings_of {
        let (name, value) = word.split_once('=').ok_or("a setting is NAME=VALUE")?;
        settings.set(name, value)?;
    }
    let sequence = find_sequence(&[input.into()])?;
    let headers = sequence.frames[0].read_headers()?;
    let named: Vec<_> = sequence.frames[0].named(&headers);
    let mapping = quell_frames::map_roles(&named, &MapOptions::default())?.remove(0);
    let canvas = headers.iter().map(|i| i.full_window()).reduce(|a, b| a.union(b)).ok_or("a file without parts")?;
    let start = sequence.frames[0].read(&mapping)?;
    let next = sequence.frames.get(1).map(|frame| frame.read(&mapping)).transpose()?;
    let adapter = Adapter::new(mapping.clone(), canvas, &start, next.as_deref(), &AdaptOptions::default())?;
    let mut links = Links::default();
    let mut denoiser = SequenceDenoiser::new(settings)?;
    denoiser.keep_blend_views(every.parse()?);
    std::fs::create_dir_all(out)?;
    for sources in &sequence.frames {
        let images = sources.read(&mapping)?;
        let frame = adapter.frame(sources.number, &images, &mut links)?.frame;
        denoiser.push(frame, wanted.contains(&sources.number))?;
        write(denoiser.take_blend_views(), out.as_ref())?;
    }
    denoiser.finish()?;
    write(denoiser.take_blend_views(), out.as_ref())
}

fn write(views: Vec<BlendView>, out: &Path) -> Result<(), Box<dyn Error>> {
    for view in views {
        if !view.chosen.is_empty() {
            taps(&view, out)?;
        }
        let size = view.inputs.size();
        let shape = format!("({}, {}, {})", size.height, size.width, 10 + view.inputs.data()[0].len());
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
        // The header with its prefix of ten bytes and its newline is a multiple of 64.
        let length = (header.len() + 11).next_multiple_of(64) - 10;
        let mut file = std::io::BufWriter::new(std::fs::File::create(out.join(format!("{:04}.npy", view.number)))?);
        file.write_all(b"\x93NUMPY\x01\x00")?;
        file.write_all(&(length as u16).to_le_bytes())?;
        writeln!(file, "{header:<width$}", width = length - 1)?;
        for (i, inputs) in view.inputs.data().iter().enumerate() {
            let colours = view.candidates.iter().flat_map(|plane| plane.data()[i]);
            for value in colours.chain([view.noise.data()[i]]).chain(*inputs) {
                file.write_all(&value.to_le_bytes())?;
            }
        }
    }
    Ok(())
}

fn taps(view: &BlendView, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(out.join(format!("{:04}.head", view.number)))?);
    for ((x, y), inverse) in view.chosen.iter().zip(&view.inverse) {
        let all = [*x as f32, *y as f32, *inverse, view.own_noise.at(*x, *y)].into_iter();
        let all = all.chain(view.candidates.iter().flat_map(|plane| plane.at(*x, *y).map(|v| v * inverse)));
        for v in all.chain(view.before.at(*x, *y)) {
            file.write_all(&v.to_le_bytes())?;
        }
    }
    let mut file = std::io::BufWriter::new(std::fs::File::create(out.join(format!("{:04}.taps", view.number)))?);
    for v in &view.taps {
        file.write_all(&v.to_le_bytes())?;
    }
    Ok(())
}
