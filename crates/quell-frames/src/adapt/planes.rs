//! Channels to planes on the sequence's canvas, and back.

use crate::error::Error;
use crate::image::{Channel, ExrImage, Samples, Window};
use crate::roles::{ChannelId, Mapped};
use half::slice::HalfFloatSliceExt;
use quell::{Plane, Rgb};
use rayon::prelude::*;
use std::path::Path;

/// The samples of a channel and where they lie.
pub(crate) fn samples(images: &[ExrImage], id: ChannelId) -> Result<(&Samples, Window), Error> {
    let (channel, window) = channel(images, id)?;
    let path = images.get(id.file).map_or(Path::new(""), ExrImage::path);
    let unread = || Error::invalid(path, format!("channel `{}` was not read", channel.name()));
    Ok((channel.samples().ok_or_else(unread)?, window))
}

/// A channel and where its samples lie.
fn channel(images: &[ExrImage], id: ChannelId) -> Result<(&Channel, Window), Error> {
    let image = images.get(id.file);
    let part = image.and_then(|image| image.parts().get(id.part));
    let found = part.and_then(|part| Some((part.channels().get(id.channel)?, part.data_window())));
    match (found, image) {
        (Some(found), Some(_)) => Ok(found),
        (None, Some(image)) => Err(Error::invalid(
            image.path(),
            format!("channel {} of part {} is missing; the first frame had it", id.channel, id.part),
        )),
        (_, None) => {
            let path = images.first().map_or_else(std::path::PathBuf::new, |i| i.path().to_owned());
            Err(Error::invalid(&path, format!("file {} of this frame is missing", id.file)))
        }
    }
}

/// The overlap of a data window with the canvas, row by row: first pixel in the plane, first sample, count.
fn rows(canvas: Window, window: Window) -> impl Iterator<Item = (usize, usize, usize)> {
    let (cw, ch) = (canvas.size.width as i64, canvas.size.height as i64);
    let (ww, wh) = (window.size.width as i64, window.size.height as i64);
    let (dx, dy) = (i64::from(window.x) - i64::from(canvas.x), i64::from(window.y) - i64::from(canvas.y));
    let (left, right) = (dx.max(0), (dx + ww).min(cw));
    (dy.max(0)..(dy + wh).min(ch))
        .filter(move |_| right > left)
        .map(move |y| ((y * cw + left) as usize, ((y - dy) * ww + left - dx) as usize, (right - left) as usize))
}

/// Puts channels side by side on the canvas; `outside` where there is no data. Fewer channels than components: the
/// last one stands for the rest (a grey picture).
pub(crate) fn gather<const N: usize>(
    images: &[ExrImage],
    channels: &[ChannelId],
    canvas: Window,
    outside: [f32; N],
) -> Result<Plane<[f32; N]>, Error> {
    let mut plane = Plane::filled(canvas.size, outside);
    let mut found = Vec::with_capacity(N);
    for component in 0..N {
        let Some(id) = channels.get(component).or(channels.last()) else { break };
        found.push(samples(images, *id)?);
    }
    // Channels of one part together: each row of the plane is met once.
    let mut first = 0;
    for same in found.chunk_by(|a, b| a.1 == b.1) {
        let samples: Vec<_> = same.iter().map(|(samples, _)| *samples).collect();
        spread(&samples, (canvas, same[0].1), &mut plane, first);
        first += same.len();
    }
    Ok(plane)
}

/// Rows that a thread takes at once.
const ROWS: usize = 16;

/// Samples of channels to components of the canvas' pixels from `first_component` on, on all threads.
fn spread<const N: usize>(
    samples: &[&Samples],
    (canvas, window): (Window, Window),
    plane: &mut Plane<[f32; N]>,
    first_component: usize,
) {
    let width = canvas.size.width.max(1);
    let places: Vec<_> = rows(canvas, window).collect();
    let Some(first) = places.first().map(|(at, ..)| at / width * width) else { return };
    let lines = plane.data_mut().get_mut(first..).unwrap_or_default().par_chunks_mut(width);
    let buffers = || [const { Vec::new() }; N];
    lines.zip(&places).with_min_len(ROWS).for_each_init(
        buffers,
        |floats: &mut [Vec<f32>; N], (line, (at, from, count))| {
            let Some(into) = line.get_mut(at % width..at % width + count) else { return };
            for (samples, floats) in samples.iter().zip(floats.iter_mut()) {
                read(samples, *from, into.len(), floats);
            }
            // All components at once where they are there: each pixel is written once, not a third of it three times.
            if samples.len() == N {
                let runs = floats.each_ref().map(|floats| &floats[..into.len()]);
                for (x, pixel) in into.iter_mut().enumerate() {
                    *pixel = std::array::from_fn(|component| runs[component][x]);
                }
                return;
            }
            for (i, floats) in floats.iter().take(samples.len()).enumerate() {
                for (pixel, value) in into.iter_mut().zip(floats) {
                    pixel[first_component + i] = *value;
                }
            }
        },
    );
}

