//! What is wrong with a sequence, and how to fix it: `quell doctor`.
//!
//! ```text
//! finding.rs  what is said: findings, what passed, what could not be examined, pictures to show
//! files.rs    names and headers of all frames
//! codec.rs    lossy compressions of data, from headers
//! look.rs     which frames are read closely, and what is kept of one
//! passes.rs   passes that are missing, misnamed, do not add up, hold colour where they should not
//! values.rs   NaN, infinities, light below zero, fireflies
//! guides.rs   normals, depth, albedo: how they are stored
//! motion.rs   vectors: sign, axes, unit, direction, length, zero; jitter; animation on twos
//! warp.rs     fractions of a pixel by which surfaces lie beside where vectors lead
//! noise.rs    one seed for all frames, splatted filters, denoised pictures
//! grain.rs    how noise hangs together from pixel to pixel
//! level.rs    how much noise there is
//! changes.rs  light and emission that change on surfaces at rest
//! follow.rs   surfaces at rest, followed from one frame to the one before
//! ```
//!
//! A check measures frames, or pairs of neighbouring frames, one at a time (`look`, `pair`), and judges all figures
//! together at the end (`judge`). Thresholds and where they come from: docs/doctor.md.

mod changes;
mod codec;
mod files;
mod finding;
mod follow;
mod grain;
mod guides;
mod level;
mod look;
mod motion;
mod noise;
mod passes;
mod values;
mod warp;

pub use finding::{CHECKS, Diagnosis, Exhibit, Figure, Finding, Level, NotExamined, Passed, Severity};

use crate::adapt::{AdaptOptions, Adapter, Links, MotionChoice};
use crate::error::Error;
use crate::image::{ExrImage, Window};
use crate::roles::{MapOptions, Mapping, Role, map_roles};
use crate::sequence::{Sequence, find_sequence};
use follow::Paths;
use look::{Look, name_of};
use quell::{Plane, Rgb, Size};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What to look at.
#[derive(Clone, Debug, Default)]
pub struct DoctorOptions {
    /// Files, folders, patterns.
    pub inputs: Vec<PathBuf>,
    /// Only these frames; ascending.
    pub frames: Option<Vec<i64>>,
    /// Which passes are what.
    pub map: MapOptions,
    /// What vectors mean, as `quell denoise` would take them.
    pub motion: MotionChoice,
    /// How many pairs of frames are kept to be shown.
    pub exhibits: usize,
}

