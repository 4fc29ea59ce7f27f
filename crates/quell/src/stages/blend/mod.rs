//! Sequence filter: of the input, the wavelet's picture and the stabilised one, the mixture that is expected to lie nearest to
//! the light; then of that mixture a weighted mean over the pixels around, which removes what noise is left at edges.
//!
//! | | |
//! |---|---|
//! | reads | the input, the wavelet's picture and the stabilised one of a frame; its albedo, normals and depth; input and wavelet's picture of its neighbours, their depth, normals and motion |
//! | writes | the share of each of the three at every pixel; what the kernel multiplies the mixture by; the coverage; the expected error |
//! | reach | 35 pixels: 5 of the kernel and the two guards; 20 of the net; windows of 5x5, in them windows of 11x11 of differences over 3x3, relative to means over 5x5; neighbours in time are those of `stabilise` |
//! | equation | share_k = g(z_k) / sum g(z), g(z) = ((z + sqrt(z^2 + 4)) / 2)^2, z = 6 y / (6 + \|y\|), y = net([`Read`]); kernel: softmax of the net's other outputs |
//! | source | choice between filtered candidates by estimated error: SURE (Li et al. 2012), Rousselle et al. 2013; by a small convolutional net (`kernels/conv.rs`) on pooled statistics: ours, `docs/sequence.md`; kernels predicted by a net: Bako et al. 2017 |
//! | parameters | `blend.*` |
//!
//! No other stage asks what its average is worth against what it started from. Here the input itself judges: the differences of
//! the three pictures, pooled over windows, are compared with the noise of the input, which is found twice: from the changes of
//! input less wavelet's picture along the surface's motion (a bias that stays cancels), and from its changes between
//! neighbouring pixels (a smooth bias cancels); it is no more than the changes of the input itself between neighbouring
//! pixels. Differences are taken relative to the local brightness, and given to the net as logarithms of their ratio to that
//! noise, so that it does not depend on exposure.
//!
//! The shares steer pictures and passes alike, so that passes add up. Whatever the net says, a mixture that lies further from
//! the input than `blend.guard` times the noise explains is drawn back to it; and so is every mixture where the noise is too weak to be
//! seen (`blend.visible`), so that the output tends to the input as samples grow. The noise for that is the least of all
//! that is known, that along edges and stripes of the input included, but no less than a share (`blend.guard_input`) of the latter: noise
//! that the wavelet did not remove is not in what it removed.
//!
//! Of an outlier of the input (`outlier.rs`) the stabilised picture takes all shares.
//!
//! Where a pixel shows two surfaces, how much of each is chance: few samples decide. No candidate is rid of that noise, for no neighbour
//! shows the same mixture. Along the edge it averages out: the net gives each pixel a kernel (`kernel.rs`).

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub(crate) mod kernel;
pub(crate) mod outlier;
#[cfg(feature = "cpu")]
pub(crate) mod over_time;
pub mod reference;
#[cfg(feature = "cpu")]
pub(crate) mod statistics;

use crate::frame::Rgb;
use crate::kernels::conv::{self, ConvNet};
use crate::plane::Plane;
use crate::reach::Reach;
use crate::sequence::settings::Blend as Settings;
use crate::window::{Features, Rows};
use std::sync::LazyLock;

/// A frame as the stage reads it.
#[derive(Clone, Copy, Debug)]
pub struct BlendFrame<'a> {
    /// Feature buffers and motion.
    pub features: &'a Features,
    /// The picture as it came, scene-linear.
    pub input: &'a Plane<Rgb>,
    /// The wavelet's picture.
    pub picture: &'a Plane<Rgb>,
    /// The coverage as it came. `None`: the picture is opaque.
    pub alpha: Option<&'a Plane<f32>>,
    /// Of the frame in the middle of the window: noise over time along its trajectories, five channels of the picture's extent (`along` of
    /// `blend/over_time.rs`). `None`: it is found when it is asked for.
    pub along: Option<&'a Rows>,
}

/// The stabilised picture and its coverage.
pub type Steady<'a> = (&'a Plane<Rgb>, Option<&'a Plane<f32>>);

