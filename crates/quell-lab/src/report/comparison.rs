//! The page of a comparison: one self-contained HTML file with every method's pictures in a grid, wipe, FLIP maps, x-t
//! slices, tables, and quality against time.
//!
//! Pictures are PNG data URIs, FLIP maps grey JPEG (they are looked at, not measured). At most [`MAX_BYTES`]: a page
//! that would be larger holds fewer frames (the last, in a row, so that stepping still shows flicker), then a part
//! from the middle of each, and says so.

use crate::error::Error;
use crate::report::figures::{self, Better, ComparedMethod, Figure};
use crate::report::player::MAX_BYTES;
use crate::report::template::{fill, plain};
use crate::tone::Picture;
use base64::Engine;
use quell::{Plane, Size};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Fewer frames than these show no flicker; beyond, parts of the picture are left out instead.
const LEAST_FRAMES: usize = 4;
/// Quality of FLIP maps as JPEG.
const MAP_QUALITY: u8 = 88;

/// Everything that the page shows.
#[derive(Clone, Debug, Default)]
pub struct ComparisonPage {
    /// The scene's name, as a heading.
    pub title: String,
    /// One line under it: size, frames, samples.
    pub subtitle: String,
    /// Numbers of the frames whose pictures are shown, ascending.
    pub frame_numbers: Vec<i64>,
    /// Frames a second at normal speed; 0 counts as 12.
    pub frames_per_second: f64,
    /// The reference first, then every method that has pictures.
    pub panels: Vec<Panel>,
    /// Rows of pixels of which there are slices.
    pub slice_rows: Vec<usize>,
    /// Numbers of the frames that a slice is made of.
    pub slice_frames: Vec<i64>,
    /// Figures of every method, also of those that could not run.
    pub methods: Vec<ComparedMethod>,
    /// Sentences.
    pub notes: Vec<String>,
    /// The command line that made the page.
    pub command: String,
}

/// One sequence of pictures.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// `reference`, or the method's name.
    pub name: String,
    /// A picture for each of the page's frames; `None` where there is none.
    pub pictures: Vec<Option<Picture>>,
    /// HDR-FLIP maps, as many; empty for the reference.
    pub maps: Vec<Option<Plane<f32>>>,
    /// For each of the page's slice rows a picture of the sequence's width, one row a frame, time running down.
    pub slices: Vec<Picture>,
}

#[derive(Serialize)]
struct PageData<'a> {
    title: &'a str,
    subtitle: &'a str,
    width: usize,
    height: usize,
    frames: &'a [i64],
    fps: f64,
    panels: Vec<PagePanel<'a>>,
    slice_rows: &'a [usize],
    slice_frames: &'a [i64],
    groups: Vec<Group>,
    methods: Vec<PageMethod<'a>>,
    missing: Vec<(String, String)>,
    notes: &'a [String],
    command: &'a str,
    reduced: Option<&'a str>,
    version: &'a str,
}

#[derive(Serialize)]
struct PagePanel<'a> {
    name: &'a str,
    pictures: Vec<Option<String>>,
    errors: Vec<Option<String>>,
    slices: Vec<String>,
    /// HDR-FLIP of each frame.
    flip: Vec<Option<f64>>,
}

#[derive(Serialize)]
struct Group {
    title: &'static str,
    id: &'static str,
    figures: Vec<PageFigure>,
}

#[derive(Serialize)]
struct PageFigure {
    name: &'static str,
    label: &'static str,
    meaning: &'static str,
    better: Better,
    best: Vec<String>,
}

#[derive(Serialize)]
struct PageMethod<'a> {
    name: &'a str,
    reason: Option<&'a str>,
    values: BTreeMap<&'static str, Option<f64>>,
    texts: BTreeMap<&'static str, String>,
    why: BTreeMap<&'static str, &'a str>,
}

/// Pictures of one panel as files.
struct Encoded {
    pictures: Vec<Option<Vec<u8>>>,
    maps: Vec<Option<Vec<u8>>>,
    slices: Vec<Vec<u8>>,
}

/// Writes the page, whole or not at all; what had to be left out is returned in a sentence.
///
/// # Errors
/// [`Error::Empty`] without pictures, [`Error::Size`] where they differ in extent, [`Error::Encode`], I/O errors.
pub fn write(path: &Path, page: &ComparisonPage) -> Result<Option<String>, Error> {
    let (html, reduced) = html_within(page, MAX_BYTES)?;
    quell_frames::files::write_bytes(path, html.as_bytes())?;
    Ok(reduced)
}

