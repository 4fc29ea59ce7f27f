//! The player page: one self-contained HTML file with noisy, denoised and reference sequences.
//!
//! Pictures are PNG data URIs, since a page opened over `file://` may not read the pixels of files beside it. At most
//! [`MAX_BYTES`]: larger runs embed every n-th frame, then a part from the middle, and the page says so.

use crate::error::Error;
use crate::report::table::Table;
use crate::report::template::{fill, plain};
use crate::tone::{Picture, grey_png};
use base64::Engine;
use quell::{Plane, Size};
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// The page's largest length.
pub const MAX_BYTES: usize = 40_000_000;

/// Everything that the page shows.
#[derive(Clone, Debug, Default)]
pub struct PlayerData {
    /// The scene's name, as a heading.
    pub title: String,
    /// One line under it: size, frames, samples, preset.
    pub subtitle: String,
    /// The frames' numbers.
    pub frame_numbers: Vec<i64>,
    /// Frames a second at normal speed; 0 counts as 12.
    pub frames_per_second: f64,
    /// Noisy, denoised, reference, in this order; more may follow.
    pub sequences: Vec<PlayerSequence>,
    /// Scores; empty: not shown.
    pub metrics: Table,
    /// Stage times; empty: not shown.
    pub stages: Table,
    /// Sentences: what was rendered how, what is missing and why, warnings.
    pub notes: Vec<String>,
    /// The command line that made the page.
    pub command: String,
}

/// One sequence of pictures.
#[derive(Clone, Debug, Default)]
pub struct PlayerSequence {
    /// `noisy`, `denoised`, `reference`.
    pub name: String,
    /// One line: what it is.
    pub description: String,
    /// A picture for each frame number; `None` where there is none.
    pub pictures: Vec<Option<Picture>>,
    /// Error maps against the reference, 0 (equal) to 1, as many; may be empty.
    pub error_maps: Vec<Option<Plane<f32>>>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlayerWritten {
    /// Length of the file.
    pub bytes: usize,
    /// What was left out to stay under the limit.
    pub reduced: Option<String>,
}

/// Writes the page, whole or not at all.
///
/// # Errors
/// [`Error::Empty`] without frames or sequences, [`Error::Size`] where pictures differ in extent,
/// [`Error::Encode`], I/O errors.
pub fn write(path: &Path, data: &PlayerData) -> Result<PlayerWritten, Error> {
    let (page, reduced) = page(data, MAX_BYTES)?;
    quell_frames::files::write_bytes(path, page.as_bytes())?;
    Ok(PlayerWritten { bytes: page.len(), reduced })
}

/// What the script reads.
#[derive(Serialize)]
struct PageData<'a> {
    title: &'a str,
    subtitle: &'a str,
    width: usize,
    height: usize,
    frames: Vec<i64>,
    fps: f64,
    sequences: Vec<PageSequence<'a>>,
    metrics: PageTable<'a>,
    stages: PageTable<'a>,
    notes: Vec<&'a str>,
    command: &'a str,
    reduced: Option<&'a str>,
    version: &'a str,
}

#[derive(Serialize)]
struct PageSequence<'a> {
    name: &'a str,
    description: &'a str,
    /// Base64 of PNG files.
    pictures: Vec<Option<String>>,
    errors: Vec<Option<String>>,
}

#[derive(Serialize)]
struct PageTable<'a> {
    head: &'a [String],
    rows: &'a [Vec<String>],
}

/// PNG files of one sequence.
struct Encoded {
    pictures: Vec<Option<Vec<u8>>>,
    errors: Vec<Option<Vec<u8>>>,
}

impl Encoded {
    fn bytes_of_frame(&self, i: usize) -> usize {
        let length =
            |list: &[Option<Vec<u8>>]| list.get(i).and_then(Option::as_ref).map_or(0, |p| base64_length(p.len()));
        length(&self.pictures) + length(&self.errors)
    }
}

const fn base64_length(bytes: usize) -> usize {
    bytes.div_ceil(3) * 4 + 3
}