/// What the stage makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// Shares of the input, the wavelet's picture and the stabilised one; they add up to 1.
    pub shares: Plane<[f32; 3]>,
    /// What the kernel multiplies the mixture by, channel by channel. `None`: no kernel was asked for.
    pub gain: Option<Plane<Rgb>>,
    /// The coverage, mixed and filtered as the picture is.
    pub alpha: Option<Plane<f32>>,
    /// Expected error of the mixture that the net wants (not of what `blend.strength` makes of it): root mean square over the
    /// channels, in units of the picture.
    pub noise: Plane<f32>,
}

/// What the net reads of a pixel, in this order.
///
/// `log2` of squared differences over the noise: the noise found over time in windows of 5x5 and 11x11, and over space in the same;
/// input to wavelet, input to stabilised, wavelet to stabilised in windows of 3x3, the same of 7x7; the detail of the stabilised
/// picture, and of the wavelet's; the squared mean over 5x5 of input less wavelet, of input less stabilised, and of input less
/// wavelet averaged over the neighbours in time. Then the share of neighbours in time that show the surface, and 1 at
/// silhouettes.
pub const INPUTS: usize = 17;
/// See [`INPUTS`].
pub type Inputs = [f32; INPUTS];

/// Neighbours in time on each side that are read, as far as the window of `stabilise` holds them.
pub(crate) const FRAMES: usize = 2;
/// Half the sides of the windows: of differences, near and wide; of noise, near and wide.
pub(crate) const NEAR: usize = 1;
pub(crate) const WIDE: usize = 3;
pub(crate) const NOISE_NEAR: usize = 2;
pub(crate) const NOISE_WIDE: usize = 5;
/// Relative squared differences below this do not count.
pub(crate) const LEAST: f32 = 1.0 / (1 << 24) as f32;
/// Keeps quotients finite where a picture is black.
pub(crate) const LEAST_BRIGHTNESS: f32 = 1e-12;
/// Share of neighbours in time up to which the noise over time is unknown: a twentieth. Over a window of n pixels the share is k / (4 n)
/// with whole k, so it often is a twentieth. The bound lies between that and the next larger share that a window can have: rounding
/// does not decide on which side a pixel falls.
pub(crate) const LEAST_SEEN: f32 = 0.05025;
/// The most that brightness of one surface changes between neighbours in time for its noise to be scaled by it.
pub(crate) const MOST_CHANGE: f32 = 4.0;
/// Largest logarithm of a ratio.
pub(crate) const MOST_RATIO: f32 = 12.0;
/// Depths that differ by more than this share are two surfaces.
pub(crate) const DEPTH_STEP: f32 = 0.1;
/// Least cosine between normals of one surface in two frames.
pub(crate) const LEAST_COSINE: f32 = 0.8;

/// How far the statistics look: a window, in it that of the noise, of differences over 3x3, which are relative to a brightness.
pub(crate) fn statistics_reach() -> usize {
    NOISE_NEAR + NOISE_WIDE + 1 + NOISE_NEAR
}

/// How far the stage looks: its net at statistics, around them both guards and the kernel. Frames around are those that `stabilise` holds.
pub(crate) fn reach() -> Reach {
    Reach::around(conv::REACH + statistics_reach() + 2 * NOISE_NEAR + kernel::RADIUS)
}

/// The pixel of `to` that shows what pixel `q` of `from` shows, `at` being its place, which is moved along. `None`: it is lost.
#[inline(always)]
pub(crate) fn follow(
    from: &Features,
    to: &Features,
    forward: bool,
    reflected: bool,
    (at, q): (&mut [f32; 2], usize),
) -> Option<usize> {
    let (w, h) = (from.size.width, from.picture_height);
    let m = from.motion.get(forward, reflected)?.at(q);
    *at = [at[0] + m[0], at[1] + m[1]];
    // NaN fails too: unknown motion ends the trajectory.
    if !(at[0] > -0.5 && at[1] > -0.5 && at[0] < w as f32 - 0.5 && at[1] < h as f32 - 0.5) {
        return None;
    }
    let x = (at[0].round() as usize).min(w - 1);
    let row = to.row_here((at[1].round() as isize).min(h as isize - 1))?;
    let there = row * w + x;
    let (a, b) = (&from.surface[q], &to.surface[there]);
    let near = (a.inverse_depth - b.inverse_depth).abs() <= DEPTH_STEP * a.inverse_depth.max(b.inverse_depth);
    let has_normals = a.normal != [0.0; 3] || b.normal != [0.0; 3];
    let cosine: f32 = (0..3).map(|c| a.normal[c] * b.normal[c]).sum();
    (near && (!has_normals || cosine >= LEAST_COSINE)).then_some(there)
}