/// Examines a sequence. `notify` hears which frame is looked at, of how many; `stop` ends it early.
///
/// What is wrong with the files is a finding, not an error.
///
/// # Errors
/// [`Error::Invalid`] where an input means no file, or what the user named (a role, layer, view, motion preset) does not
/// exist; [`Error::Io`] where a folder cannot be listed.
pub fn examine(
    options: &DoctorOptions,
    notify: &(dyn Fn(usize, usize) + Sync),
    stop: &AtomicBool,
) -> Result<Diagnosis, Error> {
    let mut found = Diagnosis::default();
    let mut sequence = match find_sequence(&options.inputs) {
        Ok(sequence) => sequence,
        Err(error) => return mixed(options, error),
    };
    if let Some(only) = &options.frames {
        restrict(&mut sequence, only);
        if sequence.frames.is_empty() {
            let path = options.inputs.first().cloned().unwrap_or_default();
            return Err(Error::invalid(&path, "there is no file of the frames that were asked for"));
        }
    }
    found.frames = sequence.frames.iter().map(|f| f.number).collect();
    let headers = files::headers(&sequence);
    let Some(first) = headers.iter().find(|h| h.error.is_none()) else {
        unreadable(&headers, &mut found);
        return Ok(found);
    };
    files::judge(&sequence, &headers, first, &mut found);
    found.display = first.display;
    let Some(sources) = sequence.frame(first.number) else { return Ok(found) };
    let images = sources.read_headers()?;
    let mappings = match map_roles(&sources.named(&images), &options.map) {
        Ok(mappings) => mappings,
        // What the user named does not exist: not the file's fault.
        Err(error) if !options.map.map.is_empty() || options.map.layer.is_some() || options.map.view.is_some() => {
            return Err(error);
        }
        Err(error) => {
            found.findings.push(
                Finding::new("passes.unknown", Severity::Fault, "quell cannot tell what the passes are")
                    .frame(first.number)
                    .evidence(error.to_string(), Vec::new())
                    .cure("nothing can be filtered", "name the passes with --map ROLE=CHANNEL"),
            );
            found.cannot("pixels", "no pass has a role that could be examined");
            return Ok(found);
        }
    };
    if let Some(mapping) = mappings.first() {
        found.renderer = format!("{} ({})", mapping.renderer.name, mapping.renderer_why);
    }
    let numbers = look::chosen(&headers, first);
    if composite(&images) {
        found.findings.push(
            Finding::new("passes.composite", Severity::Note, "the file begins with the compositor's result")
                .channel("Composite.Combined")
                .evidence("a part or layer `Composite` stands before the view layers", Vec::new())
                .cure(
                    "nothing: quell filters the view layers; `Composite.Combined` passes through as it is, noisy or denoised by the compositor",
                    "composite after denoising",
                ),
        );
    }
    let canvas = headers.iter().filter(|h| h.fits(first)).filter_map(|h| h.full).reduce(Window::union);
    let canvas = canvas.unwrap_or(Window::new(0, 0, Size::new(0, 0)));
    let several = mappings.len() > 1;
    let total = numbers.len() * mappings.len();
    for (i, mapping) in mappings.iter().enumerate() {
        let mut own = Diagnosis { frames: found.frames.clone(), ..Diagnosis::default() };
        let job = Layer { options, sequence: &sequence, headers: &headers, mapping, canvas, numbers: &numbers };
        job.examine(&images, first.number, &mut own, &|k| notify(i * numbers.len() + k, total), stop)?;
        merge(&mut found, own, several, mapping);
    }
    found.examined = numbers;
    found.findings.sort_by(|a, b| b.severity.cmp(&a.severity).then(a.check.cmp(b.check)).then(a.frame.cmp(&b.frame)));
    Ok(found)
}

/// One view layer and stereo view.
struct Layer<'a> {
    options: &'a DoctorOptions,
    sequence: &'a Sequence,
    headers: &'a [files::Header],
    mapping: &'a Mapping,
    canvas: Window,
    numbers: &'a [i64],
}

