//! Artefacts of known kind and strength, added to an independent rendering that is otherwise right. What the scorecard
//! answers to them says whether its definitions separate (docs/scorecard.md).

use super::bands::{Map, Radii, combined, dilated, edge_stopping};
use super::history::{Previous, previous};
use super::surfaces::{Surfaces, centre, cubic_rgb, footprint, pixel_at};
use crate::error::Error;
use glam::Vec2;
use quell::{FrameBuf, Plane, Rgb, Size};

/// What can be added. Strengths are given with each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Artefact {
    /// Noise that sticks to surfaces and moves with them; strength: rms in stops.
    FixedGrain,
    /// Noise that is new in every pixel of every frame; strength: rms in stops.
    FreshGrain,
    /// Blotches of sigma 6 px that are new in every frame; strength: rms in stops.
    FreshBlotches,
    /// Blotches of sigma 6 px of which 0.9 stay in the same pixel from frame to frame; strength: rms in stops.
    SlowBlotches,
    /// A blur of sigma 2 px that stops at edges; strength: its share.
    EdgeAwareBlur,
    /// A blur of sigma 4 px that ignores edges, within 6 px of them; strength: its share.
    BlurAcrossEdges,
    /// A history that never rejects: H_t = (1 - a) X_t + a H_(t-1), fetched by a cubic where motion says, X_t off
    /// screen; strength: a.
    BlindHistory,
    /// [`Artefact::FreshGrain`] where a surface has come into view within the last four frames.
    NoiseWhereFresh,
    /// Indirect light without its local contrast: I becomes I + a (G_6(I) - I) on each surface; strength: a.
    FlatIndirect,
}

impl Artefact {
    /// All of them; the first seven are those of the protocol.
    pub const ALL: [Self; 9] = [
        Self::FixedGrain,
        Self::FreshGrain,
        Self::FreshBlotches,
        Self::SlowBlotches,
        Self::EdgeAwareBlur,
        Self::BlurAcrossEdges,
        Self::BlindHistory,
        Self::NoiseWhereFresh,
        Self::FlatIndirect,
    ];

    /// As in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FixedGrain => "fixed grain",
            Self::FreshGrain => "fresh grain",
            Self::FreshBlotches => "fresh blotches",
            Self::SlowBlotches => "slow blotches",
            Self::EdgeAwareBlur => "edge-aware blur",
            Self::BlurAcrossEdges => "blur across edges",
            Self::BlindHistory => "blind history",
            Self::NoiseWhereFresh => "noise where fresh",
            Self::FlatIndirect => "flat indirect light",
        }
    }

    /// The score that is its own.
    pub const fn own_score(self) -> &'static str {
        match self {
            Self::FixedGrain => "noise",
            Self::FreshGrain => "flicker",
            Self::FreshBlotches => "boiling",
            Self::SlowBlotches => "slow_boiling",
            Self::EdgeAwareBlur => "blur",
            Self::BlurAcrossEdges => "smearing",
            Self::BlindHistory => "ghosting",
            Self::NoiseWhereFresh => "fresh_noise",
            Self::FlatIndirect => "flatness",
        }
    }
}

/// Frames for which a surface counts as fresh.
const FRESH_FRAMES: u8 = 4;
/// Size of a cell of fixed grain, pixels: as fine as can follow a surface without aliasing.
const CELL: f32 = 1.5;
/// Sigma of blotches, pixels at 225 rows.
const BLOTCH: f32 = 6.0;
/// What slow blotches keep from frame to frame.
const SLOW: f32 = 0.9;
/// Sigma of the blur that stops at edges, of the one that does not, and of flattening; the reach of edges. Pixels at 225
/// rows.
const BLUR: f32 = 2.0;
/// See [`BLUR`].
const BLUR_ACROSS: f32 = 4.0;
/// See [`BLUR`].
const FLATTENING: f32 = 6.0;
/// See [`BLUR`].
const EDGE_RADIUS: f32 = 6.0;
/// Albedo below which indirect light is left alone.
const LEAST_ALBEDO: f32 = 0.02;

/// Adds artefacts to the frames of one sequence.
pub struct Injector<'a> {
    frames: &'a [&'a FrameBuf],
    size: Size,
    previous: Vec<Previous>,
    ages: Vec<Vec<u8>>,
    seed: u64,
}