fn html_within(page: &ComparisonPage, max_bytes: usize) -> Result<(String, Option<String>), Error> {
    let size = page
        .panels
        .iter()
        .flat_map(|p| p.pictures.iter().flatten())
        .map(|p| p.size)
        .next()
        .ok_or_else(|| Error::Empty { what: "the page of the comparison has no picture to show".to_owned() })?;
    for panel in &page.panels {
        for picture in panel.pictures.iter().flatten() {
            Error::same_size("picture of the page", picture.size, size)?;
        }
        for map in panel.maps.iter().flatten() {
            Error::same_size("FLIP map of the page", map.size(), size)?;
        }
    }
    let mut window = (0, 0, size);
    let mut encoded = encode(page, window)?;
    let fixed = html(page, size, 0, &[], None)?.len() + 1024;
    let slices: usize = encoded.iter().flat_map(|p| &p.slices).map(|s| base64_length(s.len())).sum();
    let room = max_bytes.saturating_sub(fixed + slices);
    let count = page.frame_numbers.len();
    let bytes = |encoded: &[Encoded], first: usize| -> usize {
        let of =
            |list: &[Option<Vec<u8>>]| list.iter().skip(first).flatten().map(|p| base64_length(p.len())).sum::<usize>();
        encoded.iter().map(|p| of(&p.pictures) + of(&p.maps)).sum()
    };
    let fewest = count.saturating_sub(LEAST_FRAMES);
    let mut first = (0..=fewest).find(|&first| bytes(&encoded, first) <= room).unwrap_or(fewest);
    let mut scale = 1.0_f64;
    while bytes(&encoded, first) > room {
        scale *= 0.95 / (bytes(&encoded, first) as f64 / room.max(1) as f64).sqrt();
        let part = |extent: usize| ((extent as f64 * scale) as usize).max(1);
        let crop = Size::new(part(size.width), part(size.height));
        if crop.pixels() == 1 {
            return Err(Error::Encode { size, reason: format!("the page does not fit {max_bytes} bytes") });
        }
        window = ((size.width - crop.width) / 2, (size.height - crop.height) / 2, crop);
        encoded = encode(page, window)?;
        first = fewest;
    }
    let mut left_out = Vec::new();
    if first > 0 {
        left_out.push(format!("the last {} of {count} frames", count - first));
    }
    if window.2 != size {
        left_out.push(format!("of each the middle {} of {size} pixels", window.2));
    }
    let reduced = (!left_out.is_empty()).then(|| {
        let megabytes = max_bytes / 1_000_000;
        format!(
            "To stay under {megabytes} MB, this page holds {}. The files beside it are complete.",
            left_out.join(", ")
        )
    });
    Ok((html(page, window.2, first, &encoded, reduced.as_deref())?, reduced))
}

const fn base64_length(bytes: usize) -> usize {
    bytes.div_ceil(3) * 4 + 3
}

fn encode(page: &ComparisonPage, window: (usize, usize, Size)) -> Result<Vec<Encoded>, Error> {
    let (x, y, crop) = window;
    page.panels
        .iter()
        .map(|panel| {
            let pictures = panel.pictures.par_iter().map(|p| p.as_ref().map(|p| p.crop(x, y, crop).png()).transpose());
            let map = |map: &Plane<f32>| grey_jpeg(&Plane::from_fn(crop, |px, py| map.at(px + x, py + y)));
            let maps = panel.maps.par_iter().map(|m| m.as_ref().map(map).transpose());
            Ok(Encoded {
                pictures: pictures.collect::<Result<_, _>>()?,
                maps: maps.collect::<Result<_, _>>()?,
                slices: panel.slices.par_iter().map(Picture::png).collect::<Result<_, _>>()?,
            })
        })
        .collect()
}

/// A grey picture 0..1 as a JPEG file.
fn grey_jpeg(plane: &Plane<f32>) -> Result<Vec<u8>, Error> {
    let size = plane.size();
    let bytes: Vec<u8> = plane.data().iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    let wrong = |reason: String| Error::Encode { size, reason };
    let (Ok(width), Ok(height)) = (u16::try_from(size.width), u16::try_from(size.height)) else {
        return Err(wrong("an extent is beyond what JPEG holds".to_owned()));
    };
    let mut jpeg = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, MAP_QUALITY)
        .encode(&bytes, u32::from(width), u32::from(height), image::ExtendedColorType::L8)
        .map_err(|e| wrong(e.to_string()))?;
    Ok(jpeg)
}

