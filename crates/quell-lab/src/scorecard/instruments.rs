//! All of the scorecard that depends on the references and the guides only: computed once a sequence.

use super::bands::{FINE, Map, Radii, combined, difference, dilated, edge_stopping, mapped, surface_band};
use super::fit::{self, Row, Sums};
use super::history::{OLD, Previous, ages, back, previous, stale};
use super::lag::{Change, changes};
use super::light::{LEAST_ALBEDO, demodulated, light, perceived, scale};
use super::surfaces::{Kept, Surfaces, cubic};
use crate::error::Error;
use crate::tone::luminance;
use quell::{FrameBuf, Plane, Rgb, Size};
use rayon::prelude::*;

/// B_t: pixels within this distance of an edge, at 225 rows.
const EDGE_RADIUS: f32 = 6.0;
/// Stale light that the ghosting predictor counts, stops.
const STALE: f32 = 0.08;
/// Stale light that disturbs a quiet pixel: above this, stops ...
const DISTURBING: f32 = 0.04;
/// ... and in the mean around it above this.
const DISTURBED: f32 = 0.006;
/// A pixel is fresh while its surface has been in view for at most so many frames before.
pub(super) const FRESH_FRAMES: u8 = 4;
/// Sigma over which the local rms of detail is taken, at 225 rows.
const LOCAL: f32 = 6.0;
/// Predictors below this, stops, do not cover a pixel.
const COVERING: f32 = 0.02;
/// Bits of a pixel's flags.
pub(super) mod flag {
    /// It shows a surface.
    pub const SURFACE: u8 = 1;
    /// V: its surface was in view in the frame before.
    pub const SEEN: u8 = 2;
    /// B: it is near an edge.
    pub const EDGE: u8 = 4;
    /// Q: it is quiet.
    pub const QUIET: u8 = 8;
    /// Its surface reflects enough to be demodulated.
    pub const REFLECTS: u8 = 16;
}

/// One frame of the sequence as the instruments read it. Frames follow each other by one, without cuts.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceFrame<'a> {
    /// Guides (depth, normal, id, motion, cameras), weights and `direct`, all without noise. Its signals are not read.
    pub frame: &'a FrameBuf,
    /// The converged picture, half A, scene-linear.
    pub a: &'a Plane<Rgb>,
    /// Half B, whose noise is independent of A's. `None`: there is one reference only, and floors are given.
    pub b: Option<&'a Plane<Rgb>>,
    /// The direct term within `a`; `None`: `frame.direct`. Read by flatness and lag.
    pub a_direct: Option<&'a Plane<Rgb>>,
    /// The direct term within `b`.
    pub b_direct: Option<&'a Plane<Rgb>>,
    /// Whether the frame counts. `false`: warm-up, which serves as the past of later frames only.
    pub scored: bool,
}

impl<'a> ReferenceFrame<'a> {
    /// A scored frame with one reference.
    pub fn new(frame: &'a FrameBuf, a: &'a Plane<Rgb>) -> Self {
        Self { frame, a, b: None, a_direct: None, b_direct: None, scored: true }
    }
}

/// Everything of a sequence that does not depend on the result that is scored. About 80 bytes a pixel and frame.
#[derive(Debug)]
pub struct Instruments {
    pub(super) size: Size,
    pub(super) radii: Radii,
    /// k of P(c) = log2(1 + k luminance(c)).
    pub(super) k: f32,
    /// Whether there are two independent halves.
    pub(super) halves: bool,
    /// Whether neither camera nor surfaces move.
    pub(super) static_sequence: bool,
    pub(super) frames: Vec<FrameInstruments>,
    pub(super) sums: Sums,
    /// Sum over the band of the demodulated reference: products of the halves, and its pixels.
    pub(super) flatness: (f64, u64),
    /// Changes of the lamps.
    pub(super) changes: Vec<Change>,
    /// Mean square of the reference's own change in each band, which holds twice its noise's variance, where there is
    /// one reference: fine band, blotches at lag 1, at lag 4.
    pub(super) own_change: Option<[Option<f64>; 3]>,
}

/// Of one frame.
#[derive(Debug)]
pub(super) struct FrameInstruments {
    pub scored: bool,
    /// P of the reference: one or two halves.
    pub p: Vec<Map>,
    pub previous: Previous,
    pub flags: Vec<u8>,
    pub age: Vec<u8>,
    /// Predictors on each half; empty for warm-up.
    pub predictors: Vec<Vec<Row>>,
    pub demodulation: Option<Demodulation>,
}