/// log2 of positive numbers, to 2.2e-5: plain multiplications and additions, the same bits on every machine.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
    // log2(1 + m) on 0..1, exact at both ends, within 2.2e-5.
    let p = 1.0 + (m - 1.0) * (-0.441_740_3 + m * (0.266_029_9 + m * (-0.146_314_3 + m * 0.044_004_7)));
    exponent as f32 + m * p
}

/// 2^x, to 1.7e-4 relative, for -60 <= x <= 60.
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    let x = x.clamp(-60.0, 60.0);
    let whole = x.floor();
    let t = x - whole;
    let p = 1.0 + t * (0.695_928_5 + t * (0.224_946_3 + t * 0.079_125_2));
    f32::from_bits(((whole as i32 + 127) as u32) << 23) * p
}

/// Pooled statistics of a pixel, as the net reads them. All relative to the squared brightness.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pooled {
    /// Noise over time, near and wide; share of neighbours seen, near and wide.
    pub over_time: [f32; 2],
    pub seen: [f32; 2],
    /// Noise over space, near and wide.
    pub over_space: [f32; 2],
    /// Detail and noise of the input together, near and wide: no noise is larger.
    pub input: [f32; 2],
    /// Second differences along the direction in which they are least, of the input and of input less wavelet: edges and stripes are
    /// no noise.
    pub along: [f32; 2],
    /// Input to wavelet, input to stabilised, wavelet to stabilised; near, then wide.
    pub apart: [f32; 6],
    /// Detail of the stabilised picture and of the wavelet's.
    pub detail: [f32; 2],
    /// Squared means of differences.
    pub mean: [f32; 3],
    pub silhouette: bool,
}

impl Pooled {
    /// Noise of the input: squared, relative to the brightness.
    #[inline(always)]
    pub(crate) fn noise(&self, wide: usize) -> f32 {
        let (time, space) = (self.over_time[wide], self.over_space[wide].min(self.input[wide]));
        (if self.seen[wide] > LEAST_SEEN { (time / self.seen[wide]).min(space) } else { space }).max(LEAST)
    }

    /// The least that the noise near the pixel may be: what the result may lie from the input is counted in it. What the wavelet did not
    /// remove (the noise of wires and silhouettes, of what they emit) is not in input less wavelet: a share of the input's own counts always.
    #[inline(always)]
    pub(crate) fn least_noise(&self, s: &Settings) -> f32 {
        let [input, removed] = self.along;
        let input = input.min(self.input[0]);
        self.noise(0).min(removed).max(s.guard_input * input).min(input).max(LEAST)
    }

    /// What the net reads.
    #[inline(always)]
    pub(crate) fn inputs(&self) -> Inputs {
        let noise = self.noise(1);
        let of_noise = log2(noise);
        let ratio = |v: f32| (log2(v.max(LEAST)) - of_noise).clamp(-MOST_RATIO, MOST_RATIO);
        let time =
            |k: usize| if self.seen[k] > LEAST_SEEN { self.over_time[k] / self.seen[k] } else { self.over_space[k] };
        let mut out = [0.0; INPUTS];
        out[0] = ratio(time(0));
        out[1] = ratio(time(1));
        out[2] = ratio(self.over_space[0]);
        out[3] = ratio(self.over_space[1]);
        for (k, apart) in self.apart.iter().enumerate() {
            out[4 + k] = ratio(*apart);
        }
        out[10] = ratio(self.detail[0]);
        out[11] = ratio(self.detail[1]);
        for (k, mean) in self.mean.iter().enumerate() {
            out[12 + k] = ratio(*mean);
        }
        out[15] = self.seen[0];
        out[16] = f32::from(u8::from(self.silhouette));
        out
    }

