//! An animated picture for a README: panels side by side, as an APNG with a palette.
//!
//! An APNG plays wherever a PNG shows and keeps pixels as they are; few colours, of which each panel has its own and a
//! noisy one fewer, and pixels that repeat the frame before left transparent keep it small. The palette shrinks, then
//! frames are dropped, until the file is under its limit. Measured on 8 frames of `glossy-room`, three panels of 260
//! pixels: a GIF with 255 colours 586 kB, an APNG with as many 519 kB; an animated WebP of quality 80, for which no
//! encoder in Rust exists, 257 kB, but it smooths the very noise that is to be seen.

use crate::error::Error;
use crate::tone::Picture;
use quell::Size;
use std::path::Path;

/// How the animation is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripOptions {
    /// Width of a panel in pixels; wider pictures are averaged down to it, narrower ones stay.
    pub panel_width_px: usize,
    /// Dark columns between panels.
    pub gap_px: usize,
    /// Frames a second, at least 1.
    pub frames_per_second: u16,
    /// The file's largest length.
    pub max_bytes: usize,
}

impl Default for StripOptions {
    fn default() -> Self {
        Self { panel_width_px: 260, gap_px: 4, frames_per_second: 12, max_bytes: 1024 * 1024 - 1024 }
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StripWritten {
    /// Extent of the animation.
    pub size: Size,
    /// Length of the file.
    pub bytes: usize,
    /// Colours of the palette.
    pub colours: usize,
    /// Every how many frames one was kept.
    pub step: usize,
}

/// Colours of a smooth panel that are tried, best first.
const COLOURS: [usize; 7] = [112, 80, 64, 48, 32, 20, 12];
/// A noisy panel gets this part of the colours of a smooth one: its grain hides the steps between them, and costs most.
const NOISY_PART: f64 = 0.4;
/// A panel is noisy where neighbours differ this many times more than in the smoothest panel.
const NOISY_FACTOR: f64 = 1.5;
/// Indices of a palette, less those of the gap and of transparency.
const MOST_COLOURS: usize = 254;
/// Colour of the gaps.
const GAP_COLOUR: [u8; 3] = [16, 18, 22];
/// Bits a component of the histogram from which the palette is made.
const HISTOGRAM_BITS: u32 = 5;

/// Writes panels side by side as an animated PNG, whole or not at all. A panel is a list of pictures; one with fewer
/// pictures than the longest repeats its last.
///
/// # Errors
/// [`Error::Empty`] without panels or pictures, [`Error::Size`] where extents differ, [`Error::Encode`] where even
/// the smallest palette and one frame do not fit `max_bytes`, I/O errors.
pub fn write_animation(path: &Path, panels: &[&[Picture]], options: &StripOptions) -> Result<StripWritten, Error> {
    let panels = scaled(panels, options)?;
    let frames = panels[0].len();
    let height = panels[0][0].size.height;
    let width = panels.iter().map(|p| p[0].size.width).sum::<usize>() + options.gap_px * (panels.len() - 1);
    let size = Size::new(width, height);
    let grain: Vec<f64> = panels.iter().map(|frames| grain(&frames[0])).collect();
    let smoothest = grain.iter().copied().fold(f64::INFINITY, f64::min);
    let mut step = 1;
    while step <= frames {
        for colours in COLOURS {
            let indexed = Indexed::new(&panels, step, options.gap_px, |panel| {
                let part = if grain[panel] > NOISY_FACTOR * smoothest { NOISY_PART } else { 1.0 };
                ((colours as f64 * part) as usize).min(MOST_COLOURS / panels.len()).max(2)
            });
            for transparent in [true, false] {
                let delay = (step as u16, options.frames_per_second.max(1));
                let bytes = encoded(size, &indexed, transparent, delay)?;
                if bytes.len() <= options.max_bytes {
                    quell_frames::files::write_bytes(path, &bytes)?;
                    return Ok(StripWritten { size, bytes: bytes.len(), colours: indexed.colours.len(), step });
                }
            }
        }
        step *= 2;
    }
    Err(Error::Encode { size, reason: format!("one frame is larger than {} bytes", options.max_bytes) })
}

/// Mean difference of horizontal neighbours.
fn grain(picture: &Picture) -> f64 {
    let neighbours = picture.rgb.iter().zip(picture.rgb.iter().skip(3));
    neighbours.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / picture.rgb.len() as f64
}

/// Each panel's pictures, scaled, as many for each panel.
fn scaled(panels: &[&[Picture]], options: &StripOptions) -> Result<Vec<Vec<Picture>>, Error> {
    let empty = || Error::Empty { what: "an animation needs at least one panel with one picture".to_owned() };
    let count = panels.iter().map(|panel| panel.len()).max().ok_or_else(empty)?;
    let mut height = None;
    let mut all = Vec::new();
    for panel in panels {
        panel.iter().try_for_each(Picture::check)?;
        let mut frames: Vec<Picture> = panel.iter().map(|p| averaged_down(p, options.panel_width_px)).collect();
        let last = frames.last().cloned().ok_or_else(empty)?;
        let expected = Size::new(last.size.width, *height.get_or_insert(last.size.height));
        for frame in &frames {
            Error::same_size("panel", frame.size, expected)?;
        }
        frames.resize(count, last);
        all.push(frames);
    }
    Ok(all)
}

/// Frames as indices into one palette, in which each panel has colours of its own.
struct Indexed {
    colours: Vec<[u8; 3]>,
    frames: Vec<Vec<u8>>,
}

impl Indexed {
    fn new(panels: &[Vec<Picture>], step: usize, gap: usize, colours_of: impl Fn(usize) -> usize) -> Self {
        let mut colours = vec![GAP_COLOUR];
        let palettes: Vec<(u8, Palette)> = panels
            .iter()
            .enumerate()
            .map(|(i, frames)| {
                let kept: Vec<&Picture> = frames.iter().step_by(step).collect();
                let palette = Palette::of(&kept, colours_of(i));
                let base = colours.len() as u8;
                colours.extend(&palette.colours);
                (base, palette)
            })
            .collect();
        let frame = |f: usize| {
            let mut indices = Vec::new();
            for y in 0..panels[0][f].size.height {
                for (i, (frames, (base, palette))) in panels.iter().zip(&palettes).enumerate() {
                    if i > 0 {
                        indices.extend(std::iter::repeat_n(0, gap));
                    }
                    let width = frames[f].size.width;
                    let row = frames[f].rgb[3 * y * width..][..3 * width].chunks_exact(3);
                    indices.extend(row.map(|rgb| base + palette.nearest[cell(rgb)]));
                }
            }
            indices
        };
        let frames = (0..panels[0].len()).step_by(step).map(frame).collect();
        Self { colours, frames }
    }
}

/// The mean over the pixels that each target pixel covers (whole source pixels; of the encoded values: the picture is
/// for the eye).
fn averaged_down(picture: &Picture, width: usize) -> Picture {
    let Size { width: from_width, height: from_height } = picture.size;
    let width = width.max(1);
    if from_width <= width {
        return picture.clone();
    }
    let height = (from_height * width).div_ceil(from_width).max(1);
    let range = |i: usize, from: usize, to: usize| {
        let start = i * from / to;
        start..((i + 1) * from / to).max(start + 1)
    };
    let mut rgb = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0u32; 3];
            let mut count = 0;
            for sy in range(y, from_height, height) {
                for sx in range(x, from_width, width) {
                    for c in 0..3 {
                        sum[c] += u32::from(picture.rgb[3 * (sy * from_width + sx) + c]);
                    }
                    count += 1;
                }
            }
            rgb.extend(sum.map(|s| ((s + count / 2) / count) as u8));
        }
    }
    Picture { size: Size::new(width, height), rgb }
}

