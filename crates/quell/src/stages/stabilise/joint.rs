//! The net's form of the stage, row by row.

use super::cpu::Track;
use super::{
    Bandwidths, PARTS, Signature, StabiliseFrame, TAPS_AROUND, TAPS_IN_TIME, albedo_around, bandwidths, normal_at,
};
use crate::frame::Rgb;
use crate::kernels::lanes::{BLOCK, exp2, inside, load, whole};
use crate::kernels::math::three;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Gather, Stabilise};
use crate::stages::blend::BlendFrame;
use crate::stages::blend::cpu::{Band, PictureNoise, around as blend_around, bands, mean_colours};
use crate::window::Features;
use fearless_simd::{Simd, dispatch, f32x4, f32x16, prelude::*};
use std::ops::Range;

/// As [`super::reference::signature`].
pub(crate) fn signature(features: &Features, picture: &Plane<Rgb>) -> Plane<Signature> {
    let size = picture.size();
    let w = size.width;
    let mut out = Plane::filled(size, [0.0; super::SIGNATURE]);
    for rows in bands(size.height) {
        let wide = mean_colours(picture, super::WIDE, &rows);
        par::rows(&mut out.data_mut()[rows.start * w..rows.end * w], w, |y, row| {
            let y = rows.start + y;
            for (x, value) in row.iter_mut().enumerate() {
                let normal = normal_around(features, x, y);
                let albedo = albedo_around(features, y * w + x);
                let parts = [binomial(picture, x, y), wide.colour(x, y, 0), albedo, normal];
                for (part, v) in parts.into_iter().enumerate() {
                    value[3 * part..3 * part + 3].copy_from_slice(&v);
                }
            }
        });
    }
    out
}

/// As [`super::reference::run`] with the net.
pub(crate) fn run(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    gather: &Gather,
    settings: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    let here = &window[centre];
    let size = here.picture.size();
    let w = size.width;
    let mut out = here.picture.clone();
    let has_alpha = has_alpha(window);
    let mut coverage = Plane::filled(if has_alpha { size } else { Size::new(0, 0) }, 0.0);
    for rows in bands(size.height) {
        let joint = Joint::new(window, centre, gather, settings, rows.clone());
        let pixels = rows.start * w..rows.end * w;
        let out = &mut out.data_mut()[pixels.clone()];
        if has_alpha {
            par::two_rows(out, w, &mut coverage.data_mut()[pixels], w, |y, row, coverage| {
                dispatch!(crate::simd::level(), simd => joint.row(simd, rows.start + y, row, coverage));
            });
        } else {
            par::rows(out, w, |y, row| {
                dispatch!(crate::simd::level(), simd => joint.row(simd, rows.start + y, row, &mut []));
            });
        }
    }
    (out, if has_alpha { Some(coverage) } else { here.alpha.cloned() })
}

/// Coverage is averaged too: every frame has it.
fn has_alpha(window: &[StabiliseFrame<'_>]) -> bool {
    window.iter().all(|f| f.alpha.is_some())
}

/// Some rows of a picture, its neighbours in time, and what its pixels are compared by.
pub(crate) struct Joint<'a> {
    window: &'a [StabiliseFrame<'a>],
    centre: usize,
    has_alpha: bool,
    gather: &'a Gather,
    settings: &'a Stabilise,
    noise: PictureNoise,
    /// Mean over 5x5 of the input.
    input: Band,
    /// Channel by channel, of the rows around, too: signatures, colours, coverage where it is averaged.
    around: Band,
}

/// Where colours and coverage lie in [`Joint::around`].
const COLOUR: usize = super::SIGNATURE;
const COVERAGE: usize = COLOUR + 3;

