//! The page of `quell doctor`: findings, and pairs of frames to look at. One self-contained HTML file.
//!
//! Of each pair: the frame and its neighbour brought to it along the motion, to flip between or to wipe; surfaces without
//! noise; and the motion as colour. Pictures wider than [`MAX_WIDTH`] are shown at every n-th pixel.

use crate::error::Error;
use crate::report::template::{fill, plain};
use crate::tone::{Picture, Tone, srgb_from_linear};
use base64::Engine;
use quell::{Plane, Rgb, Size};
use quell_frames::doctor::{Diagnosis, Exhibit, Finding, Severity};
use quell_frames::driver::ranges;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;

/// Width of a picture on the page, at most.
pub const MAX_WIDTH: usize = 1280;
/// What is shown where motion leads outside of the picture, or is unknown.
const NOTHING: [u8; 3] = [190, 30, 140];

/// Writes the page, whole or not at all; its length in bytes.
///
/// # Errors
/// [`Error::Encode`], I/O errors.
pub fn write(path: &Path, found: &Diagnosis, command: &str) -> Result<usize, Error> {
    let page = html(found, command)?;
    quell_frames::files::write_bytes(path, page.as_bytes())?;
    Ok(page.len())
}

fn html(found: &Diagnosis, command: &str) -> Result<String, Error> {
    let mut body = String::new();
    let out = &mut body;
    // Writing to a string never fails.
    let _ = write!(out, "<section><h2>Findings</h2>");
    if found.findings.is_empty() {
        out.push_str("<p>None.</p>");
    }
    for finding in &found.findings {
        write_finding(out, finding);
    }
    out.push_str("</section>");
    list(out, "Could not examine", found.not_examined.iter().map(|n| format!("{}, because {}", n.what, n.why)));
    for (i, exhibit) in found.exhibits.iter().enumerate() {
        write_exhibit(out, i, exhibit)?;
    }
    list(out, "Good", found.passed.iter().map(|p| format!("{}: {}", p.check, p.text)));
    if !found.mapping.is_empty() {
        let _ =
            write!(out, "<section><h2>What each pass was taken for</h2><pre>{}</pre></section>", plain(&found.mapping));
    }
    let title = match found.worst() {
        Some(Severity::Fault) => "The doctor found faults",
        Some(Severity::Warning) => "The doctor has warnings",
        Some(Severity::Note) => "The doctor has notes",
        None => "The doctor found nothing",
    };
    let size = found.display.map_or_else(String::new, |w| format!(", {}x{}", w.size.width, w.size.height));
    let subtitle = format!(
        "frames {}{size}; {}; pixels of frames {} were looked at",
        ranges(&found.frames),
        plain(&found.renderer),
        if found.examined.is_empty() { "none".to_owned() } else { ranges(&found.examined) }
    );
    let command = plain(command);
    Ok(fill(include_str!("assets/doctor.html"), |name| match name {
        "title" => vec![title],
        "subtitle" => vec![subtitle.as_str()],
        "style" => vec![include_str!("assets/document.css"), include_str!("assets/doctor.css")],
        "body" => vec![body.as_str()],
        "script" => vec![include_str!("assets/doctor.js")],
        "command" => vec![command.as_str()],
        "version" => vec![env!("CARGO_PKG_VERSION")],
        _ => vec![],
    }))
}

/// Text as HTML; what stands in backticks as code.
fn code(text: &str) -> String {
    let mut html = String::new();
    for (i, part) in text.split('`').enumerate() {
        let (open, close) = if i % 2 == 1 { ("<code>", "</code>") } else { ("", "") };
        html += &format!("{open}{}{close}", plain(part));
    }
    html
}

fn list(out: &mut String, heading: &str, lines: impl Iterator<Item = String>) {
    let items: String = lines.map(|line| format!("<li>{}</li>", code(&line))).collect();
    if !items.is_empty() {
        let _ = write!(out, "<section><h2>{heading}</h2><ul>{items}</ul></section>");
    }
}