impl Layer<'_> {
    fn examine(
        &self,
        headers: &[ExrImage],
        first: i64,
        found: &mut Diagnosis,
        notify: &dyn Fn(usize),
        stop: &AtomicBool,
    ) -> Result<(), Error> {
        let mapping = self.mapping;
        found.mapping = mapping.describe();
        codec::judge(mapping, headers, first, found);
        let renamed = passes::names(mapping, &self.options.map, found);
        let adapt = AdaptOptions { motion: self.options.motion.clone(), ..AdaptOptions::default() };
        let (mut values, mut guides, mut motion, mut noise) = (
            values::Values::default(),
            guides::GuideChecks::default(),
            motion::Motion::default(),
            noise::Noise::default(),
        );
        let (mut changes, mut levels) = (changes::Changes::default(), level::Levels::default());
        let beauty = name_of(mapping, Role::Beauty);
        let mut adapter: Option<Adapter> = None;
        let mut links = Links::default();
        let mut last: Option<Look> = None;
        let mut sums_of = None;
        for (i, number) in self.numbers.iter().enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Err(Error::invalid(Path::new("doctor"), "interrupted"));
            }
            notify(i);
            let Some(sources) = self.sequence.frame(*number) else { continue };
            let images = match look::read(sources, mapping) {
                Ok(images) => images,
                Err(error) => {
                    damaged(*number, &error, found);
                    last = None;
                    continue;
                }
            };
            if adapter.is_none() {
                let second = self.numbers.get(i + 1).filter(|n| number.checked_add(1) == Some(**n));
                let second = second.and_then(|n| look::read(self.sequence.frame(*n)?, mapping).ok());
                match Adapter::new(mapping.clone(), self.canvas, &images, second.as_deref(), &adapt) {
                    Ok(made) => adapter = Some(made),
                    // An unknown preset is the user's slip.
                    Err(error) if matches!(self.options.motion, MotionChoice::Preset(_)) => return Err(error),
                    Err(error) => {
                        damaged(*number, &error, found);
                        continue;
                    }
                }
            }
            let Some(adapter) = &adapter else { continue };
            values.look(mapping, &images, *number);
            if last.as_ref().is_none_or(|l| l.number.checked_add(1) != Some(*number)) {
                links = Links::default();
                last = None;
            }
            let mut look = match Look::new(adapter, mapping, *number, &images, &mut links) {
                Ok(look) => look,
                Err(error) => {
                    damaged(*number, &error, found);
                    last = None;
                    continue;
                }
            };
            drop(images);
            if sums_of.is_none() {
                let mut sums = Diagnosis::default();
                passes::sums(adapter, mapping, &look, &mut sums);
                sums_of = Some(sums);
            }
            values.bright(&look.beauty, *number);
            guides.look(adapter, &look);
            // Frames of quell have no positions, but cameras: the same surfaces are known by both.
            if let (None, Some(camera)) = (&look.frame.position, look.camera) {
                look.frame.position = warp::positions(&look.frame, &camera);
            }
            motion.look(&look);
            noise.look(&look);
            levels.look(&beauty, &look);
            if let Some(earlier) = &last {
                motion.pair(adapter, earlier, &look);
                let paths = Paths::new(&earlier.frame, &look.frame);
                noise.pair(earlier, &look, paths.as_ref());
                if let Some(paths) = &paths {
                    changes.pair(mapping, earlier, &look, paths);
                    levels.pair(&beauty, earlier, &look, paths);
                }
                // Of frames in a row the first pair is enough to look at.
                let apart = found.exhibits.last().is_none_or(|e| e.later.saturating_add(1) < earlier.number);
                if found.exhibits.len() < self.options.exhibits && apart {
                    found.exhibits.push(exhibit(earlier, &look));
                }
            }
            found.examined.push(*number);
            last = Some(look);
        }
        let Some(adapter) = adapter else {
            found.cannot("pixels", "no frame could be read");
            return Ok(());
        };
        self.repeated(&motion, found);
        let several = found.frames.len() > 1;
        let renamed = renamed.iter().any(|r| matches!(r, Role::Motion | Role::MotionPrevious | Role::MotionNext));
        motion.judge(&adapter, several, renamed, found);
        found.noise = levels.found();
        if several {
            changes.judge(mapping, found);
        }
        noise.judge(&mapping.renderer.name, &beauty, several, found);
        if let Some(sums) = sums_of {
            found.findings.extend(sums.findings);
            found.passed.extend(sums.passed);
            sums.not_examined.into_iter().for_each(|n| found.cannot(n.what, n.why));
        }
        guides.judge(&adapter, mapping, found);
        values.judge(&beauty, found);
        Ok(())
    }

    /// Frames that are twice there: those that were looked at, and those whose files look alike.
    fn repeated(&self, motion: &motion::Motion, found: &mut Diagnosis) {
        let mut pairs = motion.same_pictures();
        let candidates = files::candidates(self.sequence, self.headers);
        for (a, b) in candidates.into_iter().take(8) {
            if !pairs.contains(&(a, b)) && self.same_picture(a, b) {
                pairs.push((a, b));
            }
        }
        pairs.sort_unstable();
        // Every other frame: that is an animation on twos, which another check says.
        let run =
            pairs.len() >= 2 && pairs.windows(2).all(|w| w[1].0 - w[0].0 >= 2) && pairs.len() * 4 >= self.numbers.len();
        if !run || !motion.has_turns() {
            files::repeated(&pairs, &name_of(self.mapping, Role::Beauty), found);
        }
    }

    fn same_picture(&self, a: i64, b: i64) -> bool {
        let read = |n: i64| -> Option<Vec<f32>> {
            let images = look::read(self.sequence.frame(n)?, self.mapping).ok()?;
            let light = self.mapping.passes.iter().filter(|p| p.role == Role::Beauty || p.role.light().is_some());
            let ids = light.flat_map(|p| &p.channels);
            Some(
                ids.filter_map(|id| images.get(id.file)?.samples(id.part, id.channel))
                    .flat_map(|s| s.to_f32())
                    .collect(),
            )
        };
        matches!((read(a), read(b)), (Some(a), Some(b)) if a == b && !a.is_empty())
    }
}

