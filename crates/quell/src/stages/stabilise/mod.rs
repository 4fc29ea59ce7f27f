//! Sequence filter: a picture averaged over space and time by a cross-bilateral filter, whose bandwidths a small net gives.
//!
//! | | |
//! |---|---|
//! | reads | filtered pictures, the same as they came, and coverage of the frames around, their depth, motion, and what mirrors show |
//! | writes | the steadier picture, and its coverage |
//! | reach | `stabilise.frames` frames before and after; 10 pixels in a frame: the windows of the statistics that the net reads, as in `blend`; 2 rows where motion is rounded |
//! | equation | out_p = sum_q w_q (c_q + g i_q - g c_q) / sum_q w_q; log2 w_q = -(sum_i b_i \|f_i(p) - f_i(q)\|^2 + b_d d^2 + b_t (t - 1) + b_l) |
//! | q | 3x3 pixels of the frame, and of each of the others around the place where the motion of what is in front leads (d: distance from it, t: frames between) |
//! | motion | must lead back again within `round_trip` + (v / (3 `round_trip_noise`^2))^2 pixels + `round_trip_share` of its length; v: relative variance of the noise, summed over the channels, that the nets read of 11x11 pixels |
//! | c, i | the filtered picture and the same as it came; g: share of the latter, near 0 where samples are few |
//! | f | `Signature`; b, g: `Bandwidths`, of two nets; b of the albedo in other frames is at least `albedo` over the noise's relative variance, and `camera_albedo` where motion is the camera's alone |
//! | w_p | 1; of an outlier (`blend/outlier.rs`) down to 0, and so much less do the light's bandwidths count |
//! | b_l | 0 in the frame; max(0, c (l(q) - high), low - l(q)) in others; c: 1, or `camera_fall` where motion is the camera's alone; l: log2 of the median in 3x3 of the filtered picture's red + green + blue |
//! | low, high | least and most of l(p) and of the same sum of p's input in every frame where p was found, less and plus log2 `contrast`; second most where motion is the camera's alone |
//! | source | bandwidths of a cross-bilateral filter from a net on local statistics: Kalantari et al. 2015; over time, with statistics of the noise: ours, `docs/sequence.md` |
//! | parameters | `stabilise.*`, `gather.travel`, `gather.future` |
//!
//! So pixels that mix surfaces (wires, leaves, silhouettes) are averaged along themselves, where no feature buffer of a single surface
//! leads, and what the wavelet decided differently from frame to frame evens out.
//!
//! The noise that the nets read is relative to the brightness over 11x11 pixels. Beside a lamp most of it is the wavelet's own blur of
//! the lamp, and in a frame where motion misses by a pixel the lamp would be averaged in. So a tap of another frame counts less where
//! it is brighter, or darker, than anything that the pixel itself ever showed; noisy inputs show a wide range, and refuse nothing.
//!
//! Without the net (`stabilise.net=off`) neighbours in time alone are averaged, each fetched along the motion of what is in front by
//! a cubic and limited to the picture's own range in 3x3. It reaches 6 pixels: 3 of the cubic, 1 of the range, 2 of what is in front
//! before and after motion.
//!
//! | | |
//! |---|---|
//! | equation | out = (c + sum_k w_k clamp(c_k, low, high)) / (1 + sum_k w_k), w_k = decay^(k - 1) * likeness of what a mirror shows * t / (t + \|G - G_k\|^2) |
//! | t | sum over both pictures of min(`likeness` v, `residue` n (n / (n + (`low_noise` G)^2))^2); G: binomial 3x3 of the median in 3x3; v: mean over 3x3 of \|P - binomial P\|^2; n: mean over 5x5 of \|P - P as it came\|^2 |
//! | source | temporal anti-aliasing (Karis 2014) with both neighbours in time; ours: `docs/sequence.md` |
//!
//! A neighbour counts where it shows the same. How far it may differ shrinks with the noise that the frame came with.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
#[cfg(feature = "cpu")]
pub(crate) mod joint;
#[cfg(feature = "cpu")]
pub(crate) mod likeness;
pub mod reference;
mod share;
mod weights;