impl<'a> Joint<'a> {
    pub(crate) fn new(
        window: &'a [StabiliseFrame<'a>],
        centre: usize,
        gather: &'a Gather,
        settings: &'a Stabilise,
        rows: Range<usize>,
    ) -> Self {
        let frames: Vec<_> = window.iter().map(BlendFrame::from).collect();
        let here = &window[centre];
        let size = here.picture.size();
        let w = size.width;
        let alpha = here.alpha.filter(|_| has_alpha(window));
        let channels = COVERAGE + usize::from(alpha.is_some());
        let around = Band::filled(&blend_around(&rows, TAPS_AROUND, size.height), w, channels, |y, out| {
            let mut set = |c: usize, x: usize, value: f32| out[c * w + x] = value;
            for (x, signature) in here.signature.map_or(&[][..], |plane| plane.row(y)).iter().enumerate() {
                signature.iter().enumerate().for_each(|(c, value)| set(c, x, *value));
            }
            for (x, colour) in here.picture.row(y).iter().enumerate() {
                colour.iter().enumerate().for_each(|(c, value)| set(COLOUR + c, x, *value));
            }
            if let Some(alpha) = alpha {
                alpha.row(y).iter().enumerate().for_each(|(x, value)| set(COVERAGE, x, *value));
            }
        });
        Self {
            around,
            window,
            centre,
            has_alpha: has_alpha(window),
            gather,
            settings,
            input: mean_colours(window[centre].input, super::WIDE, &rows),
            noise: PictureNoise::new(&frames, centre, window[centre].picture, gather, rows),
        }
    }

    #[inline(always)]
    fn row<S: Simd>(&self, simd: S, y: usize, row: &mut [Rgb], coverage: &mut [f32]) {
        let here = &self.window[self.centre];
        let w = row.len();
        let Some(signatures) = here.signature else { return };
        let mut bandwidths_of = [Bandwidths::default(); BLOCK];
        for x in (0..w).step_by(BLOCK) {
            let count = BLOCK.min(w - x);
            let mut lanes = [[0.0; BLOCK]; PARTS + 1];
            for i in 0..count {
                let found = bandwidths(&self.noise.at(x + i, y, here.features, self.settings.nearer));
                for k in 0..PARTS {
                    lanes[k][i] = found.parts[0][k];
                }
                lanes[PARTS][i] = found.offset[0];
                bandwidths_of[i] = found;
            }
            let reach = TAPS_AROUND as isize;
            let sums = if whole(x as isize - reach, w) && whole(x as isize + reach, w) {
                self.sums_around::<false, _>(simd, (x, y), &lanes)
            } else {
                self.sums_around::<true, _>(simd, (x, y), &lanes)
            };
            for i in 0..count {
                let mut own = signatures.at(x + i, y);
                own[super::INPUT].copy_from_slice(&self.input.colour(x + i, y, 0));
                let mut sums = Sums {
                    joint: self,
                    simd,
                    bandwidths: Fours::new(simd, &bandwidths_of[i]),
                    own: here.picture.at(x + i, y),
                    own_alpha: here.alpha.map_or(0.0, |a| a.at(x + i, y)),
                    colour: [sums[0][i], sums[1][i], sums[2][i]],
                    alpha: sums[3][i],
                    total: sums[4][i],
                    waiting: 0,
                    powers: [0.0; TAPS],
                    places: [(0, 0); TAPS],
                };
                self.taps_in_time(x + i, y, &own, &mut sums);
                sums.add();
                let Sums { colour, alpha, total, own, own_alpha, .. } = sums;
                row[x + i] = three(|k| own[k] + colour[k] / total);
                if let Some(coverage) = coverage.get_mut(x + i) {
                    *coverage = own_alpha + alpha / total;
                }
            }
        }
    }

    /// Of sixteen pixels the sums over the pixels around them: colours, coverage and weights. `lanes`: bandwidths of the parts and of the
    /// distance.
    #[inline(always)]
    fn sums_around<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (x, y): (usize, usize),
        lanes: &[[f32; BLOCK]; PARTS + 1],
    ) -> [[f32; BLOCK]; 5] {
        let here = &self.window[self.centre];
        let (w, h) = (here.features.size.width, here.features.size.height);
        let zero = f32x16::splat(simd, 0.0);
        let mut own = [zero; super::SIGNATURE];
        for c in 0..super::SIGNATURE {
            let row = if super::INPUT.contains(&c) {
                self.input.row(y, c - super::INPUT.start)
            } else {
                self.around.row(y, c)
            };
            own[c] = load::<EDGE, _>(simd, row, x as isize);
        }
        let mut parts = [zero; PARTS];
        for k in 0..PARTS {
            parts[k] = f32x16::from_slice(simd, &lanes[k]);
        }
        let by_distance = f32x16::from_slice(simd, &lanes[PARTS]);
        let mut own_colour = [zero; 4];
        let channels = if self.has_alpha { 4 } else { 3 };
        for c in 0..channels {
            own_colour[c] = load::<EDGE, _>(simd, self.around.row(y, COLOUR + c), x as isize);
        }
        let (mut sums, mut total) = ([zero; 4], f32x16::splat(simd, 1.0));
        let r = TAPS_AROUND as isize;
        for dy in -r..=r {
            let qy = y as isize + dy;
            if qy < 0 || qy >= h as isize {
                continue;
            }
            for dx in -r..=r {
                if (dx, dy) == (0, 0) {
                    continue;
                }
                let at = |c: usize| load::<EDGE, _>(simd, self.around.row(qy as usize, c), x as isize + dx);
                // The order of `distance`.
                let mut squares = [zero; super::SIGNATURE];
                for c in 0..super::SIGNATURE {
                    let d = own[c] - at(c);
                    squares[c] = parts[c / 3] * (d * d);
                }
                let mut four = [zero; 4];
                for k in 0..4 {
                    four[k] = squares[k] + squares[k + 4] + squares[k + 8];
                }
                let distance = (four[0] + four[2]) + (four[1] + four[3]);
                let offset = (dx * dx + dy * dy) as f32;
                let weight = exp2(simd, -(distance + by_distance * offset));
                if EDGE {
                    let inside: f32x16<S> = inside(x as isize + dx, w).simd_into(simd);
                    let inside = inside.simd_gt(zero);
                    for c in 0..channels {
                        sums[c] += inside.select(weight * (at(COLOUR + c) - own_colour[c]), zero);
                    }
                    total += inside.select(weight, zero);
                } else {
                    for c in 0..channels {
                        sums[c] += weight * (at(COLOUR + c) - own_colour[c]);
                    }
                    total += weight;
                }
            }
        }
        let mut found = [[0.0; BLOCK]; 5];
        for (found, sum) in found.iter_mut().zip(sums.into_iter().chain([total])) {
            sum.store_slice(found);
        }
        found
    }

    /// Visits the pixels around and those of other frames, but for the pixel itself.
    #[cfg(feature = "internals")]
    fn taps(&self, x: usize, y: usize, visitor: &mut impl Visit) {
        let here = &self.window[self.centre];
        let (w, h) = (here.features.size.width, here.features.size.height);
        let Some(signatures) = here.signature else { return };
        let mut own = signatures.at(x, y);
        own[super::INPUT].copy_from_slice(&self.input.colour(x, y, 0));
        let r = TAPS_AROUND;
        for qy in y.saturating_sub(r)..(y + r + 1).min(h) {
            for qx in x.saturating_sub(r)..(x + r + 1).min(w) {
                if (qx, qy) != (x, y) {
                    let (dx, dy) = (qx as f32 - x as f32, qy as f32 - y as f32);
                    let (pixel, offset) = (qy * w + qx, dx * dx + dy * dy);
                    let signature = &signatures.data()[pixel];
                    visitor.visit(&own, Tap { frame: self.centre, pixel, signature, offset, away: 0 });
                }
            }
        }
        self.taps_in_time(x, y, &own, visitor);
    }

    /// Visits the pixels of other frames.
    #[inline(always)]
    fn taps_in_time(&self, x: usize, y: usize, own: &Signature, visitor: &mut impl Visit) {
        let here = &self.window[self.centre];
        let w = here.features.size.width;
        for forward in [false, true] {
            if forward && !self.gather.future {
                continue;
            }
            let ahead = if forward { self.window.len() - 1 - self.centre } else { self.centre };
            let mut track = Track::new(here.features, x, y, self.gather, self.settings);
            for away in 1..=ahead.min(self.settings.frames as usize) {
                let (from, frame) = if forward {
                    (self.centre + away - 1, self.centre + away)
                } else {
                    (self.centre + 1 - away, self.centre - away)
                };
                let other = &self.window[frame];
                let Some(_) = track.step(self.window[from].features, other.features, forward) else { break };
                let Some(signatures) = other.signature else { break };
                let (cx, cy) = (track.at.0.round() as isize, track.at.1.round() as isize);
                let r = TAPS_IN_TIME as isize;
                for qy in cy - r..=cy + r {
                    let Some(row) = other.features.row_here(qy) else { continue };
                    for qx in (cx - r).max(0)..=(cx + r).min(w as isize - 1) {
                        let (dx, dy) = (qx as f32 - track.at.0, qy as f32 - track.at.1);
                        let (pixel, offset) = (row * w + qx as usize, dx * dx + dy * dy);
                        let signature = &signatures.data()[pixel];
                        visitor.visit(own, Tap { frame, pixel, signature, offset, away });
                    }
                }
            }
        }
    }
}