fn damaged(number: i64, error: &Error, found: &mut Diagnosis) {
    if found.has("frames.unreadable") {
        return;
    }
    found.findings.push(
        Finding::new("frames.unreadable", Severity::Fault, format!("frame {number} cannot be read"))
            .frame(number)
            .evidence(error.to_string(), Vec::new())
            .cure("the frame is not written, and its neighbours lose what it would have given", "render it again"),
    );
}

/// No frame has headers that can be read.
fn unreadable(headers: &[files::Header], found: &mut Diagnosis) {
    let error = headers.iter().find_map(|h| h.error.clone()).unwrap_or_default();
    found.findings.push(
        Finding::new("frames.unreadable", Severity::Fault, "no frame can be read as EXR")
            .frame(headers.first().map_or(0, |h| h.number))
            .evidence(error, vec![Figure::new("unreadable frames", headers.len() as f64, "frames")])
            .cure("nothing can be filtered", "write OpenEXR files (Blender: Output > File Format: OpenEXR MultiLayer)"),
    );
    found.cannot("passes, pixels and motion", "no file could be read as EXR");
}

/// Several sequences at once, or none: what finding them said.
fn mixed(options: &DoctorOptions, error: Error) -> Result<Diagnosis, Error> {
    let text = error.to_string();
    let several = text.contains("sequences, and their names tell no passes")
        || text.contains("no frame has all of the passes")
        || text.contains(", too");
    if !several {
        return Err(error);
    }
    let mut found = Diagnosis::default();
    let input = options.inputs.first().map_or_else(String::new, |p| p.display().to_string());
    found.findings.push(
        Finding::new("frames.mixed", Severity::Fault, "these files are not one sequence")
            .evidence(text, Vec::new())
            .cure(
                "quell cannot tell which frames belong together",
                format!("name one sequence by its pattern, such as {input}/shot.####.exr"),
            ),
    );
    found.cannot("headers, passes, pixels and motion", "it is not clear which files are the frames of one sequence");
    Ok(found)
}

fn restrict(sequence: &mut Sequence, only: &[i64]) {
    sequence.frames.retain(|f| only.binary_search(&f.number).is_ok());
    sequence.incomplete.retain(|(n, _)| only.binary_search(n).is_ok());
    let (first, last) = (sequence.frames.first().map(|f| f.number), sequence.frames.last().map(|f| f.number));
    // Gaps that the user asked for are none.
    sequence.gaps.retain(|(a, b)| {
        first.is_some_and(|f| *a > f) && last.is_some_and(|l| *b < l) && only.iter().any(|n| n >= a && n <= b)
    });
}

fn composite(images: &[ExrImage]) -> bool {
    images
        .iter()
        .flat_map(|i| i.parts())
        .any(|p| p.name().starts_with("Composite.") || p.channels().iter().any(|c| c.name().starts_with("Composite.")))
}