fn write_finding(out: &mut String, f: &Finding) {
    let place = [f.layer.clone(), f.frame.map_or_else(String::new, |n| format!("frame {n}")), f.channel.clone()];
    let place: Vec<String> = place.into_iter().filter(|p| !p.is_empty()).collect();
    let name = f.severity.name();
    let _ = write!(
        out,
        "<article class=\"{name}\"><h3><span class=\"severity\">{name}</span> {}</h3><p class=\"place\"><code>{}</code> {}</p><dl>",
        code(&f.what),
        f.check,
        plain(&place.join(", "))
    );
    for (word, text) in [("Evidence", &f.evidence), ("Spoils", &f.spoils), ("Fix", &f.remedy)] {
        if !text.is_empty() {
            let _ = write!(out, "<dt>{word}</dt><dd>{}</dd>", code(text));
        }
    }
    out.push_str("</dl></article>");
}

fn write_exhibit(out: &mut String, number: usize, e: &Exhibit) -> Result<(), Error> {
    let layer = if e.layer.is_empty() { String::new() } else { format!("{}: ", plain(&e.layer)) };
    let tone = Tone::automatic([&e.current]);
    let light = |plane: &Plane<Rgb>| shown(plane, |c| tone.srgb(c));
    let surface = |plane: &Plane<Rgb>| shown(plane, |c| c.map(|v| srgb_from_linear(v.clamp(0.0, 1.0))));
    let mut groups: Vec<(String, Vec<(&str, Picture)>)> = Vec::new();
    if let Some((name, [current, neighbour, warped])) = &e.surfaces {
        let mut pictures = vec![("this frame", surface(current))];
        if e.motion.is_some() {
            pictures.push(("neighbour, moved here", surface(warped)));
            pictures.push(("difference", difference(current, warped)));
        }
        pictures.push(("neighbour as it is", surface(neighbour)));
        groups.push((format!("Surfaces ({name})"), pictures));
    }
    let mut pictures = vec![("this frame", light(&e.current))];
    pictures.extend(e.warped.as_ref().map(|w| ("neighbour, moved here", light(w))));
    pictures.push(("neighbour as it is", light(&e.neighbour)));
    groups.push(("Light".to_owned(), pictures));
    let _ = write!(out, "<section><h2>{layer}frame {} and its neighbour {}</h2>", e.later, e.earlier);
    out.push_str(
        "<p>Flip between this frame and its neighbour moved along the vectors: where they are right, surfaces stand still. Edges that \
         jump show vectors that are wrong. Pink: the vectors lead outside of the picture, or there are none.</p><div class=\"pairs\">",
    );
    for (g, (name, pictures)) in groups.into_iter().enumerate() {
        let encoded = pictures.par_iter().map(|(_, p)| p.png()).collect::<Result<Vec<_>, Error>>()?;
        let _ = write!(out, "<figure class=\"flip\" data-name=\"{number}-{g}\"><div class=\"stage\">");
        for ((label, picture), png) in pictures.iter().zip(encoded) {
            let _ = write!(
                out,
                "<img width=\"{}\" height=\"{}\" alt=\"{name}, {label}\" data-label=\"{label}\" src=\"data:image/png;base64,{}\">",
                picture.size.width,
                picture.size.height,
                base64::engine::general_purpose::STANDARD.encode(&png)
            );
        }
        let _ = write!(out, "</div><figcaption><b>{name}</b> <span class=\"buttons\"></span></figcaption></figure>");
    }
    if let Some(motion) = &e.motion {
        let (picture, longest) = motion_picture(motion);
        let key = motion_key();
        let _ = write!(
            out,
            "<figure><img width=\"{}\" height=\"{}\" alt=\"motion as colour\" src=\"data:image/png;base64,{}\"><figcaption><b>Motion to frame {}</b> \
             <img class=\"key\" width=\"64\" height=\"64\" alt=\"key\" src=\"data:image/png;base64,{}\"> the direction that the surface came from, as \
             colour; brightest: {longest:.1} px or more; grey: none; pink: unknown</figcaption></figure>",
            picture.size.width,
            picture.size.height,
            base64::engine::general_purpose::STANDARD.encode(picture.png()?),
            e.earlier,
            base64::engine::general_purpose::STANDARD.encode(key.png()?)
        );
    }
    out.push_str("</div></section>");
    Ok(())
}