/// `count` samples of a channel as floats; 0 for those that are not there.
fn read(samples: &Samples, from: usize, count: usize, floats: &mut Vec<f32>) {
    floats.clear();
    match samples {
        Samples::Half(v) => {
            // Slices convert several at a time, single values ask the processor's abilities each.
            let values = v.get(from..from + count).unwrap_or_default();
            floats.resize(values.len(), 0.0);
            values.convert_to_f32_slice(floats);
        }
        Samples::Float(v) => floats.extend(v.iter().skip(from).take(count)),
        Samples::Uint(v) => floats.extend(v.iter().skip(from).take(count).map(|value| *value as f32)),
    }
    floats.resize(count, 0.0);
}

/// One number a pixel.
pub(crate) fn single(images: &[ExrImage], id: ChannelId, canvas: Window, outside: f32) -> Result<Plane<f32>, Error> {
    let plane = gather(images, &[id], canvas, [outside])?;
    let values = plane.into_vec().into_flattened();
    Plane::from_vec(canvas.size, values).map_err(|source| Error::Frame { path: std::path::PathBuf::new(), source })
}

/// A pass as colour, black outside its data window.
pub(crate) fn colour(images: &[ExrImage], pass: &Mapped, canvas: Window) -> Result<Plane<Rgb>, Error> {
    gather(images, &pass.channels, canvas, [0.0; 3])
}

/// Writes a plane into a pass's channels, stored as they are; where a grey pass has one channel, the mean. The plane is
/// rounded to what is stored. Returns how many values were clamped to what half floats hold.
pub(super) fn scatter(
    images: &mut [ExrImage],
    pass: &Mapped,
    canvas: Window,
    plane: &mut Plane<Rgb>,
) -> Result<usize, Error> {
    let mut clamped = 0;
    if let [only] = pass.channels.as_slice() {
        plane.data_mut().par_iter_mut().for_each(|value| *value = [(value[0] + value[1] + value[2]) / 3.0; 3]);
        for component in 0..3 {
            clamped = one(images, *only, canvas, plane, component)?;
        }
        return Ok(clamped);
    }
    for (component, id) in pass.channels.iter().enumerate().take(3) {
        clamped += one(images, *id, canvas, plane, component)?;
    }
    Ok(clamped)
}

/// Writes one component of a plane into a channel and rounds the plane to what is stored.
pub(super) fn one<const N: usize>(
    images: &mut [ExrImage],
    id: ChannelId,
    canvas: Window,
    plane: &mut Plane<[f32; N]>,
    component: usize,
) -> Result<usize, Error> {
    let (channel, window) = channel(images, id)?;
    let kind = channel.kind();
    // What the canvas covers need not have been read.
    let covered = canvas.union(window) == canvas;
    let mut values = if covered { vec![0.0; window.size.pixels()] } else { samples(images, id)?.0.to_f32() };
    let width = window.size.width.max(1);
    let places: Vec<_> = rows(canvas, window).collect();
    let first = places.first().map_or(0, |(_, from, _)| from / width * width);
    let lines = values.get_mut(first..).unwrap_or_default().par_chunks_mut(width);
    lines.zip(&places).with_min_len(ROWS).for_each(|(line, (at, from, count))| {
        let into = line.get_mut(from % width..from % width + count);
        let (Some(source), Some(into)) = (plane.data().get(*at..at + count), into) else { return };
        for (value, pixel) in into.iter_mut().zip(source) {
            *value = pixel[component];
        }
    });
    let (stored, clamped) = Samples::from_f32(values, kind);
    spread(&[&stored], (canvas, window), plane, component);
    if let Some(image) = images.get_mut(id.file) {
        image.replace(id.part, id.channel, stored)?;
    }
    Ok(clamped)
}