struct Palette {
    colours: Vec<[u8; 3]>,
    /// Index of the nearest colour, by histogram cell.
    nearest: Vec<u8>,
}

fn cell(rgb: &[u8]) -> usize {
    let part = |v: u8| usize::from(v >> (8 - HISTOGRAM_BITS));
    (part(rgb[0]) << (2 * HISTOGRAM_BITS)) | (part(rgb[1]) << HISTOGRAM_BITS) | part(rgb[2])
}

impl Palette {
    /// Median cut (Heckbert 1982) over a histogram of all frames, then three rounds of k-means.
    fn of(frames: &[&Picture], count: usize) -> Self {
        let mut sums = vec![(0u64, [0u64; 3]); 1 << (3 * HISTOGRAM_BITS)];
        for rgb in frames.iter().flat_map(|f| f.rgb.chunks_exact(3)) {
            let entry = &mut sums[cell(rgb)];
            entry.0 += 1;
            for c in 0..3 {
                entry.1[c] += u64::from(rgb[c]);
            }
        }
        let cells: Vec<(usize, f64, [f64; 3])> = sums
            .iter()
            .enumerate()
            .filter(|(_, s)| s.0 > 0)
            .map(|(i, s)| (i, s.0 as f64, s.1.map(|v| v as f64 / s.0 as f64)))
            .collect();
        let mut boxes = vec![cells.clone()];
        while boxes.len() < count {
            // The box whose longest side, weighted by its pixels' root, is largest.
            let side = |b: &[(usize, f64, [f64; 3])], c: usize| {
                let values = b.iter().map(|cell| cell.2[c]);
                values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
            };
            let rate = |b: &[(usize, f64, [f64; 3])]| {
                let weight: f64 = b.iter().map(|cell| cell.1).sum();
                (0..3).map(|c| side(b, c)).fold(0.0, f64::max) * weight.sqrt()
            };
            let candidates = (0..boxes.len()).filter(|&i| boxes[i].len() > 1);
            let Some(widest) = candidates.max_by(|&a, &b| rate(&boxes[a]).total_cmp(&rate(&boxes[b]))) else { break };
            let mut one = boxes.swap_remove(widest);
            let axis = (0..3).max_by(|&a, &b| side(&one, a).total_cmp(&side(&one, b))).unwrap_or(0);
            one.sort_by(|a, b| a.2[axis].total_cmp(&b.2[axis]));
            let half: f64 = one.iter().map(|cell| cell.1).sum::<f64>() * 0.5;
            let mut passed = 0.0;
            let middle = one.iter().position(|cell| {
                passed += cell.1;
                passed >= half
            });
            let other = one.split_off((middle.unwrap_or(0) + 1).min(one.len() - 1));
            boxes.push(one);
            boxes.push(other);
        }
        let mean = |b: &[(usize, f64, [f64; 3])]| {
            let weight: f64 = b.iter().map(|cell| cell.1).sum();
            std::array::from_fn(|c| b.iter().map(|cell| cell.1 * cell.2[c]).sum::<f64>() / weight)
        };
        let mut centres: Vec<[f64; 3]> = boxes.iter().map(|b| mean(b)).collect();
        for _ in 0..3 {
            let mut groups = vec![Vec::new(); centres.len()];
            for &cell in &cells {
                groups[closest(&centres, cell.2)].push(cell);
            }
            for (centre, group) in centres.iter_mut().zip(&groups) {
                if !group.is_empty() {
                    *centre = mean(group);
                }
            }
        }
        let mut nearest = vec![0; sums.len()];
        for &(i, _, colour) in &cells {
            nearest[i] = closest(&centres, colour) as u8;
        }
        Self { colours: centres.into_iter().map(|c| c.map(|v| v.round() as u8)).collect(), nearest }
    }
}

