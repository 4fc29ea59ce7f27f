//! The net's form of the stage, row by row.

use super::cpu::Track;
use super::{
    Bandwidths, Signature, StabiliseFrame, TAPS_AROUND, TAPS_IN_TIME, albedo_around, bandwidths, normal_at, tap_weight,
};
use crate::frame::Rgb;
use crate::kernels::math::three;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Gather, Stabilise};
use crate::simd::widest;
use crate::stages::blend::BlendFrame;
use crate::stages::blend::cpu::PictureNoise;
use crate::window::{Features, Rows};

/// As [`super::reference::signature`].
pub(crate) fn signature(features: &Features, picture: &Plane<Rgb>) -> Plane<Signature> {
    let size = picture.size();
    let mut out = Plane::filled(size, [0.0; super::SIGNATURE]);
    let wide = wide_mean(picture);
    par::rows(out.data_mut(), size.width, |y, row| {
        for (x, value) in row.iter_mut().enumerate() {
            let normal = normal_around(features, x, y);
            let albedo = albedo_around(features, y * size.width + x);
            for (part, v) in [binomial(picture, x, y), wide.colour(x, y, 0), albedo, normal].into_iter().enumerate() {
                value[3 * part..3 * part + 3].copy_from_slice(&v);
            }
        }
    });
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
    let joint = Joint::new(window, centre, gather, settings);
    let mut out = here.picture.clone();
    let mut coverage = Plane::filled(if joint.has_alpha { size } else { Size::new(0, 0) }, 0.0);
    if joint.has_alpha {
        par::two_rows(out.data_mut(), w, coverage.data_mut(), w, |y, row, coverage| {
            widest!(joint.row(y, row, coverage));
        });
        return (out, Some(coverage));
    }
    par::rows(out.data_mut(), w, |y, row| {
        widest!(joint.row(y, row, &mut []));
    });
    (out, here.alpha.cloned())
}

/// One picture, its neighbours in time, and what its pixels are compared by.
pub(crate) struct Joint<'a> {
    window: &'a [StabiliseFrame<'a>],
    centre: usize,
    has_alpha: bool,
    gather: &'a Gather,
    settings: &'a Stabilise,
    noise: PictureNoise,
    /// Mean over 5x5 of the input.
    input: Rows,
}

impl<'a> Joint<'a> {
    pub(crate) fn new(
        window: &'a [StabiliseFrame<'a>],
        centre: usize,
        gather: &'a Gather,
        settings: &'a Stabilise,
    ) -> Self {
        let frames: Vec<_> = window.iter().map(BlendFrame::from).collect();
        Self {
            window,
            centre,
            has_alpha: window.iter().all(|f| f.alpha.is_some()),
            gather,
            settings,
            noise: PictureNoise::new(&frames, centre, window[centre].picture, gather),
            input: wide_mean(window[centre].input),
        }
    }

    #[inline(always)]
    fn row(&self, y: usize, row: &mut [Rgb], coverage: &mut [f32]) {
        for (x, value) in row.iter_mut().enumerate() {
            let (colour, alpha) = self.pixel(x, y);
            *value = colour;
            if let Some(coverage) = coverage.get_mut(x) {
                *coverage = alpha;
            }
        }
    }

    /// Colour and coverage of a pixel. Without coverage that is 0.
    #[inline(always)]
    fn pixel(&self, x: usize, y: usize) -> (Rgb, f32) {
        let here = &self.window[self.centre];
        let bandwidths = bandwidths(&self.noise.at(x, y, here.features, self.settings.nearer));
        let own = here.picture.at(x, y);
        let own_alpha = here.alpha.map_or(0.0, |a| a.at(x, y));
        let mut sums =
            Sums { joint: self, bandwidths, own, own_alpha, colour: [0.0f32; 3], alpha: 0.0f32, total: 1.0f32 };
        self.taps(x, y, &mut sums);
        let Sums { colour, alpha, total, .. } = sums;
        (three(|k| own[k] + colour[k] / total), own_alpha + alpha / total)
    }

    /// Visits the pixels around and those of other frames, but for the pixel itself.
    #[inline(always)]
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
                        visitor.visit(&own, Tap { frame, pixel, signature, offset, away });
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

/// Weighted sums of differences from a pixel.
struct Sums<'j> {
    joint: &'j Joint<'j>,
    bandwidths: Bandwidths,
    own: Rgb,
    own_alpha: f32,
    colour: Rgb,
    alpha: f32,
    total: f32,
}

impl Visit for Sums<'_> {
    #[inline(always)]
    fn visit(&mut self, own: &Signature, tap: Tap<'_>) {
        let weight = tap_weight(&self.bandwidths, own, (tap.signature, tap.offset, tap.away));
        let other = &self.joint.window[tap.frame];
        let c = other.picture.data()[tap.pixel];
        for k in 0..3 {
            self.colour[k] += weight * (c[k] - self.own[k]);
        }
        if let (true, Some(alpha)) = (self.joint.has_alpha, other.alpha) {
            self.alpha += weight * (alpha.data()[tap.pixel] - self.own_alpha);
        }
        self.total += weight;
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

/// Mean over 5x5 of what lies in the picture.
fn wide_mean(plane: &Plane<Rgb>) -> Rows {
    let size = plane.size();
    let mut rows = Rows::new(size, 3);
    par::rows(rows.data_mut(), (3 * size.width).max(1), |y, out| {
        for (x, c) in plane.row(y).iter().enumerate() {
            for k in 0..3 {
                out[k * size.width + x] = c[k];
            }
        }
    });
    crate::stages::blend::cpu::pool(&rows, super::WIDE)
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
        let mut write = |colour: Rgb, parts: [f32; super::PARTS], offset: f32, away: f32| {
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
pub(crate) const TRAINING_CHANNELS: usize = 3 + super::PARTS + 2;