use crate::frame::Rgb;
#[cfg(feature = "gpu")]
use crate::kernels::net::Net;
use crate::par;
use crate::plane::Plane;
use crate::reach::Reach;
use crate::sequence::settings::{Gather, Stabilise};
use crate::stages::blend::outlier::{self, Limits};
use crate::stages::blend::{self, BlendFrame, Pooled, exp2, log2};
use crate::window::{Features, HalfRows, Rows};
#[cfg(feature = "cpu")]
use {
    crate::kernels::lanes,
    crate::stages::blend::statistics::PooledLanes,
    fearless_simd::{Simd, f32x16, prelude::*},
};

/// What a filtered picture shows without its noise: by it a neighbour in time counts. Made once a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Likeness {
    /// Binomial 3x3 of the median in 3x3: for weights alone, so that no energy is lost.
    pub guide: Plane<Rgb>,
    /// Squared difference of two guides that noise may make, this picture's part.
    pub tolerance: Plane<f32>,
}

/// Pixels around, each way, over which the noise of the frame as it came is pooled.
const POOL: usize = 2;
/// Keeps a quotient finite where there is neither light nor noise.
const LEAST_NOISE: f32 = 1e-20;

/// A frame as the stage reads it.
#[derive(Clone, Copy, Debug)]
pub struct StabiliseFrame<'a> {
    /// Feature buffers and motion.
    pub features: &'a Features,
    /// The filtered picture, scene-linear.
    pub picture: &'a Plane<Rgb>,
    /// The same as it came.
    pub input: &'a Plane<Rgb>,
    /// What it shows without its noise, for the form made by hand; `None`: neighbours count whatever they show.
    pub likeness: Option<&'a Likeness>,
    /// What pixels are compared by, for the net's form: see [`kept`].
    pub signature: Option<&'a HalfRows>,
    /// Coverage, 0..1.
    pub alpha: Option<&'a Plane<f32>>,
    /// See [`BlendFrame::along`].
    pub along: Option<&'a Rows>,
}

impl<'a> From<&StabiliseFrame<'a>> for BlendFrame<'a> {
    fn from(frame: &StabiliseFrame<'a>) -> Self {
        Self {
            features: frame.features,
            input: frame.input,
            picture: frame.picture,
            alpha: frame.alpha,
            along: frame.along,
        }
    }
}

/// How far a pixel's own light is believed, of whose colour `raw` is the input's share. `noise`: squared, relative to the brightness.
#[inline(always)]
pub(crate) fn own_weight<'a>(
    window: (&'a [BlendFrame<'a>], usize),
    at: (usize, usize),
    (raw, noise): (f32, f32),
    (gather, s): (&Gather, &Stabilise),
) -> f32 {
    let limits = Limits::new(s, noise);
    let filtered = outlier::believed(window, |frame| frame.picture, at, gather, limits);
    filtered.min(1.0 - raw * (1.0 - outlier::believed(window, |frame| frame.input, at, gather, limits)))
}

/// Pixels by which motion there and back again may miss, where the noise is `noise` (squared, relative to the brightness, summed over
/// the channels). Out of focus motion is a mean over few samples as light is, and misses its way back by chance: pixels near the right
/// place are better than none, and signatures decide which of them are averaged.
#[inline(always)]
pub(crate) fn may_miss(s: &Stabilise, noise: f32) -> f32 {
    let noisy = noise * noise_unit(s);
    s.round_trip + noisy * noisy
}

/// One over the noise that [`may_miss`] gives a pixel more.
#[inline(always)]
pub(crate) fn noise_unit(s: &Stabilise) -> f32 {
    1.0 / (3.0 * s.round_trip_noise * s.round_trip_noise)
}