impl FrameInstruments {
    /// Whether errors at a pixel may count as blotches: it shows a surface away from edges that has not just come into view.
    pub fn is_calm(&self, i: usize) -> bool {
        self.flags[i] & (flag::SURFACE | flag::EDGE) == flag::SURFACE && !is_fresh(self.age[i], FRESH_FRAMES)
    }

    pub fn has(&self, i: usize, flags: u8) -> bool {
        self.flags[i] & flags == flags
    }
}

/// What parts the indirect light from the composite.
#[derive(Debug)]
pub(super) struct Demodulation {
    /// Luminance of the frame's direct term.
    pub direct: Map,
    /// Luminance of the references' direct term: the mean of their halves.
    pub reference_direct: Map,
    /// Luminance of the albedo: both weights, at most 1.
    pub albedo: Map,
    /// Which pixels show the same surface; for scored frames.
    pub surfaces: Option<Kept>,
    /// The band of the demodulated reference, for each half.
    pub bands: Vec<Map>,
}

impl Instruments {
    /// Reads the references of a sequence, in order. Where some frames have no half B, no half B is used.
    ///
    /// # Errors
    /// [`Error::Empty`] without frames or where no surface is lit, [`Error::Size`] where pictures differ in extent,
    /// [`Error::Quell`] for guides or cameras that cannot be used.
    pub fn new(frames: &[ReferenceFrame<'_>]) -> Result<Self, Error> {
        let first = frames.first().ok_or_else(|| Error::Empty { what: "the sequence has no frame".to_owned() })?;
        let size = first.a.size();
        for f in frames {
            check(f, size)?;
        }
        let radii = Radii::of(size);
        let halves = frames.iter().all(|f| f.b.is_some());
        let k = scale(frames)?;
        let static_sequence = frames.iter().skip(1).all(|f| is_static(f.frame));

        let mut made = Vec::with_capacity(frames.len());
        let mut edges = Vec::with_capacity(frames.len());
        let mut before: Option<(Surfaces<'_>, Vec<u8>)> = None;
        for f in frames {
            let surfaces = Surfaces::new(f.frame)?;
            let age = ages(&surfaces, before.as_ref().map(|(s, a)| (s, a.as_slice())));
            let near = dilated(&surfaces.edges(), radii.px(EDGE_RADIUS));
            let flags = (0..size.pixels())
                .map(|i| {
                    let mut flags = 0;
                    if surfaces.is_surface(i) {
                        flags |= flag::SURFACE;
                        if before.is_some() && age[i] > 0 {
                            flags |= flag::SEEN;
                        }
                    }
                    flags | if near.data()[i] { flag::EDGE } else { 0 }
                })
                .collect();
            let pictures: Vec<&Plane<Rgb>> = std::iter::once(f.a).chain(f.b.filter(|_| halves)).collect();
            made.push(FrameInstruments {
                scored: f.scored,
                p: pictures.iter().map(|picture| perceived(picture, k)).collect(),
                previous: previous(&surfaces),
                flags,
                age: age.clone(),
                predictors: Vec::new(),
                demodulation: None,
            });
            edges.push(near);
            before = Some((surfaces, age));
        }
        drop(before);

        let mut instruments = Self {
            size,
            radii,
            k,
            halves,
            static_sequence,
            frames: made,
            sums: Sums::default(),
            flatness: (0.0, 0),
            changes: Vec::new(),
            own_change: None,
        };
        instruments.predict(frames)?;
        instruments.demodulate(frames);
        instruments.changes = changes(&instruments);
        if !halves {
            instruments.own_change = Some(instruments.own_change());
        }
        Ok(instruments)
    }

    /// Whether the references have two independent halves.
    pub fn has_halves(&self) -> bool {
        self.halves
    }

    /// Whether nothing moves: neither camera nor surfaces.
    pub fn is_static(&self) -> bool {
        self.static_sequence
    }

    /// The predictors of every scored frame, and the quiet pixels.
    fn predict(&mut self, frames: &[ReferenceFrame<'_>]) -> Result<(), Error> {
        let previous: Vec<&Previous> = self.frames.iter().map(|f| &f.previous).collect();
        let halves = self.frames.first().map_or(0, |f| f.p.len());
        let p: Vec<Vec<&Map>> = (0..halves).map(|h| self.frames.iter().map(|f| &f.p[h]).collect()).collect();
        let radii = self.radii;
        let found: Vec<(usize, Vec<Vec<Row>>, Map, Map)> = (0..self.frames.len())
            .filter(|&t| frames[t].scored)
            .map(|t| {
                let surfaces = Surfaces::new(frames[t].frame)?;
                let own: Vec<&Map> = p.iter().map(|p| p[t]).collect();
                let smooth = edge_stopping(&surfaces, &own, &[FINE, 5.0, 6.0]);
                let past = stale(&previous, &p, t);
                let flags = &self.frames[t].flags;
                // Pixels are chosen on half A, for both halves alike.
                let staleness = mapped(&radii.gaussian(&difference(&past[0], own[0]), FINE), f32::abs);
                let rows = (0..halves)
                    .into_par_iter()
                    .map(|h| {
                        let plain = radii.gaussian(own[h], 6.0);
                        (0..flags.len())
                            .map(|i| {
                                let p = own[h].data()[i];
                                let [e15, e5, e6] = [0, 1, 2].map(|s| smooth[h][s].data()[i]);
                                let near = flags[i] & flag::EDGE != 0;
                                [
                                    e15 - p,
                                    e5 - e15,
                                    if near { plain.data()[i] - e6 } else { 0.0 },
                                    if staleness.data()[i] > STALE { past[h].data()[i] - p } else { 0.0 },
                                ]
                            })
                            .collect()
                    })
                    .collect();
                let detail = radii.fine(own[0]);
                let local = mapped(&radii.gaussian(&mapped(&detail, |v| v * v), LOCAL), |v| v.max(0.0).sqrt());
                let disturbing = mapped(&staleness, |v| if v > DISTURBING { v } else { 0.0 });
                let mut disturbed = radii.gaussian(&disturbing, 6.0);
                let age = &self.frames[t].age;
                let fresh = Plane::from_fn(self.size, |x, y| is_fresh(age[y * self.size.width + x], FRESH_FRAMES));
                for (v, near) in disturbed.data_mut().iter_mut().zip(dilated(&fresh, radii.px(EDGE_RADIUS)).data()) {
                    if *near {
                        *v = f32::INFINITY;
                    }
                }
                Ok((t, rows, local, disturbed))
            })
            .collect::<Result<_, Error>>()?;
        drop((previous, p));

        let candidate = |f: &FrameInstruments, i: usize| f.flags[i] & (flag::SURFACE | flag::EDGE) == flag::SURFACE;
        let mut calm: Vec<f32> = Vec::new();
        for (t, _, local, _) in &found {
            let frame = &self.frames[*t];
            calm.extend((0..local.data().len()).filter(|&i| candidate(frame, i)).map(|i| local.data()[i]));
        }
        let middle = calm.len() / 2;
        let median = if calm.is_empty() { 0.0 } else { *calm.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let mut sums = Sums::default();
        for (t, rows, local, disturbed) in found {
            for i in 0..local.data().len() {
                if candidate(&self.frames[t], i) && local.data()[i] <= median && disturbed.data()[i] < DISTURBED {
                    self.frames[t].flags[i] |= flag::QUIET;
                }
                if self.frames[t].has(i, flag::SURFACE)
                    && let (Some(a), Some(b)) = (rows.first(), rows.last())
                {
                    let near = self.frames[t].has(i, flag::EDGE);
                    sums.add(&fit::columns(&a[i], near), &fit::columns(&b[i], near), COVERING);
                }
            }
            self.frames[t].predictors = rows;
        }
        self.sums = sums;
        Ok(())
    }

    /// Parts the indirect light from the references, where the frames hold direct light and weights.
    fn demodulate(&mut self, frames: &[ReferenceFrame<'_>]) {
        let (k, two) = (self.k, self.halves);
        self.frames.par_iter_mut().zip(frames).for_each(|(own, given)| {
            let frame = given.frame;
            let Some(direct) = frame.direct.as_ref() else { return };
            if frame.matte_weight.is_none() && frame.glossy_weight.is_none() {
                return;
            }
            let weight = |p: &Option<Plane<Rgb>>, i: usize| p.as_ref().map_or([0.0; 3], |p| p.data()[i]);
            let size = direct.size();
            let albedo = Plane::from_fn(size, |x, y| {
                let i = y * size.width + x;
                let (m, g) = (weight(&frame.matte_weight, i), weight(&frame.glossy_weight, i));
                luminance(std::array::from_fn(|c| (m[c] + g[c]).clamp(0.0, 1.0)))
            });
            for i in 0..size.pixels() {
                if own.flags[i] & flag::SURFACE != 0 && albedo.data()[i] > LEAST_ALBEDO {
                    own.flags[i] |= flag::REFLECTS;
                }
            }
            let directs: Vec<Map> = std::iter::once(given.a_direct)
                .chain(two.then_some(given.b_direct))
                .map(|d| light(d.unwrap_or(direct)))
                .collect();
            let mut demodulation = Demodulation {
                direct: light(direct),
                reference_direct: Map::filled(size, 0.0),
                albedo,
                surfaces: own.scored.then(|| Kept::new(frame)),
                bands: Vec::new(),
            };
            if let Some(surfaces) = demodulation.surfaces.as_ref().and_then(Kept::surfaces) {
                let mask = mask(own);
                let band = |(p, direct): (&Map, &Map)| {
                    let picture = mapped(p, |p| (p.exp2() - 1.0) / k);
                    surface_band(&surfaces, &demodulated(k, &picture, direct, &demodulation.albedo), &mask)
                };
                demodulation.bands = own.p.iter().zip(&directs).map(band).collect();
            }
            let share = 1.0 / directs.len().max(1) as f32;
            for d in &directs {
                demodulation.reference_direct = combined(&demodulation.reference_direct, d, |sum, v| sum + share * v);
            }
            own.demodulation = Some(demodulation);
        });
        let (mut sum, mut pixels) = (0.0, 0);
        for frame in &self.frames {
            let Some(demodulation) = &frame.demodulation else { continue };
            let (Some(a), Some(b)) = (demodulation.bands.first(), demodulation.bands.last()) else { continue };
            for i in (0..frame.flags.len()).filter(|&i| frame.has(i, flag::REFLECTS)) {
                pixels += 1;
                sum += f64::from(a.data()[i]) * f64::from(b.data()[i]);
            }
        }
        self.flatness = (sum, pixels);
    }

    /// Mean squares over the quiet pixels of how the reference itself changes: its noise, and true changes of light.
    fn own_change(&self) -> [Option<f64>; 3] {
        let fine: Vec<Map> = self.frames.iter().map(|f| self.radii.fine(&f.p[0])).collect();
        let blotches: Vec<Map> = self.frames.iter().map(|f| self.radii.blotches(&f.p[0])).collect();
        [(&fine, 1), (&blotches, 1), (&blotches, 4)].map(|(maps, lag)| {
            let (mut sum, mut count) = (0.0, 0u64);
            for t in 0..self.frames.len() {
                self.each_returned(t, lag, |i, place| {
                    let change = f64::from(maps[t].data()[i] - cubic(&maps[t - lag], place));
                    sum += change * change;
                    count += 1;
                });
            }
            (count > 0).then(|| sum / count as f64)
        })
    }

    /// Calls `f(pixel, coordinate in frame t - lag)` for the quiet pixels of a scored frame whose surface has been in
    /// view all along.
    pub(super) fn each_returned(&self, t: usize, lag: usize, mut f: impl FnMut(usize, glam::Vec2)) {
        if t < lag || !self.frames[t].scored {
            return;
        }
        let previous: Vec<&Previous> = self.frames.iter().map(|f| &f.previous).collect();
        let frame = &self.frames[t];
        for i in (0..frame.flags.len()).filter(|&i| frame.has(i, flag::QUIET | flag::SEEN)) {
            // A surface that has been in view for `lag` frames has an age of at least that.
            if usize::from(frame.age[i]) >= lag
                && let Some(place) = back(&previous, t, i).nth(lag - 1)
            {
                f(i, place);
            }
        }
    }
}

/// 1 where the surface can be demodulated, else 0.
pub(super) fn mask(frame: &FrameInstruments) -> Map {
    let size = frame.previous.size();
    Plane::from_fn(size, |x, y| if frame.has(y * size.width + x, flag::REFLECTS) { 1.0 } else { 0.0 })
}

/// Whether this frame's guides say that nothing moved since the frame before.
fn is_static(frame: &FrameBuf) -> bool {
    frame.camera.clip_from_world == frame.previous_camera.clip_from_world
        && frame.motion.as_ref().is_none_or(|m| m.data().iter().flatten().all(|v| v.is_nan() || v.abs() < 1e-3))
}

fn check(f: &ReferenceFrame<'_>, size: Size) -> Result<(), Error> {
    Error::same_size("guides", f.frame.size, size)?;
    for (what, plane) in [
        ("reference", Some(f.a)),
        ("half B of the reference", f.b),
        ("direct term of the reference", f.a_direct),
        ("direct term of half B", f.b_direct),
    ] {
        if let Some(plane) = plane {
            Error::same_size(what, plane.size(), size)?;
        }
    }
    Ok(())
}

/// Whether a pixel has come into view within the last `frames` frames.
pub(super) fn is_fresh(age: u8, frames: u8) -> bool {
    age != OLD && age <= frames
}