impl<'a> Injector<'a> {
    /// Reads the guides of a sequence, in order.
    ///
    /// # Errors
    /// [`Error::Empty`] without frames; [`Error::Size`], [`Error::Quell`] for guides that cannot be used.
    pub fn new(frames: &'a [&'a FrameBuf], seed: u64) -> Result<Self, Error> {
        let size = frames.first().ok_or_else(|| Error::Empty { what: "the sequence has no frame".to_owned() })?.size;
        let mut made = Self { frames, size, previous: Vec::new(), ages: Vec::new(), seed };
        let mut before: Option<Surfaces<'_>> = None;
        for frame in frames {
            Error::same_size("guides", frame.size, size)?;
            let surfaces = Surfaces::new(frame)?;
            let earlier = before.as_ref().zip(made.ages.last().map(Vec::as_slice));
            let ages = super::history::ages(&surfaces, earlier);
            made.previous.push(previous(&surfaces));
            made.ages.push(ages);
            before = Some(surfaces);
        }
        Ok(made)
    }

    /// The pictures with one artefact. `pictures`: one for each frame, scene-linear, right but for little noise.
    ///
    /// # Errors
    /// [`Error::Empty`] where the numbers of frames differ, [`Error::Size`].
    pub fn inject(&self, artefact: Artefact, strength: f32, pictures: &[Plane<Rgb>]) -> Result<Vec<Plane<Rgb>>, Error> {
        Ok(self.prepare(artefact, pictures)?.at(strength))
    }

    /// All that does not depend on the strength.
    ///
    /// # Errors
    /// As [`Injector::inject`].
    pub fn prepare<'p>(&'p self, artefact: Artefact, pictures: &'p [Plane<Rgb>]) -> Result<Prepared<'p>, Error> {
        if pictures.len() != self.frames.len() {
            let what = format!("{} pictures do not fit {} frames", pictures.len(), self.frames.len());
            return Err(Error::Empty { what });
        }
        for picture in pictures {
            Error::same_size("picture", picture.size(), self.size)?;
        }
        let all = || 0..pictures.len();
        let way = match artefact {
            Artefact::FixedGrain => Way::Stops(self.fixed_grain()),
            Artefact::FreshGrain => Way::Stops(all().map(|t| self.white(t)).collect()),
            Artefact::FreshBlotches => Way::Stops(all().map(|t| self.blotches(t)).collect()),
            Artefact::SlowBlotches => Way::Stops(self.slow_blotches()),
            Artefact::NoiseWhereFresh => Way::Stops(all().map(|t| self.white_where_fresh(t)).collect()),
            Artefact::EdgeAwareBlur => Way::Towards(self.blurred(pictures)?),
            Artefact::BlurAcrossEdges => Way::Towards(self.blurred_across(pictures)?),
            Artefact::FlatIndirect => Way::Towards(self.flattened(pictures)?),
            Artefact::BlindHistory => Way::History,
        };
        Ok(Prepared { injector: self, pictures, way })
    }

    fn white_where_fresh(&self, t: usize) -> Map {
        let mut field = self.white(t);
        for (v, age) in field.data_mut().iter_mut().zip(&self.ages[t]) {
            if !super::instruments::is_fresh(*age, FRESH_FRAMES) {
                *v = 0.0;
            }
        }
        field
    }

    fn white(&self, t: usize) -> Map {
        let width = self.size.width;
        Plane::from_fn(self.size, |x, y| normal(self.seed ^ 0xa5, [t as i64, (y * width + x) as i64, 0]))
    }

    fn blotches(&self, t: usize) -> Map {
        unit_variance(Radii::of(self.size).gaussian(&self.white(t), BLOTCH))
    }

    fn slow_blotches(&self) -> Vec<Map> {
        let mut fields: Vec<Map> = Vec::new();
        for t in 0..self.frames.len() {
            let new = self.blotches(t);
            fields.push(match fields.last() {
                None => new,
                Some(last) => combined(last, &new, |old, new| SLOW * old + (1.0 - SLOW * SLOW).sqrt() * new),
            });
        }
        fields
    }

    /// Each pixel carries the coordinate and the frame in which its surface came into view; grain is a smooth function of
    /// these, so that it is not resampled.
    fn fixed_grain(&self) -> Vec<Map> {
        let fresh = |i: usize, t: usize| (centre(self.size, i), t as i64);
        let mut born: Vec<(Vec2, i64)> = (0..self.size.pixels()).map(|i| fresh(i, 0)).collect();
        let mut fields = Vec::new();
        for t in 0..self.frames.len() {
            if t > 0 {
                born = (0..self.size.pixels())
                    .map(|i| {
                        let there = Vec2::from(self.previous[t].data()[i]);
                        if self.ages[t][i] == 0 || pixel_at(self.size, there).is_none() {
                            return fresh(i, t);
                        }
                        let taps = footprint(self.size, there);
                        let Some(best) = taps.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { return fresh(i, t) };
                        let (anchor, when) = born[best.0];
                        // One patch: interpolate the coordinate. Else go on from the nearest pixel.
                        let joint = taps.iter().all(|&(tap, w)| {
                            w == 0.0 || (born[tap].1 == when && (born[tap].0 - anchor).length() < 3.0)
                        });
                        if joint {
                            let total: f32 = taps.iter().map(|t| t.1).sum();
                            (taps.iter().map(|&(tap, w)| born[tap].0 * (w / total)).sum(), when)
                        } else {
                            (anchor + there - centre(self.size, best.0), when)
                        }
                    })
                    .collect();
            }
            fields.push(Plane::from_fn(self.size, |x, y| {
                let (place, when) = born[y * self.size.width + x];
                lattice(self.seed, place / CELL, when)
            }));
        }
        fields
    }

    fn blurred(&self, pictures: &[Plane<Rgb>]) -> Result<Vec<Plane<Rgb>>, Error> {
        let smooth = |(frame, picture): (&&FrameBuf, &Plane<Rgb>)| Ok(smoothed(&Surfaces::new(frame)?, picture, BLUR));
        self.frames.iter().zip(pictures).map(smooth).collect()
    }

    fn blurred_across(&self, pictures: &[Plane<Rgb>]) -> Result<Vec<Plane<Rgb>>, Error> {
        let radii = Radii::of(self.size);
        let mut out = Vec::new();
        for (frame, picture) in self.frames.iter().zip(pictures) {
            let near = dilated(&Surfaces::new(frame)?.edges(), radii.px(EDGE_RADIUS));
            let smooth = channels(picture).map(|c| radii.gaussian(&c, BLUR_ACROSS));
            out.push(Plane::from_fn(self.size, |x, y| {
                if near.at(x, y) { std::array::from_fn(|c| smooth[c].at(x, y)) } else { picture.at(x, y) }
            }));
        }
        Ok(out)
    }

    fn flattened(&self, pictures: &[Plane<Rgb>]) -> Result<Vec<Plane<Rgb>>, Error> {
        let zero = [0.0; 3];
        let mut out = Vec::new();
        for (frame, picture) in self.frames.iter().zip(pictures) {
            let at = |p: &Option<Plane<Rgb>>, i: usize| p.as_ref().map_or(zero, |p| p.data()[i]);
            let albedo = |i: usize| -> Rgb {
                let (m, g) = (at(&frame.matte_weight, i), at(&frame.glossy_weight, i));
                std::array::from_fn(|c| (m[c] + g[c]).clamp(0.0, 1.0))
            };
            let width = self.size.width;
            let indirect = Plane::from_fn(self.size, |x, y| {
                let i = y * width + x;
                let (p, d, a) = (picture.at(x, y), at(&frame.direct, i), albedo(i));
                std::array::from_fn(|c| if a[c] > LEAST_ALBEDO { (p[c] - d[c]) / a[c] } else { 0.0 })
            });
            let smooth = smoothed(&Surfaces::new(frame)?, &indirect, FLATTENING);
            out.push(Plane::from_fn(self.size, |x, y| {
                let i = y * width + x;
                let (p, a, own, smooth) = (picture.at(x, y), albedo(i), indirect.at(x, y), smooth.at(x, y));
                std::array::from_fn(|c| p[c] + a[c] * (smooth[c] - own[c]))
            }));
        }
        Ok(out)
    }
}