/// Hears of the taps of a pixel. A closure would be compiled apart from the loop, for narrow vectors.
trait Visit {
    fn visit(&mut self, own: &Signature, tap: Tap<'_>);
}

#[cfg(feature = "internals")]
impl<F: FnMut(&Signature, Tap<'_>)> Visit for F {
    fn visit(&mut self, own: &Signature, tap: Tap<'_>) {
        self(own, tap);
    }
}

/// Taps whose weights are found together.
const TAPS: usize = 64;

/// Weighted sums of differences from a pixel.
struct Sums<'j, S: Simd> {
    joint: &'j Joint<'j>,
    simd: S,
    bandwidths: Fours<S>,
    own: Rgb,
    own_alpha: f32,
    colour: Rgb,
    alpha: f32,
    total: f32,
    /// Taps that are not added yet: logarithms of their weights, frames and pixels.
    waiting: usize,
    powers: [f32; TAPS],
    places: [(u32, u32); TAPS],
}

impl<S: Simd> Sums<'_, S> {
    /// Adds those that wait, in the order in which they came.
    #[inline(always)]
    fn add(&mut self) {
        let simd = self.simd;
        for powers in self.powers.as_chunks_mut::<BLOCK>().0.iter_mut().take(self.waiting.div_ceil(BLOCK)) {
            exp2(simd, f32x16::from_slice(simd, powers)).store_slice(powers);
        }
        for (weight, (frame, pixel)) in self.powers.iter().zip(&self.places).take(self.waiting) {
            let other = &self.joint.window[*frame as usize];
            let c = other.picture.data()[*pixel as usize];
            for k in 0..3 {
                self.colour[k] += weight * (c[k] - self.own[k]);
            }
            if let (true, Some(alpha)) = (self.joint.has_alpha, other.alpha) {
                self.alpha += weight * (alpha.data()[*pixel as usize] - self.own_alpha);
            }
            self.total += weight;
        }
        self.waiting = 0;
    }
}