fn merge(into: &mut Diagnosis, own: Diagnosis, several: bool, mapping: &Mapping) {
    let layer = if several {
        [mapping.layer.as_str(), mapping.view.as_str()]
            .into_iter()
            .filter(|s| !s.is_empty())
            .collect::<Vec<_>>()
            .join(", ")
    } else {
        String::new()
    };
    into.mapping += &own.mapping;
    into.findings.extend(own.findings.into_iter().map(|mut f| {
        f.layer.clone_from(&layer);
        f
    }));
    into.exhibits.extend(own.exhibits.into_iter().map(|mut e| {
        e.layer.clone_from(&layer);
        e
    }));
    into.passed.extend(own.passed);
    into.noise.extend(own.noise);
    own.not_examined.into_iter().for_each(|n| into.cannot(n.what, n.why));
}

/// A pair of frames to be shown.
fn exhibit(earlier: &Look, later: &Look) -> Exhibit {
    let motion = later.frame.motion_to_previous.clone();
    let surfaces = surfaces(earlier).zip(surfaces(later)).map(|((name, a), (_, b))| {
        let warped = motion.as_ref().map_or_else(|| Plane::filled(a.size(), [f32::NAN; 3]), |m| warped(&a, m));
        (name, [b, a, warped])
    });
    Exhibit {
        layer: String::new(),
        earlier: earlier.number,
        later: later.number,
        current: later.beauty.clone(),
        neighbour: earlier.beauty.clone(),
        warped: motion.as_ref().map(|m| warped(&earlier.beauty, m)),
        surfaces,
        motion,
    }
}

/// Where motion leads, bilinearly; NaN outside of the picture.
fn warped(from: &Plane<Rgb>, motion: &Plane<[f32; 2]>) -> Plane<Rgb> {
    let Size { width, height } = from.size();
    let values: Vec<Rgb> = (0..from.size().pixels())
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let v = motion.at(x, y);
            let (u, w) = (x as f32 + v[0], y as f32 + v[1]);
            if !(u > -0.5 && w > -0.5 && u < width as f32 - 0.5 && w < height as f32 - 0.5) {
                return [f32::NAN; 3];
            }
            let (u, w) = (u.clamp(0.0, width as f32 - 1.0), w.clamp(0.0, height as f32 - 1.0));
            let (u0, w0) = (u as usize, w as usize);
            let (u1, w1) = ((u0 + 1).min(width - 1), (w0 + 1).min(height - 1));
            let (fx, fy) = (u.fract(), w.fract());
            let [a, b, c, d] = [from.at(u0, w0), from.at(u1, w0), from.at(u0, w1), from.at(u1, w1)];
            std::array::from_fn(|k| (a[k] * (1.0 - fx) + b[k] * fx) * (1.0 - fy) + (c[k] * (1.0 - fx) + d[k] * fx) * fy)
        })
        .collect();
    Plane::from_vec(from.size(), values).unwrap_or_else(|_| Plane::filled(from.size(), [f32::NAN; 3]))
}

/// The guide that shows a surface's edges and texture best, as a colour.
fn surfaces(look: &Look) -> Option<(&'static str, Plane<Rgb>)> {
    if let Some(albedo) = look.frame.albedo.as_ref().or(look.frame.seen_albedo.as_ref()) {
        return Some(("albedo", albedo.clone()));
    }
    if let Some(normal) = &look.frame.normal {
        let values = normal.data().iter().map(|n| n.map(|v| v * 0.5 + 0.5)).collect();
        return Plane::from_vec(look.frame.size, values).ok().map(|p| ("normals", p));
    }
    let depth = look.frame.depth.as_ref()?;
    let mut near: Vec<f32> = depth.data().iter().copied().filter(|d| d.is_finite()).collect();
    near.sort_by(f32::total_cmp);
    let scale = near.get(near.len() / 2).copied().unwrap_or(1.0);
    let values = depth.data().iter().map(|d| [scale / (scale + d); 3]).collect();
    Plane::from_vec(look.frame.size, values).ok().map(|p| ("depth", p))
}