    /// Second differences along edges, as [`Self::inputs`].
    #[inline(always)]
    pub(crate) fn along_edges(&self) -> [f32; ALONG] {
        let of_noise = log2(self.noise(1));
        self.along.map(|v| (log2(v.max(LEAST)) - of_noise).clamp(-MOST_RATIO, MOST_RATIO))
    }
}

/// Second differences along edges, as [`INPUTS`]: of the input, and of input less wavelet.
const ALONG: usize = 2;

/// Feature buffers that the net reads, three numbers each but the last: tone-mapped albedo and unit normal, as seen in mirrors and through
/// glass where frames have that, and how 1 / depth differs from its mean over 5x5, relative to the sum of both. 0: unknown.
const GUIDES: usize = 7;

/// What the net of `blend` reads of a pixel: colours of the three candidates, v / (1 + |v|) of each channel over the brightness, then
/// [`INPUTS`], then second differences along edges, then feature buffers.
pub const READ: usize = 9 + INPUTS + ALONG + GUIDES;
/// See [`READ`].
pub type Read = [f32; READ];

/// What the net reads. `around`: the mean over 5x5 of 1 / depth.
#[inline(always)]
pub(crate) fn read(
    pooled: &Pooled,
    candidates: [Rgb; 3],
    inverse: f32,
    (features, p, around): (&Features, usize, f32),
) -> Read {
    let mut out = [0.0; READ];
    for (k, colour) in candidates.iter().enumerate() {
        for (c, value) in colour.iter().enumerate() {
            let v = value * inverse;
            out[3 * k + c] = v / (1.0 + v.abs());
        }
    }
    out[9..][..INPUTS].copy_from_slice(&pooled.inputs());
    out[9 + INPUTS..][..ALONG].copy_from_slice(&pooled.along_edges());
    out[9 + INPUTS + ALONG..].copy_from_slice(&guides(features, p, around));
    out
}

/// Feature buffers of pixel `p`: see [`GUIDES`].
#[inline(always)]
pub(crate) fn guides(features: &Features, p: usize, around: f32) -> [f32; GUIDES] {
    let surface = &features.surface[p];
    let [r, g, b] = features.guide_albedo(p);
    let [x, y, z] = features.guide_normal(p);
    let both = surface.inverse_depth + around;
    [r, g, b, x, y, z, if both > 0.0 { (surface.inverse_depth - around) / both } else { 0.0 }]
}

/// Channels of the net at full size, half and a quarter.
const WIDTHS: [usize; 3] = [16, 32, 32];
/// What the net gives: a number for each candidate, `log2` of the expected squared error over the input's noise, and a number for each pixel
/// of the kernel.
const OUTPUTS: usize = 4 + kernel::TAPS;
/// The numbers of candidates are between this and its negative: no candidate is lost from sight in training.
pub(crate) const MOST_NUMBER: f32 = 6.0;

/// The net's weights, trained by `benchmarks/nets/blend.py`.
static WEIGHTS: &[u8] = include_bytes!("weights.bin");
const _: () = assert!(WEIGHTS.len() == ConvNet::bytes(READ, WIDTHS, OUTPUTS));

/// The net.
pub(crate) fn net() -> &'static ConvNet {
    static NET: LazyLock<ConvNet> = LazyLock::new(|| ConvNet::read(WEIGHTS, READ, WIDTHS, OUTPUTS));
    &NET
}

/// Shares of the candidates by what the net says; and the expected squared error over the input's noise.
#[inline(always)]
pub(crate) fn shares(said: [f32; 4], strength: f32) -> ([f32; 3], f32) {
    let g = |y: f32| {
        let z = MOST_NUMBER * y / (MOST_NUMBER + y.abs());
        let half = 0.5 * (z + (z * z + 4.0).sqrt());
        half * half
    };
    // Beyond 1 the more filtered candidates gain.
    let more = strength.max(1.0);
    let g = [g(said[0]), g(said[1]) * more * more, g(said[2]) * more * more * more * more];
    let total = g[0] + g[1] + g[2];
    let less = strength.min(1.0);
    let (wavelet, steady) = (less * g[1] / total, less * g[2] / total);
    ([1.0 - (wavelet + steady), wavelet, steady], exp2(said[3]))
}