/// The bandwidths of taps in other frames: four numbers of a signature at once.
struct Fours<S: Simd> {
    parts: [f32x4<S>; super::SIGNATURE / 4],
    offset: f32,
    away: f32,
}

impl<S: Simd> Fours<S> {
    #[inline(always)]
    fn new(simd: S, b: &Bandwidths) -> Self {
        let [p, q, r, s] = b.parts[1];
        let of = |four: [f32; 4]| -> f32x4<S> { four.simd_into(simd) };
        Self { parts: [of([p, p, p, q]), of([q, q, r, r]), of([r, s, s, s])], offset: b.offset[1], away: b.away }
    }

    /// As [`super::tap_power`], in its order.
    #[inline(always)]
    fn power(&self, simd: S, own: &Signature, tap: &Tap<'_>) -> f32 {
        let (own, other) = (own.as_chunks::<4>().0, tap.signature.as_chunks::<4>().0);
        let mut squares = self.parts;
        for k in 0..squares.len() {
            let d = f32x4::from_slice(simd, &own[k]) - f32x4::from_slice(simd, &other[k]);
            squares[k] *= d * d;
        }
        let four: [f32; 4] = (squares[0] + squares[1] + squares[2]).into();
        let distance = (four[0] + four[2]) + (four[1] + four[3]);
        -(distance + self.offset * tap.offset + self.away * (tap.away - 1) as f32)
    }
}