fn html(
    page: &ComparisonPage,
    size: Size,
    first: usize,
    encoded: &[Encoded],
    reduced: Option<&str>,
) -> Result<String, Error> {
    let engine = base64::engine::general_purpose::STANDARD;
    let frames = page.frame_numbers.get(first..).unwrap_or(&[]);
    let files = |list: &[Option<Vec<u8>>]| -> Vec<Option<String>> {
        list.iter().skip(first).map(|file| file.as_ref().map(|file| engine.encode(file))).collect()
    };
    let panels = page.panels.iter().zip(encoded).map(|(panel, encoded)| {
        let method = page.methods.iter().find(|m| m.method == panel.name);
        let flip = |number: &i64| method?.frames.iter().find(|f| f.frame == *number).map(|f| f.scores.hdr_flip);
        PagePanel {
            name: &panel.name,
            pictures: files(&encoded.pictures),
            errors: files(&encoded.maps),
            slices: encoded.slices.iter().map(|file| engine.encode(file)).collect(),
            flip: frames.iter().map(flip).collect(),
        }
    });
    let data = PageData {
        title: &page.title,
        subtitle: &page.subtitle,
        width: size.width,
        height: size.height,
        frames,
        fps: if page.frames_per_second > 0.0 { page.frames_per_second } else { DEFAULT_FPS },
        panels: panels.collect(),
        slice_rows: &page.slice_rows,
        slice_frames: &page.slice_frames,
        groups: groups(&page.methods),
        methods: page.methods.iter().map(page_method).collect(),
        missing: figures::missing(&page.methods),
        notes: &page.notes,
        command: &page.command,
        reduced,
        version: env!("CARGO_PKG_VERSION"),
    };
    // `<` would end the script element early, whatever the text says.
    let json = serde_json::to_string(&data)?.replace('<', "\\u003c");
    let title = plain(&page.title);
    Ok(fill(include_str!("assets/comparison.html"), |name| match name {
        "title" => vec![title.as_str()],
        "style" => vec![include_str!("assets/viewer.css"), include_str!("assets/comparison.css")],
        "data" => vec![json.as_str()],
        "script" => vec![include_str!("assets/viewer.js"), include_str!("assets/comparison.js")],
        "viewer" => vec![include_str!("assets/viewer.html")],
        _ => vec![],
    }))
}

/// Where the caller names no rate.
const DEFAULT_FPS: f64 = 12.0;

fn groups(methods: &[ComparedMethod]) -> Vec<Group> {
    let all = [
        ("Pictures", "pictures", figures::PICTURE),
        ("Artefacts", "scorecard", figures::SCORECARD),
        ("Cost", "cost", figures::COST),
    ];
    let figure = |f: &Figure| PageFigure {
        name: f.name,
        label: f.label,
        meaning: f.meaning,
        better: f.better,
        best: figures::best(methods, f).into_iter().map(str::to_owned).collect(),
    };
    let measured = methods.iter().any(|m| m.scorecard.is_some());
    all.into_iter()
        .map(|(title, id, list)| Group {
            title,
            id,
            // Scores that nobody has stay, with their reason; metrics that this version lacks go.
            figures: list
                .iter()
                .filter(|f| (id == "scorecard" && measured) || methods.iter().any(|m| m.value(f.name).is_some()))
                .map(figure)
                .collect(),
        })
        .filter(|group| !group.figures.is_empty())
        .collect()
}

fn page_method(method: &ComparedMethod) -> PageMethod<'_> {
    let mut page = PageMethod {
        name: &method.method,
        reason: method.reason.as_deref(),
        values: BTreeMap::new(),
        texts: BTreeMap::new(),
        why: BTreeMap::new(),
    };
    for figure in Figure::all() {
        let value = method.value(figure.name);
        page.values.insert(figure.name, value.filter(|v| v.is_finite()));
        match value {
            Some(_) => {
                page.texts.insert(figure.name, method.cell(figure));
            }
            None => {
                if let Some(why) = method.why_not(figure.name) {
                    page.why.insert(figure.name, why);
                }
            }
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(size: Size, seed: u32) -> Picture {
        let mut state = seed.wrapping_add(17);
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        Picture { size, rgb: (0..3 * size.pixels()).map(|_| next()).collect() }
    }

    #[test]
    fn a_page_that_is_too_large_holds_the_last_frames_then_parts_and_says_so() {
        let size = Size::new(64, 48);
        let page = ComparisonPage {
            frame_numbers: (10..26).collect(),
            panels: vec![Panel {
                name: "none".to_owned(),
                pictures: (0..16).map(|i| Some(noise(size, i))).collect(),
                ..Panel::default()
            }],
            ..ComparisonPage::default()
        };
        let pictures = |page: &str| page.matches("iVBORw0KGgo").count();
        let (whole, reduced) = html_within(&page, MAX_BYTES).unwrap();
        assert_eq!((pictures(&whole), reduced), (16, None));
        let fixed = html(&page, size, 0, &[], None).unwrap().len();
        let limit = fixed + (whole.len() - fixed) * 6 / 10;
        let (part, reduced) = html_within(&page, limit).unwrap();
        assert!(part.len() <= limit && (4..16).contains(&pictures(&part)), "{}", pictures(&part));
        assert!(reduced.unwrap().contains("of 16 frames") && part.contains("24,25]"));
        let limit = fixed + (whole.len() - fixed) / 16;
        let (small, reduced) = html_within(&page, limit).unwrap();
        assert!(small.len() <= limit && pictures(&small) == 4, "{}", pictures(&small));
        assert!(reduced.unwrap().contains("of 64x48 pixels"));
        assert!(matches!(html_within(&page, 1000), Err(Error::Encode { .. })));
        assert!(html_within(&ComparisonPage::default(), MAX_BYTES).is_err());
    }
}