enum Way {
    /// Light times 2 to the field times the strength.
    Stops(Vec<Map>),
    /// Part of the way to these pictures.
    Towards(Vec<Plane<Rgb>>),
    /// Depends on all frames before.
    History,
}

/// An artefact ready to be added at any strength.
pub struct Prepared<'a> {
    injector: &'a Injector<'a>,
    pictures: &'a [Plane<Rgb>],
    way: Way,
}

impl Prepared<'_> {
    /// The pictures with the artefact at this strength (see [`Artefact`]).
    pub fn at(&self, strength: f32) -> Vec<Plane<Rgb>> {
        match &self.way {
            Way::Stops(fields) => self.pictures.iter().zip(fields).map(|(p, f)| scaled(p, f, strength)).collect(),
            Way::Towards(ends) => {
                let part = |(p, end): (&Plane<Rgb>, &Plane<Rgb>)| {
                    let size = p.size();
                    Plane::from_fn(size, |x, y| mixed(p.at(x, y), end.at(x, y), strength))
                };
                self.pictures.iter().zip(ends).map(part).collect()
            }
            Way::History => self.history(strength),
        }
    }

    fn history(&self, strength: f32) -> Vec<Plane<Rgb>> {
        let size = self.injector.size;
        let mut out: Vec<Plane<Rgb>> = Vec::new();
        for (t, picture) in self.pictures.iter().enumerate() {
            let next = match out.last() {
                None => picture.clone(),
                Some(last) => Plane::from_fn(size, |x, y| {
                    let there = Vec2::from(self.injector.previous[t].at(x, y));
                    match pixel_at(size, there) {
                        Some(_) => mixed(picture.at(x, y), cubic_rgb(last, there).map(|v| v.max(0.0)), strength),
                        None => picture.at(x, y),
                    }
                }),
            };
            out.push(next);
        }
        out
    }
}