/// Squared difference of the tone-mapped colours that mirrors or glass show around two pixels.
#[inline(always)]
pub(crate) fn seen_difference(here: &Features, p: usize, other: &Features, q: usize) -> f32 {
    let (Some(a), Some(b)) = (here.seen_albedo_around(), other.seen_albedo_around()) else { return 0.0 };
    let (a, b) = (a.at(0, p), b.at(0, q));
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// How many numbers of a signature have bandwidths.
pub(crate) const COMPARED: usize = 12;
/// How many numbers the net's form compares two pixels by.
pub const SIGNATURE: usize = COMPARED + 1;
/// What the net's form compares two pixels by, three numbers each: the picture smoothed by a binomial 3x3; its mean over 5x5 (of the
/// pixel that is averaged, the input's mean: an independent judge); of the albedo and of the normal seen there the means over 3x3,
/// since those of a pixel are as noisy as its light where surfaces mix. Last, log2 of the median in 3x3 of the picture's
/// red + green + blue.
pub type Signature = [f32; SIGNATURE];
/// Parts that hold light.
const LIGHT: usize = 2;
/// Where the mean over 5x5 lies.
pub(crate) const INPUT: std::ops::Range<usize> = 3..6;
/// Where the logarithm of the brightness lies.
pub(crate) const BRIGHTNESS: usize = COMPARED;
/// Parts of a signature that have a bandwidth each.
pub(crate) const PARTS: usize = COMPARED / 3;
/// What is darker counts as this.
pub(crate) const DARK: f32 = 1e-6;
/// Half the side of the window whose mean is compared.
pub(crate) const WIDE: usize = 2;
/// Half the side of the window of taps, in the frame itself as in others: with 2 no figure gains (docs/trials.md).
pub(crate) const TAP_RADIUS: usize = 1;
/// The part that holds the albedo.
const ALBEDO: usize = 2;
/// Relative variance of the noise below which the albedo's least bandwidth grows no further.
pub(crate) const LEAST_NOISE_OF_ALBEDO: f32 = 1e-3;
/// Least weight of a pixel itself, where nothing else counts.
pub(crate) const LEAST_OWN: f32 = 1e-3;
/// Relative squared deviations below this are no noise.
pub(crate) const LEAST_DEVIATION: f32 = 1e-7;
/// Largest logarithm of a bandwidth.
pub(crate) const MOST: f32 = 20.0;

/// Taps of a pixel, itself included.
#[cfg(feature = "internals")]
pub(crate) fn taps(s: &Stabilise) -> usize {
    (1 + 2 * s.frames as usize) * (2 * TAP_RADIUS + 1).pow(2)
}

/// The normal of pixel `p` whose mean over 3x3 a signature holds: that seen in mirrors, else the surface's.
#[inline(always)]
pub(crate) fn normal_at(features: &Features, p: usize) -> [f32; 3] {
    match (&features.seen, features.has_seen[1]) {
        (Some(seen), true) => seen.at(1, p),
        _ => features.surface[p].normal,
    }
}

/// The mean over 3x3 of the albedo seen there (without one: of the surface), tone-mapped; 0 where it is unknown.
#[inline(always)]
pub(crate) fn albedo_around(features: &Features, p: usize) -> Rgb {
    features.albedo_around.as_ref().map_or([0.0; 3], |albedo| albedo.at(0, p))
}

/// log2 of red + green + blue, or of its median.
#[inline(always)]
pub(crate) fn log_brightness(sum: f32) -> f32 {
    log2(if sum > DARK { sum } else { DARK })
}

/// Squared differences, part by part.
#[cfg(feature = "internals")]
pub(crate) fn parts(a: &Signature, b: &Signature) -> [f32; PARTS] {
    let part = |k: usize| (3 * k..3 * k + 3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum();
    [part(0), part(1), part(2), part(3)]
}

/// By what the squared differences of a signature are multiplied, and squared distances and frames between; for taps of the frame
/// itself, then for those of others. `log2` of a weight is the negative sum.
#[derive(Clone, Copy, Default)]
pub(crate) struct Bandwidths {
    /// Of each part of the signature.
    parts: [[f32; PARTS]; 2],
    offset: [f32; 2],
    away: f32,
    /// Share of the input in the colours that are averaged, 0..1.
    raw: f32,
}

/// The bandwidths that one net gives a pixel, and the share of the input, of another.
#[inline(always)]
pub(crate) fn bandwidths((pooled, inverse): &(Pooled, f32), s: &Stabilise, camera_motion: bool) -> Bandwidths {
    let inputs = pooled.inputs();
    // Loops, not `map`, which is compiled apart for narrow vectors.
    let mut read = [0.0; READ.len()];
    for (read, k) in read.iter_mut().zip(READ) {
        *read = inputs[k];
    }
    let mut z = weights::NET.run(&read);
    for z in &mut z {
        *z = exp2(z.clamp(-MOST, MOST));
    }
    let [share] = share::NET.run(&read);
    let share = exp2(share.clamp(-MOST, MOST));
    let deviation = |relative: f32| inverse * inverse / (relative + LEAST_DEVIATION);
    let (fine, noise) = (deviation(pooled.detail[1]), deviation(pooled.noise(1)));
    let mut parts = [[0.0; PARTS]; 2];
    for (group, parts) in parts.iter_mut().enumerate() {
        let z = &z[group * (PARTS + 1)..];
        *parts = [z[0] * fine, z[1] * noise, z[2], z[3]];
    }
    // Motion may be wrong where noise, which is all that the net knows, does not show it: textures on what turns, or slides in mirrors.
    let albedo = &mut parts[1][ALBEDO];
    *albedo = albedo.max(s.albedo / (pooled.noise(1) + LEAST_NOISE_OF_ALBEDO)).max(least_albedo(s, camera_motion));
    Bandwidths { parts, offset: [z[PARTS], z[2 * PARTS + 1]], away: z[2 * PARTS + 2], raw: share / (1.0 + share) }
}

/// Least bandwidth of the albedo over time where motion is not known of everything.
#[inline(always)]
fn least_albedo(s: &Stabilise, camera_motion: bool) -> f32 {
    if camera_motion { s.camera_albedo } else { 0.0 }
}

/// [`Bandwidths`] of sixteen pixels.
#[derive(Clone, Copy)]
#[cfg(feature = "cpu")]
pub(crate) struct BandwidthLanes<S: Simd> {
    parts: [[f32x16<S>; PARTS]; 2],
    offset: [f32x16<S>; 2],
    away: f32x16<S>,
    raw: f32x16<S>,
}

/// [`bandwidths`] of sixteen pixels, to the bit.
#[inline(always)]
#[cfg(feature = "cpu")]
pub(crate) fn bandwidth_lanes<S: Simd>(
    simd: S,
    (pooled, inverse): &(PooledLanes<S>, f32x16<S>),
    s: &Stabilise,
    camera_motion: bool,
) -> BandwidthLanes<S> {
    let inputs = pooled.inputs(simd);
    let mut read = [f32x16::splat(simd, 0.0); READ.len()];
    for k in 0..READ.len() {
        read[k] = inputs[READ[k]];
    }
    let mut z = weights::NET.run_lanes(simd, &read);
    for k in 0..OUTPUTS {
        z[k] = limited_exp2(simd, z[k]);
    }
    let [share] = share::NET.run_lanes(simd, &read);
    let share = limited_exp2(simd, share);
    let squared = *inverse * *inverse;
    let fine = squared / (pooled.detail[1] + LEAST_DEVIATION);
    let wide = pooled.noise(simd, 1);
    let noise = squared / (wide + LEAST_DEVIATION);
    const OTHERS: usize = PARTS + 1;
    let mut parts = [
        [z[0] * fine, z[1] * noise, z[2], z[3]],
        [z[OTHERS] * fine, z[OTHERS + 1] * noise, z[OTHERS + 2], z[OTHERS + 3]],
    ];
    let least = f32x16::splat(simd, s.albedo) / (wide + LEAST_NOISE_OF_ALBEDO);
    let least = least.max_precise(f32x16::splat(simd, least_albedo(s, camera_motion)));
    parts[1][ALBEDO] = parts[1][ALBEDO].max_precise(least);
    BandwidthLanes { parts, offset: [z[PARTS], z[2 * PARTS + 1]], away: z[2 * PARTS + 2], raw: share / (share + 1.0) }
}

/// A power of two whose logarithm is [`MOST`] at most.
#[inline(always)]
#[cfg(feature = "cpu")]
fn limited_exp2<S: Simd>(simd: S, z: f32x16<S>) -> f32x16<S> {
    let most = f32x16::splat(simd, MOST);
    lanes::exp2(simd, z.max(-most).min(most))
}

/// Which of [`blend`](crate::stages::blend)'s statistics the net reads: those that do not ask for a stabilised picture.
const READ: [usize; 11] = [0, 1, 2, 3, 4, 7, 11, 12, 14, 15, 16];
/// What the net gives: a bandwidth for every part and the distance, twice, and one for frames between.
const OUTPUTS: usize = 2 * (PARTS + 1) + 1;

/// The nets of the bandwidths and of the input's share, for a back end that has them in another form.
#[cfg(feature = "gpu")]
pub(crate) fn nets() -> (&'static Net<{ READ.len() }, 8, 8, OUTPUTS>, &'static Net<{ READ.len() }, 8, 8, 1>) {
    (&weights::NET, &share::NET)
}

/// What a tap brings.
#[inline(always)]
pub(crate) fn mixed(filtered: Rgb, input: Rgb, raw: f32) -> Rgb {
    [0, 1, 2].map(|c| filtered[c] + raw * (input[c] - filtered[c]))
}

/// Sum of squared differences times the bandwidth of their part, in a fixed order.
#[inline(always)]
pub(crate) fn distance(a: &Signature, b: &Signature, parts: &[f32; PARTS]) -> f32 {
    let mut p = [0.0f32; COMPARED];
    for k in 0..COMPARED {
        let d = a[k] - b[k];
        p[k] = parts[k / 3] * (d * d);
    }
    let mut q = [0.0f32; 4];
    for k in 0..4 {
        q[k] = p[k] + p[k + 4] + p[k + 8];
    }
    (q[0] + q[2]) + (q[1] + q[3])
}

/// Channels of a signature from here on are no light.
pub(crate) const BOUNDED: usize = 6;

/// A frame's signatures as they wait, in half precision. Of light the square root is kept, which reaches from 1e-9 to 4e9 so, to a
/// twentieth of a percent: it weighs taps, no tap is made of it.
pub fn kept(mut signatures: Rows) -> HalfRows {
    let (w, channels) = (signatures.size().width, signatures.channels());
    par::rows(signatures.data_mut(), (channels * w).max(1), |_, row| {
        for value in &mut row[..BOUNDED * w] {
            *value = value.abs().sqrt().copysign(*value);
        }
    });
    HalfRows::new(&signatures)
}

/// What [`kept`] keeps of channel `c`, as it was.
#[inline(always)]
pub(crate) fn restored(c: usize, value: f32) -> f32 {
    if c < BOUNDED { value * value.abs() } else { value }
}

/// The signature of a pixel.
pub(crate) fn signature_at(signatures: &HalfRows, x: usize, y: usize) -> Signature {
    std::array::from_fn(|c| restored(c, signatures.at(x, y, c)))
}

/// Range of brightness that a pixel showed, in [`log_brightness`].
#[derive(Clone, Copy, Default)]
pub(crate) struct Shown {
    low: f32,
    /// Most but for one frame, at least the pixel's own.
    second: f32,
    high: f32,
}

/// From and to which [`log_brightness`] taps of other frames count whole, and how fast they count less above.
#[derive(Clone, Copy)]
pub(crate) struct Bounds<T> {
    low: T,
    high: T,
    fall: f32,
}

impl Shown {
    /// Of its own picture, by the signature.
    #[inline(always)]
    pub(crate) fn new(own: f32) -> Self {
        Self { low: own, second: own, high: own }
    }

    /// Widened by its input in one of the frames.
    #[inline(always)]
    pub(crate) fn add(&mut self, input: Rgb) {
        let shown = log_brightness(input[0] + input[1] + input[2]);
        self.low = if shown < self.low { shown } else { self.low };
        let next = if shown > self.high { self.high } else { shown };
        self.high = if shown > self.high { shown } else { self.high };
        self.second = if next > self.second { next } else { self.second };
    }

    /// Positions are means over a pixel. Where motion comes of them alone, it misses at silhouettes: what the pixel showed in one
    /// frame only may be the lamp beside it.
    #[inline(always)]
    pub(crate) fn bounds(&self, s: &Stabilise, camera_motion: bool) -> Bounds<f32> {
        let contrast = log2(s.contrast);
        let (high, fall) = if camera_motion { (self.second, s.camera_fall) } else { (self.high, 1.0) };
        Bounds { low: self.low - contrast, high: high + contrast, fall }
    }
}

/// [`Shown`] of sixteen pixels.
#[cfg(feature = "cpu")]
struct ShownLanes<S: Simd> {
    low: f32x16<S>,
    second: f32x16<S>,
    high: f32x16<S>,
}

#[cfg(feature = "cpu")]
impl<S: Simd> ShownLanes<S> {
    #[inline(always)]
    fn new(own: f32x16<S>) -> Self {
        Self { low: own, second: own, high: own }
    }

    /// Widened by the red + green + blue of inputs of those pixels that are `known` (1, else 0).
    #[inline(always)]
    fn add(&mut self, simd: S, sums: &[f32; lanes::BLOCK], known: &[f32; lanes::BLOCK]) {
        let known = f32x16::from_slice(simd, known).simd_gt(f32x16::splat(simd, 0.0));
        let (sums, dark) = (f32x16::from_slice(simd, sums), f32x16::splat(simd, DARK));
        let shown = lanes::log2(simd, sums.simd_gt(dark).select(sums, dark));
        // This widens nothing.
        let shown = known.select(shown, self.second);
        self.low = shown.simd_lt(self.low).select(shown, self.low);
        let above = shown.simd_gt(self.high);
        let next = above.select(self.high, shown);
        self.high = above.select(shown, self.high);
        self.second = next.simd_gt(self.second).select(next, self.second);
    }

    #[inline(always)]
    fn bounds(&self, s: &Stabilise, camera_motion: bool) -> Bounds<f32x16<S>> {
        let contrast = log2(s.contrast);
        let (high, fall) = if camera_motion { (self.second, s.camera_fall) } else { (self.high, 1.0) };
        Bounds { low: self.low - contrast, high: high + contrast, fall }
    }
}

/// The weight of a tap: its signature, squared distance and frames between.
pub(crate) fn tap_weight(
    b: &Bandwidths,
    own: &Signature,
    &Bounds { low, high, fall }: &Bounds<f32>,
    (signature, offset, away): (&Signature, f32, usize),
) -> f32 {
    let group = usize::from(away > 0);
    let distance = distance(own, signature, &b.parts[group]) + b.offset[group] * offset;
    let in_time = if away > 0 {
        let brightness = signature[BRIGHTNESS];
        b.away * (away - 1) as f32 + ((brightness - high) * fall).max(low - brightness).max(0.0)
    } else {
        0.0
    };
    exp2(-(distance + in_time))
}

/// Pixels read within a frame: the cubic, the range in 3x3, what is in front in 3x3 before and after motion.
const WINDOW: usize = 3 + 1 + 2;
/// Rows that rounding adds where motion leads.
const FOOTPRINT: usize = 2;

/// How far the stage looks.
pub(crate) fn reach(s: &Stabilise) -> Reach {
    let pixels = if s.net { WINDOW.max(blend::statistics_reach()) } else { WINDOW };
    Reach { frames: s.frames, footprint: FOOTPRINT, ..Reach::around(pixels) }
}

#[cfg(all(test, feature = "cpu"))]
mod tests {
    use super::*;
    use crate::kernels::lanes::BLOCK;
    use crate::stages::blend::statistics::tests::pooled;

    #[test]
    fn taps_of_other_frames_count_whole_within_what_the_pixel_showed() {
        let settings = Stabilise { contrast: 2.0, ..Stabilise::default() };
        let signature = |sum: f32| -> Signature {
            let mut signature = [0.0; SIGNATURE];
            signature[BRIGHTNESS] = log_brightness(sum);
            signature
        };
        let own = signature(0.4);
        let mut shown = Shown::new(own[BRIGHTNESS]);
        for input in [[0.1, 0.1, 0.0], [0.2, 0.2, 0.4]] {
            shown.add(input);
        }
        let weight = |sum: f32, away: usize| {
            tap_weight(&Bandwidths::default(), &own, &shown.bounds(&settings, false), (&signature(sum), 0.0, away))
        };
        let near = |a: f32, b: f32| (a - b).abs() <= 1e-3 * b;
        // It showed 0.2 to 0.8: taps from 0.1 to 1.6 count whole.
        assert!([0.11, 0.4, 1.5].into_iter().all(|sum| near(weight(sum, 1), 1.0)));
        assert!(near(weight(16.0, 1), 0.1) && near(weight(0.01, 2), 0.1), "{} {}", weight(16.0, 1), weight(0.01, 2));
        // In the frame itself the signatures alone decide.
        assert!(near(weight(16.0, 0), 1.0));
        // Where motion is the camera's alone, what one frame showed is not believed, and what is brighter counts less by the square.
        shown.add([8.0, 8.0, 0.0]);
        let weight = |sum: f32, camera: bool| {
            let bounds = shown.bounds(&settings, camera);
            tap_weight(&Bandwidths::default(), &own, &bounds, (&signature(sum), 0.0, 1))
        };
        assert!(near(weight(16.0, false), 1.0) && near(weight(1.5, true), 1.0) && near(weight(16.0, true), 0.01));
        // Dark inputs refuse nothing darker.
        shown.add([0.0; 3]);
        assert!(shown.bounds(&settings, false).low < log_brightness(0.0));
    }

    #[test]
    fn bandwidths_of_sixteen_pixels_have_the_bits_of_one() {
        let settings = Stabilise::default();
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for seed in 0..20 {
                let (one, lanes) = pooled(simd, seed);
                let inverse: [f32; BLOCK] = std::array::from_fn(|i| 0.01 + 3.0 * i as f32);
                let found = bandwidth_lanes(simd, &(lanes, inverse.simd_into(simd)), &settings, seed % 2 == 0);
                let all = |b: &BandwidthLanes<_>, i: usize| -> Vec<u32> {
                    let parts = b.parts.iter().flatten().chain(&b.offset).chain([&b.away, &b.raw]);
                    parts.map(|v| v.as_slice()[i].to_bits()).collect()
                };
                for (i, pooled) in one.into_iter().enumerate() {
                    let b = bandwidths(&(pooled, inverse[i]), &settings, seed % 2 == 0);
                    let expected = b.parts.iter().flatten().chain(&b.offset).chain([&b.away, &b.raw]);
                    assert_eq!(all(&found, i), expected.map(|v| v.to_bits()).collect::<Vec<_>>(), "{pooled:?}");
                }
            }
        });
    }
}