/// Without the net: share of the noise that a filtered picture is believed to be rid of.
const REMOVED: f32 = 0.9;

/// Acceptance by steps, made by hand: the wavelet's picture, then the stabilised one, is taken where its squared distance from
/// the input is explained by the noise.
#[inline(always)]
pub(crate) fn by_thresholds(pooled: &Pooled, s: &Settings) -> ([f32; 3], f32) {
    let noise = pooled.noise(0);
    let accepted = |apart: f32| {
        let excess = apart / noise - 1.0 - s.excess;
        if excess < s.softness { (1.0 - excess / s.softness).min(1.0) } else { 0.0 }
    };
    let first = s.strength.min(1.0) * accepted(pooled.apart[0]);
    let second = accepted(pooled.apart[1]);
    let (wavelet, steady) = (first * (1.0 - second), first * second);
    ([1.0 - (wavelet + steady), wavelet, steady], 1.0 - REMOVED * first)
}

/// What draws a mixture back to the input that lies further from it than the noise explains: the factor of its difference, 1 up to so many
/// times the noise, 0 from twice that. What weak noise explains is known better than what strong noise does, of which few
/// samples have rare bright ones. And where it is so weak that nobody sees it, removing it is not worth a bias. `noise` is
/// squared, relative to the brightness, summed over the channels.
#[inline(always)]
pub(crate) fn drawn_back(difference: f32, noise: f32, s: &Settings) -> f32 {
    let share = |deviation: f32| noise / (noise + 3.0 * deviation * deviation);
    let explained = noise * (s.guard_low + (s.guard - s.guard_low) * share(s.guard_noise));
    // NaN, of infinities, is no agreement.
    if difference < 2.0 * explained { share(s.visible) * (2.0 - difference / explained).min(1.0) } else { 0.0 }
}

/// The shares of a pixel whose input is believed so far.
#[inline(always)]
pub(crate) fn without_outlier([input, wavelet, _]: [f32; 3], believed: f32, s: &Settings) -> [f32; 3] {
    let kept = 1.0 - s.strength.min(1.0) * (1.0 - believed);
    let [input, wavelet] = [input * kept, wavelet * kept];
    [input, wavelet, 1.0 - (input + wavelet)]
}

/// What is left of white noise's variance less its mean over 3x3, binomial.
pub(crate) const HIGH_PASS: f32 = 41.0 / 64.0;
/// Steps to the neighbours of the second differences, and of their mirror images.
pub(crate) const DIRECTIONS: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];
/// Variance of the second difference a - 2 b + c of independent values of variance 1.
pub(crate) const SECOND_DIFFERENCE: f32 = 6.0;

/// True where something stands in front within 3x3.
pub(crate) fn silhouette(features: &Features, x: usize, y: usize, nearer: f32) -> bool {
    let (w, h) = (features.size.width, features.size.height);
    let own = features.surface[y * w + x].inverse_depth;
    (y.saturating_sub(1)..(y + 2).min(h)).any(|v| {
        (x.saturating_sub(1)..(x + 2).min(w)).any(|u| {
            let other = features.surface[v * w + u].inverse_depth;
            other > own * nearer || own > other * nearer
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The order in which a mean is summed must not decide whether the noise over time is known.
    #[test]
    fn no_share_of_neighbours_lies_at_its_bound() {
        let apart = |bound: f32, radius: usize| {
            let sides = 1..2 * radius + 2;
            let windows = sides.clone().flat_map(|w| sides.clone().map(move |h| w * h));
            let shares = windows
                .flat_map(|pixels| (0..=2 * FRAMES * pixels).map(move |k| k as f32 / (2 * FRAMES * pixels) as f32));
            shares.map(|share| (share / bound - 1.0).abs()).fold(f32::MAX, f32::min)
        };
        for radius in [NOISE_NEAR, NOISE_WIDE] {
            assert!(apart(LEAST_SEEN, radius) > 1e-3);
            // Canary: a twentieth itself.
            assert!(apart(0.05, radius) < 1e-6);
        }
    }
}