fn page(data: &PlayerData, max_bytes: usize) -> Result<(String, Option<String>), Error> {
    let size = data
        .sequences
        .iter()
        .flat_map(|s| s.pictures.iter().flatten())
        .map(|p| p.size)
        .next()
        .ok_or_else(|| Error::Empty { what: "the player page has no picture to show".to_owned() })?;
    for sequence in &data.sequences {
        for picture in sequence.pictures.iter().flatten() {
            Error::same_size("picture of the player page", picture.size, size)?;
        }
        for map in sequence.error_maps.iter().flatten() {
            Error::same_size("error map of the player page", map.size(), size)?;
        }
    }
    let frame_count = data.frame_numbers.len();
    let all: Vec<usize> = (0..frame_count).collect();
    let mut window = (0, 0, size);
    let mut kept = all.clone();
    let mut reduced = None;
    let mut encoded = encode(data, &all, window)?;
    // Everything but the pictures: the page itself, tables, notes.
    let fixed = html(data, size, &[], &[], None)?.len() + 512;
    let room = max_bytes.saturating_sub(fixed);
    let needed = |encoded: &[Encoded], step: usize| -> usize {
        let frames = steps(frame_count, step);
        frames.iter().map(|&i| encoded.iter().map(|s| s.bytes_of_frame(i)).sum::<usize>()).sum()
    };
    if needed(&encoded, 1) > room {
        let step = (2..=frame_count).find(|&step| needed(&encoded, step) <= room && frame_count / step >= LEAST_FRAMES);
        let mut step = step.unwrap_or_else(|| (frame_count / LEAST_FRAMES).max(1));
        let mut scale = 1.0_f64;
        while needed(&encoded, step) > room {
            // Bytes go with the pixels; a little smaller each time, since noise is not even.
            let too_many = needed(&encoded, step) as f64 / room.max(1) as f64;
            scale *= 0.95 / too_many.sqrt();
            let part = |extent: usize| ((extent as f64 * scale) as usize).max(1);
            let crop = Size::new(part(size.width), part(size.height));
            window = ((size.width - crop.width) / 2, (size.height - crop.height) / 2, crop);
            encoded = encode(data, &steps(frame_count, step), window)?;
            if crop.pixels() == 1 {
                step = frame_count;
                if needed(&encoded, step) > room {
                    return Err(Error::Encode { size, reason: format!("the page does not fit {max_bytes} bytes") });
                }
            }
        }
        kept = steps(frame_count, step);
        let crop = window.2;
        let mut sentence = String::new();
        if step > 1 {
            let every = match step {
                2 => "every second".to_owned(),
                3 => "every third".to_owned(),
                _ => format!("every {step}th"),
            };
            sentence = format!("{} of {frame_count} frames ({every})", kept.len());
        }
        if crop != size {
            let and = if sentence.is_empty() { "" } else { ", and of each " };
            let (x, y, _) = window;
            sentence = format!("{sentence}{and}the middle {crop} of {size} pixels (from {x}, {y})");
        }
        reduced = Some(format!(
            "To stay under {} MB, this page holds {sentence}. The files beside it are complete.",
            max_bytes / 1_000_000
        ));
    }
    let page = html(data, window.2, &kept, &encoded, reduced.as_deref())?;
    Ok((page, reduced))
}

/// Fewer frames than these are no animation; beyond, parts of the picture are left out instead.
const LEAST_FRAMES: usize = 8;

/// Every `step`-th frame, counted from the last: the last is the steadiest.
fn steps(count: usize, step: usize) -> Vec<usize> {
    let mut frames: Vec<usize> = (0..count).rev().step_by(step.max(1)).collect();
    frames.reverse();
    frames
}

fn encode(data: &PlayerData, frames: &[usize], window: (usize, usize, Size)) -> Result<Vec<Encoded>, Error> {
    let (x, y, crop) = window;
    data.sequences
        .iter()
        .map(|sequence| {
            let chosen: Vec<bool> = {
                let mut chosen = vec![false; data.frame_numbers.len()];
                frames.iter().for_each(|&i| chosen[i] = true);
                chosen
            };
            let pictures = (0..chosen.len())
                .into_par_iter()
                .map(|i| match sequence.pictures.get(i) {
                    Some(Some(picture)) if chosen[i] => picture.crop(x, y, crop).png().map(Some),
                    _ => Ok(None),
                })
                .collect::<Result<Vec<_>, _>>()?;
            let errors = (0..chosen.len())
                .into_par_iter()
                .map(|i| match sequence.error_maps.get(i) {
                    Some(Some(map)) if chosen[i] => {
                        grey_png(&Plane::from_fn(crop, |px, py| map.at(px + x, py + y))).map(Some)
                    }
                    _ => Ok(None),
                })
                .collect::<Result<Vec<_>, _>>()?;
            Ok(Encoded { pictures, errors })
        })
        .collect()
}