/// Black where both are equal.
fn difference(a: &Plane<Rgb>, b: &Plane<Rgb>) -> Picture {
    let between = |x: usize, y: usize| {
        let (a, b) = (a.at(x, y), b.at(x, y));
        std::array::from_fn(
            |c| if b[c].is_nan() { f32::NAN } else { (a[c].clamp(0.0, 1.0) - b[c].clamp(0.0, 1.0)).abs() },
        )
    };
    shown(&Plane::from_fn(a.size(), between), |c| c.map(|v| srgb_from_linear(v.clamp(0.0, 1.0))))
}

/// Every n-th pixel, so that the width is at most [`MAX_WIDTH`].
fn shown(plane: &Plane<Rgb>, colour: impl Fn(Rgb) -> Rgb) -> Picture {
    picked(plane.size(), |x, y| {
        let c = plane.at(x, y);
        if c.iter().any(|v| v.is_nan()) { NOTHING } else { colour(c).map(|v| (v * 255.0 + 0.5) as u8) }
    })
}

fn picked(size: Size, pixel: impl Fn(usize, usize) -> [u8; 3]) -> Picture {
    let step = size.width.div_ceil(MAX_WIDTH).max(1);
    let small = Size::new(size.width.div_ceil(step), size.height.div_ceil(step));
    let mut rgb = Vec::with_capacity(small.pixels() * 3);
    for y in (0..size.height).step_by(step) {
        for x in (0..size.width).step_by(step) {
            rgb.extend(pixel(x, y));
        }
    }
    Picture { size: small, rgb }
}

/// Direction as hue, length as brightness; the length of nine tenths of all vectors is the brightest.
fn motion_picture(motion: &Plane<[f32; 2]>) -> (Picture, f32) {
    let mut lengths: Vec<f32> = motion.data().iter().map(|v| v[0].hypot(v[1])).filter(|l| l.is_finite()).collect();
    lengths.sort_by(f32::total_cmp);
    let longest = lengths.get(lengths.len() * 9 / 10).copied().unwrap_or(1.0).max(0.1);
    let picture = picked(motion.size(), |x, y| {
        let v = motion.at(x, y);
        if v.iter().all(|v| v.is_finite()) { hue(v[0] / longest, v[1] / longest) } else { NOTHING }
    });
    (picture, longest)
}

fn motion_key() -> Picture {
    picked(Size::new(64, 64), |x, y| {
        let (u, v) = (x as f32 / 31.5 - 1.0, y as f32 / 31.5 - 1.0);
        if u.hypot(v) <= 1.0 { hue(u, v) } else { [16, 18, 22] }
    })
}

/// Mid grey without motion; a hue for each direction.
fn hue(x: f32, y: f32) -> [u8; 3] {
    let (length, angle) = (x.hypot(y).min(1.0), y.atan2(x));
    [0.0, 1.0, 2.0].map(|c| {
        let wave = (angle - c * std::f32::consts::TAU / 3.0).cos();
        ((0.42 + length * (0.13 + 0.42 * wave)).clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_findings_and_pictures_and_nothing_from_elsewhere() {
        let size = Size::new(4, 3);
        let grey = Plane::filled(size, [0.5; 3]);
        let exhibit = Exhibit {
            layer: String::new(),
            earlier: 1,
            later: 2,
            current: grey.clone(),
            neighbour: grey.clone(),
            warped: Some(Plane::filled(size, [f32::NAN; 3])),
            surfaces: Some(("albedo", [grey.clone(), grey.clone(), grey])),
            motion: Some(Plane::filled(size, [1.0, f32::NAN])),
        };
        let finding =
            Finding::new("motion.sign", Severity::Fault, "a < b").frame(2).channel("Vector").cure("x", "y & z");
        let found =
            Diagnosis { findings: vec![finding], exhibits: vec![exhibit], frames: vec![1, 2], ..Diagnosis::default() };
        let page = html(&found, "quell doctor <x>").unwrap();
        assert!(page.contains("a &lt; b") && page.contains("y &amp; z") && page.contains("quell doctor &lt;x&gt;"));
        assert_eq!(page.matches("data:image/png").count(), 9);
        assert!(!page.contains("{{") && !page.contains("http://") && !page.contains("https://"));
    }

    #[test]
    fn opposite_directions_have_other_colours_and_none_is_grey() {
        assert_eq!(hue(0.0, 0.0), [107; 3]);
        assert!(hue(1.0, 0.0)[0] > 200 && hue(-1.0, 0.0)[0] < 80);
    }
}