impl<S: Simd> Visit for Sums<'_, S> {
    #[inline(always)]
    fn visit(&mut self, own: &Signature, tap: Tap<'_>) {
        if self.waiting == TAPS {
            self.add();
        }
        self.powers[self.waiting] = self.bandwidths.power(self.simd, own, &tap);
        self.places[self.waiting] = (tap.frame as u32, tap.pixel as u32);
        self.waiting += 1;
    }
}

/// A pixel that is compared with another.
pub(crate) struct Tap<'a> {
    pub frame: usize,
    pub pixel: usize,
    pub signature: &'a Signature,
    /// Squared distance in pixels from where it should lie.
    pub offset: f32,
    /// Frames between.
    pub away: usize,
}

/// Mean over 3x3 of what lies in the picture.
fn normal_around(features: &Features, x: usize, y: usize) -> [f32; 3] {
    let (w, h) = (features.size.width, features.size.height);
    let (mut sum, mut n) = ([0.0f32; 3], 0.0f32);
    for qy in y.saturating_sub(1)..(y + 2).min(h) {
        for qx in x.saturating_sub(1)..(x + 2).min(w) {
            let normal = normal_at(features, qy * w + qx);
            for k in 0..3 {
                sum[k] += normal[k];
            }
            n += 1.0;
        }
    }
    sum.map(|v| v / n)
}

/// Binomial 3x3; beyond the border the border counts.
fn binomial(plane: &Plane<Rgb>, x: usize, y: usize) -> Rgb {
    let size = plane.size();
    let around = |v: usize, extent: usize| [v.saturating_sub(1), v, (v + 1).min(extent - 1)];
    let (xs, ys) = (around(x, size.width), around(y, size.height));
    let mut sum = [0.0f32; 3];
    for (y, v) in ys.into_iter().zip([0.25, 0.5, 0.25]) {
        for (x, u) in xs.into_iter().zip([0.25, 0.5, 0.25]) {
            let c = plane.at(x, y);
            for k in 0..3 {
                sum[k] += u * v * c[k];
            }
        }
    }
    sum
}

/// What the net's form reads of chosen pixels, for its training: see [`TRAINING_CHANNELS`].
#[cfg(feature = "internals")]
pub(crate) fn training_taps(joint: &Joint<'_>, chosen: &[(usize, usize)]) -> (Vec<half::f16>, Vec<f32>) {
    let taps_each = super::taps(joint.settings);
    let mut out = vec![half::f16::ZERO; chosen.len() * taps_each * TRAINING_CHANNELS];
    par::rows(&mut out, taps_each * TRAINING_CHANNELS, |i, out| {
        let (x, y) = chosen[i];
        let scale = joint.noise.inverse(x, y);
        let mut taps = out.chunks_exact_mut(TRAINING_CHANNELS);
        let mut write = |colour: Rgb, parts: [f32; PARTS], offset: f32, away: f32| {
            let colour = colour.map(|v| v * scale);
            let [near, wide, rest @ ..] = parts;
            let parts = [near * scale * scale, wide * scale * scale].into_iter().chain(rest);
            for (out, v) in taps.next().into_iter().flatten().zip(colour.into_iter().chain(parts).chain([offset, away]))
            {
                *out = half::f16::from_f32(v.clamp(-6e4, 6e4));
            }
        };
        write(joint.window[joint.centre].picture.at(x, y), [0.0; super::PARTS], 0.0, 0.5);
        joint.taps(x, y, &mut |own: &Signature, tap: Tap<'_>| {
            let colour = joint.window[tap.frame].picture.data()[tap.pixel];
            write(colour, super::parts(own, tap.signature), tap.offset, 1.0 + tap.away as f32);
        });
    });
    (out, chosen.iter().map(|(x, y)| joint.noise.inverse(*x, *y)).collect())
}

/// Of a tap, the pixel itself first: colour over brightness, squared differences of the signature's parts (the first two over the
/// squared brightness), squared distance, and 1 + frames between (0.5: the pixel itself; 0: no tap).
#[cfg(feature = "internals")]
pub(crate) const TRAINING_CHANNELS: usize = 3 + PARTS + 2;