fn closest(centres: &[[f64; 3]], colour: [f64; 3]) -> usize {
    let distance = |c: &[f64; 3]| (0..3).map(|i| (c[i] - colour[i]).powi(2)).sum::<f64>();
    (0..centres.len()).min_by(|&a, &b| distance(&centres[a]).total_cmp(&distance(&centres[b]))).unwrap_or(0)
}

fn encoded(size: Size, indexed: &Indexed, transparent: bool, delay: (u16, u16)) -> Result<Vec<u8>, Error> {
    let wrong = |e: png::EncodingError| Error::Encode { size, reason: e.to_string() };
    let Indexed { colours, frames } = indexed;
    let clear = colours.len() as u8;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(colours.iter().copied().chain([[0; 3]]).flatten().collect::<Vec<u8>>());
    encoder.set_trns([vec![255; colours.len()], vec![0]].concat());
    encoder.set_compression(png::Compression::High);
    // Filters predict neighbouring values; palette indices have none.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(frames.len() as u32, 0).map_err(wrong)?;
    encoder.set_frame_delay(delay.0, delay.1).map_err(wrong)?;
    encoder.set_blend_op(if transparent { png::BlendOp::Over } else { png::BlendOp::Source }).map_err(wrong)?;
    encoder.set_dispose_op(png::DisposeOp::None).map_err(wrong)?;
    let mut writer = encoder.write_header().map_err(wrong)?;
    let mut previous: Option<&Vec<u8>> = None;
    for frame in frames {
        match previous {
            Some(previous) if transparent => {
                let changed = frame.iter().zip(previous).map(|(&new, &old)| if new == old { clear } else { new });
                writer.write_image_data(&changed.collect::<Vec<u8>>()).map_err(wrong)?;
            }
            _ => writer.write_image_data(frame).map_err(wrong)?,
        }
        previous = Some(frame);
    }
    writer.finish().map_err(wrong)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(size: Size, frame: usize, noisy: bool) -> Picture {
        let mut state = 12345 + frame as u64;
        let mut rgb = Vec::new();
        for y in 0..size.height {
            for x in 0..size.width {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let noise = if noisy { (state >> 33) as usize % 90 } else { 0 };
                rgb.extend([(x + frame) * 2 + noise, y * 3 + noise, 60 + noise].map(|v| (v % 256) as u8));
            }
        }
        Picture { size, rgb }
    }

    #[test]
    fn panels_stand_side_by_side_and_every_frame_is_there() {
        let size = Size::new(40, 24);
        let sequence = |noisy| (0..5).map(|f| moving(size, f, noisy)).collect::<Vec<_>>();
        let (noisy, clean) = (sequence(true), sequence(false));
        let folder = std::env::temp_dir().join(format!("quell-strip-{}", std::process::id()));
        let path = folder.join("strip.png");
        let options = StripOptions { panel_width_px: 20, gap_px: 2, ..StripOptions::default() };
        let written = write_animation(&path, &[&noisy, &clean, &clean[..1]], &options).unwrap();
        assert_eq!((written.size, written.step), (Size::new(64, 12), 1));
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes.len(), written.bytes);
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 5);
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        for _ in 0..5 {
            reader.next_frame(&mut buffer).unwrap();
        }
        // The first frame keeps the colours to a few steps.
        let shown = image::load_from_memory(&bytes).unwrap().into_rgb8();
        let expected = averaged_down(&clean[0], 20);
        for y in 0..12 {
            for x in 0..20 {
                for c in 0..3 {
                    let found = i32::from(shown.get_pixel(22 + x as u32, y as u32)[c]);
                    let wanted = i32::from(expected.rgb[3 * (y * 20 + x) + c]);
                    assert!((found - wanted).abs() <= 14, "({x}, {y}) {c}: {found}, not {wanted}");
                }
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn the_limit_is_kept_or_said_to_be_impossible() {
        let frames: Vec<Picture> = (0..6).map(|f| moving(Size::new(60, 40), f, true)).collect();
        let folder = std::env::temp_dir().join(format!("quell-strip-limit-{}", std::process::id()));
        let path = folder.join("strip.png");
        let options = StripOptions { max_bytes: 6000, ..StripOptions::default() };
        let written = write_animation(&path, &[&frames], &options).unwrap();
        assert!(written.bytes <= 6000 && (written.colours < 80 || written.step > 1), "{written:?}");
        let options = StripOptions { max_bytes: 100, ..options };
        assert!(matches!(write_animation(&path, &[&frames], &options), Err(Error::Encode { .. })));
        assert!(matches!(write_animation(&path, &[&[]], &options), Err(Error::Empty { .. })));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