fn html(
    data: &PlayerData,
    size: Size,
    kept: &[usize],
    encoded: &[Encoded],
    reduced: Option<&str>,
) -> Result<String, Error> {
    let base64 = |list: &[Option<Vec<u8>>]| -> Vec<Option<String>> {
        let engine = base64::engine::general_purpose::STANDARD;
        kept.iter().map(|&i| list.get(i).and_then(Option::as_ref).map(|png| engine.encode(png))).collect()
    };
    let sequences = data
        .sequences
        .iter()
        .zip(encoded)
        .map(|(sequence, encoded)| PageSequence {
            name: &sequence.name,
            description: &sequence.description,
            pictures: base64(&encoded.pictures),
            errors: base64(&encoded.errors),
        })
        .collect();
    let page = PageData {
        title: &data.title,
        subtitle: &data.subtitle,
        width: size.width,
        height: size.height,
        frames: kept.iter().map(|&i| data.frame_numbers[i]).collect(),
        fps: if data.frames_per_second > 0.0 { data.frames_per_second } else { DEFAULT_FPS },
        sequences,
        metrics: PageTable { head: &data.metrics.head, rows: &data.metrics.rows },
        stages: PageTable { head: &data.stages.head, rows: &data.stages.rows },
        notes: data.notes.iter().map(String::as_str).collect(),
        command: &data.command,
        reduced,
        version: env!("CARGO_PKG_VERSION"),
    };
    // `<` would end the script element early, whatever the text says.
    let json = serde_json::to_string(&page)?.replace('<', "\\u003c");
    let title = plain(&data.title);
    Ok(fill(include_str!("assets/player.html"), |name| match name {
        "title" => vec![title.as_str()],
        "style" => vec![include_str!("assets/viewer.css")],
        "data" => vec![json.as_str()],
        "script" => vec![include_str!("assets/viewer.js"), include_str!("assets/player.js")],
        "viewer" => vec![include_str!("assets/viewer.html")],
        _ => vec![],
    }))
}

/// Where the caller names no rate.
const DEFAULT_FPS: f64 = 12.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(size: Size, seed: u32) -> Picture {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        Picture { size, rgb: (0..3 * size.pixels()).map(|_| next()).collect() }
    }

    #[test]
    fn a_page_that_is_too_large_leaves_out_frames_then_parts_and_says_so() {
        let size = Size::new(64, 48);
        let data = PlayerData {
            frame_numbers: (0..32).collect(),
            sequences: vec![PlayerSequence {
                name: "noisy".to_owned(),
                pictures: (0..32).map(|i| Some(noise(size, i))).collect(),
                ..PlayerSequence::default()
            }],
            ..PlayerData::default()
        };
        let (whole, reduced) = page(&data, MAX_BYTES).unwrap();
        assert_eq!(reduced, None);
        let pictures = |page: &str| page.matches("iVBORw0KGgo").count();
        assert_eq!(pictures(&whole), 32);
        let fixed = html(&data, size, &[], &[], None).unwrap().len();

        // Half of the pictures' room: every other frame, the last among them.
        let limit = fixed + (whole.len() - fixed) * 6 / 10;
        let (half, reduced) = page(&data, limit).unwrap();
        assert!(half.len() <= limit && pictures(&half) == 16, "{}", pictures(&half));
        assert!(reduced.unwrap().contains("16 of 32 frames") && half.contains("29,31]"));

        // A twentieth: eight frames, and a part from the middle.
        let limit = fixed + (whole.len() - fixed) / 20;
        let (small, reduced) = page(&data, limit).unwrap();
        let reduced = reduced.unwrap();
        assert!(small.len() <= limit && pictures(&small) == 8, "{} {}", small.len(), pictures(&small));
        assert!(reduced.contains("8 of 32 frames") && reduced.contains("of 64x48 pixels"), "{reduced}");
        assert!(matches!(page(&data, 1000), Err(Error::Encode { .. })));
    }
}