/// Every channel through the edge-stopping Gaussian.
fn smoothed(surfaces: &Surfaces<'_>, picture: &Plane<Rgb>, sigma: f32) -> Plane<Rgb> {
    let channels = channels(picture);
    let smooth = edge_stopping(surfaces, &[&channels[0], &channels[1], &channels[2]], &[sigma]);
    let width = picture.size().width;
    Plane::from_fn(picture.size(), |x, y| std::array::from_fn(|c| smooth[c][0].data()[y * width + x]))
}

fn channels(picture: &Plane<Rgb>) -> [Map; 3] {
    std::array::from_fn(|c| Plane::from_fn(picture.size(), |x, y| picture.at(x, y)[c]))
}

fn mixed(a: Rgb, b: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|c| a[c] + share * (b[c] - a[c]))
}

fn scaled(picture: &Plane<Rgb>, field: &Map, strength: f32) -> Plane<Rgb> {
    Plane::from_fn(picture.size(), |x, y| {
        let factor = (strength * field.at(x, y)).exp2();
        picture.at(x, y).map(|v| v * factor)
    })
}

fn unit_variance(map: Map) -> Map {
    let n = map.data().len().max(1) as f64;
    let mean = map.data().iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let variance = map.data().iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
    let scale = (1.0 / variance.max(1e-30).sqrt()) as f32;
    super::bands::mapped(&map, |v| (v - mean as f32) * scale)
}

/// A well-mixed number of a few integers (the finaliser of SplitMix64, Steele et al. 2014).
fn hash(seed: u64, key: [i64; 3]) -> u64 {
    key.into_iter().fold(seed, |state, k| {
        let mut z = (state ^ k as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// A normal deviate (Box and Muller), the same for the same key.
fn normal(seed: u64, key: [i64; 3]) -> f32 {
    let bits = hash(seed, key);
    let u = ((bits >> 40) as f32 + 1.0) / (1u64 << 24) as f32;
    let v = ((bits & 0xff_ffff) as f32) / (1u64 << 24) as f32;
    (-2.0 * u.ln()).sqrt() * (std::f32::consts::TAU * v).cos()
}

/// Smooth noise of about unit variance: normal deviates on the integer lattice, interpolated by a cubic.
fn lattice(seed: u64, place: Vec2, when: i64) -> f32 {
    let corner = place.floor();
    let t = place - corner;
    // The B-spline's weights: smooth, positive; the sum of squares on average is 0.2297 in two dimensions.
    let weights = |t: f32| {
        let s = 1.0 - t;
        [
            s * s * s / 6.0,
            (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
            (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
            t * t * t / 6.0,
        ]
    };
    let (wx, wy) = (weights(t.x), weights(t.y));
    let mut sum = 0.0;
    for (j, wy) in wy.iter().enumerate() {
        for (i, wx) in wx.iter().enumerate() {
            let key = [corner.x as i64 + i as i64, corner.y as i64 + j as i64, when];
            sum += wx * wy * normal(seed ^ 0x5a, key);
        }
    }
    sum / 0.2297f32.sqrt()
}
