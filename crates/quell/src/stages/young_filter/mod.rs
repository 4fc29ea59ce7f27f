//! Between stages 3 and 4, and between 8 and 9: a filter in space where history is short. No stage of the paper.
//!
//! | | |
//! |---|---|
//! | reads | an accumulated signal and its passes, its history length N, feature buffers |
//! | writes | the same, level by level |
//! | reach | 3^i pixels in level i, i from 0 to 3 (matte), to 2 (glossy), at most `matte_levels`, `glossy_levels` levels; of the depths for the contact stop, twice that |
//! | equation | out = (N_p c_p + sum_q s w_pq N_q c_q) / (N_p + sum_q s w_pq N_q) over the eight q whose offsets are -3^i, 0 or 3^i along both axes |
//! | edge stops | w_pq of `kernels/edge.rs`, for the glossy signal with gloss, for the matte one where `edge.contact` is above 0 times the contact stop w_c of that file, which noise switches off: 1 - (1 - w_c) max(0, 1 - V / (R m^2)), R = `contact_noise` (0: w_c alone), m = (l_p + l_q) / 2, V = v_p + v_q, where v is not known 2 m^2 (1 / N_p + 1 / N_q) |
//! | first luminance stop | at level 0, where the signal's contrast C (`matte_contrast`, `glossy_contrast`) is above 0: w_pq times max(0, 1 - (l_p - l_q)^2 / (C^2 m^2 (1 / N_p + 1 / N_q) + e^2 (l_p + l_q)^2))^2, l the input's luminance, m = (l_p + l_q) / 2, e = 0.004; what it takes from a neighbour's weight goes to c_p |
//! | luminance stop | from level 1 on, where `deviations` K is above 0: w_pq times max(0, 1 - (l_p - l_q)^2 / (K^2 (v_p + v_q) + e^2 (l_p + l_q)^2))^2 (Tukey's biweight), v the variance of l's noise; where f = `further_contrast` and C of the first stop are above 0, K^2 (v_p + v_q) is at most max((f C m)^2, 4 K^2 min(v_p N_p, v_q N_q)) (1 / N_p + 1 / N_q) |
//! | noise | v' = sum_q u_q^2 v_q / (sum_q u_q)^2, u the weights of the mean; at level 0 v_q = S / N_q, S the variance of one frame's light: (n / (n - 1)) sum_q w_q N_q (l_q - m)^2 / sum_q w_q, m the mean of l with weights w N, n = (sum w)^2 / sum w^2, w here without the first stop; N_p l_p^2 where n is under 1.5 |
//! | isolated pixels | at level 0, where `isolated` A is above 0: each of the eight that lies in the picture and is no background counts s max(0, 1 - W) min(N_q, max(0, A - N_p)) frames more, whatever its surface and its luminance; W = sum of w_pq over the eight, without the first stop; N_q at most `frames` |
//! | fade | s = clamp((F_i - N_p) / (F_i - 1), 0, 1), F_i = `frames` `falloff`^i (matte with `matte_stays`: 1e9), F_3 = `wide_frames`; glossy: times min(1, (`lobe` r + `least_lobe`) / 3^i), r = 2 roughness^2 f, f the focal length in pixels |
//! | source | ours; levels of sparse taps: Dammertz et al. (HPG 2010); a filter in space for short histories: SVGF (Schied et al., HPG 2017) 4.2; a luminance stop that knows the noise: SVGF 4.3 |
//! | parameters | `young_filter.*`, `edge.*` |
//!
//! A mean of N frames has an N-th of the variance of one: neighbours count by their own N, at most `frames`, so that what has
//! just been uncovered takes its light from what has long been seen. The pixels of level i + 1 lie as far apart as those of level i
//! reach, so that three levels together are a mean over 27x27 pixels without gaps, four over 81x81: no two of a level's inputs share a pixel, their noise is
//! independent, and the variance of their difference is the sum of theirs. Level 0 finds the noise, and cannot stop by it: its own stop goes
//! by the pair's mean, and closes as N grows. It takes little from young pixels, and nothing wholly before N = C^2 / 2 frames, since two luminances differ by twice
//! their mean at most; then a lamp in a mirror stays out of the pixels beside it, and what is left of a firefly out of its surroundings. What is refused, the pixel's own light stands in for: between pixels of equal
//! frames and weights that is an exchange, which loses no light. Without the luminance stops weights come from feature buffers and
//! lengths alone: the filter is linear in the light, and keeps its energy. Both stops are even in both pixels: what is dark by chance
//! refuses what is bright no more than the other way round. The noise that level 0 finds around a firefly is the firefly: further levels
//! would copy it to eight pixels around it. It counts only as far as the pair's mean allows, or as it is found at both pixels, as that of sparse light is. Passes take the weights of the signal that they are tied to, and still add up.
//! A pixel of a wire or a leaf that has neither history nor neighbours of its surface would keep the noise of its few paths: what is around it
//! stands in, until it has a history of its own.
//! Radii are in pixels of any image, since so is the noise. Background passes through.

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::frame::Signal;
use crate::reach::Reach;
#[cfg(feature = "gpu")]
use crate::settings::Settings;
use crate::settings::{Edge, YoungFilter};
use crate::stages::glossy_bilateral::LOBE_SPREAD;

/// Levels of the matte signal at most.
pub(crate) const LEVELS: usize = 4;

/// Pixels between the taps of a level.
#[inline(always)]
pub(crate) const fn step_px(level: u32) -> usize {
    3usize.pow(level)
}

/// No history is as long.
const NEVER: f32 = 1e9;

/// F_i: the history length from which on each level does nothing; at most 1: there is no such level. What follows one that there is not is none.
pub(crate) fn ends(s: &YoungFilter, signal: Signal) -> [f32; LEVELS] {
    let fading = [s.frames, s.frames * s.falloff, s.frames * s.falloff * s.falloff];
    let (levels, [first, second, third], last) = match signal {
        Signal::Matte => (s.matte_levels, if s.matte_stays { [NEVER; 3] } else { fading }, s.wide_frames),
        Signal::Glossy => (s.glossy_levels, fading, 0.0),
    };
    let last = if third > 1.0 { last } else { 0.0 };
    let mut ends = [first, second, third, last];
    ends.iter_mut().skip(levels as usize).for_each(|end| *end = 0.0);
    ends
}

/// Whether a level hands on the noise: one follows that reads it.
#[cfg(feature = "cpu")]
pub(crate) fn hands_on(s: &YoungFilter, signal: Signal, level: u32) -> bool {
    s.deviations > 0.0 && ends(s, signal).get(level as usize + 1).is_some_and(|end| *end > 1.0)
}

/// Pixels between the taps of the last matte level that will run, where stage 5 reads what that leaves.
#[cfg(feature = "gpu")]
pub(crate) fn last_before_blend(s: &Settings) -> Option<usize> {
    let acting = ends(&s.young_filter, Signal::Matte).iter().filter(|end| **end > 1.0).count() as u32;
    (s.disocclusion.enabled && acting > 0).then(|| step_px(acting - 1))
}

/// How far a level looks.
pub(crate) fn reach(edge: &Edge, signal: Signal, level: u32) -> Reach {
    let beyond = if signal == Signal::Matte && edge.contact > 0.0 { 2 } else { 1 };
    Reach::around(beyond * step_px(level))
}

/// The part of s that depends on the history length; `end` is above 1.
#[inline(always)]
pub(crate) fn fade(length: f32, end: f32) -> f32 {
    let left = (end - length) * (1.0 / (end - 1.0));
    let left = if left < 1.0 { left } else { 1.0 };
    if left > 0.0 { left } else { 0.0 }
}

/// A lobe's footprint in distances between the taps of a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobe {
    /// Over the squared roughness: `lobe` 2 f / 3^i.
    gain: f32,
    /// `least_lobe` / 3^i.
    least: f32,
}

impl Lobe {
    /// For a focal length in pixels.
    pub(crate) fn new(s: &YoungFilter, focal_px: f32, level: u32) -> Self {
        let step = step_px(level) as f32;
        Self { gain: s.lobe * LOBE_SPREAD * focal_px / step, least: s.least_lobe / step }
    }

    /// The part of s that depends on the lobe.
    #[inline(always)]
    pub(crate) fn room(&self, roughness: f32) -> f32 {
        let room = self.gain * (roughness * roughness) + self.least;
        if room < 1.0 { room } else { 1.0 }
    }
}

/// How much a pixel counts: its frames, `most` at most.
#[inline(always)]
pub(crate) fn counted(length: f32, most: f32) -> f32 {
    if length < most { length } else { most }
}

/// Under this part of both luminances no difference counts: storage in halves rounds by a twentieth of it at most.
pub(crate) const SAME_LIGHT: f32 = 0.004;
/// Added to the variance of a difference: where both are black, nothing differs.
pub(crate) const LEAST_VARIANCE: f32 = 1e-30;
/// Neighbours, with the centre, from which a variance is known; fewer: the light itself is taken for its deviation.
pub(crate) const LEAST_NEIGHBOURS: f32 = 1.5;

/// The variance of the difference of two luminances over the squared contrast, by their frames: all that level 0 knows of the noise.
#[inline(always)]
pub(crate) fn prior((p, p_frames): (f32, f32), (q, q_frames): (f32, f32)) -> f32 {
    let mean = 0.5 * (p + q);
    mean * mean * ((p_frames + q_frames) / (p_frames * q_frames))
}

/// The variance of one frame's luminance over its squared mean, as far as level 0 knows, for the contact stop.
pub(crate) const OF_A_FRAME: f32 = 2.0;

/// What noise leaves of the contact stop `w` between two means of luminance; `variance`: of their difference; `part`: one over `contact_noise`.
#[inline(always)]
pub(crate) fn contact(w: f32, p: f32, q: f32, variance: f32, part: f32) -> f32 {
    let mean = 0.5 * (p + q);
    let left = 1.0 - variance * part / (mean * mean + LEAST_VARIANCE);
    let left = if left > 0.0 { left } else { 0.0 };
    1.0 - left * (1.0 - w)
}

/// C: the contrast of a signal's first level.
fn contrast(s: &YoungFilter, signal: Signal) -> f32 {
    match signal {
        Signal::Matte => s.matte_contrast,
        Signal::Glossy => s.glossy_contrast,
    }
}

/// The squared contrast that bounds the noise of a level: of the first level's own stop, of which further ones take a part; 0: none.
pub(crate) fn squared_contrast(s: &YoungFilter, signal: Signal, level: u32) -> f32 {
    let part = if level == 0 { 1.0 } else { s.further_contrast };
    (part * contrast(s, signal)).powi(2)
}

/// How much more noise than at the quieter pixel of a pair is believed.
pub(crate) const NOISE_ALIKE: f32 = 4.0;

/// The most that the variance of the difference of two luminances times the squared deviations counts in further levels: by the pair's
/// mean and the squared contrast, or by the lesser of the noises v, per frame. Each pixel is (l, v, frames).
#[inline(always)]
pub(crate) fn most_noise(p: (f32, f32, f32), q: (f32, f32, f32), squared: f32, contrast: f32) -> f32 {
    let mean = 0.5 * (p.0 + q.0);
    let (of_p, of_q) = (p.1 * p.2, q.1 * q.2);
    let found = NOISE_ALIKE * squared * if of_p < of_q { of_p } else { of_q };
    let allowed = contrast * (mean * mean);
    (if allowed > found { allowed } else { found }) * ((p.2 + q.2) / (p.2 * q.2))
}

/// The luminance stop between two means of luminance, from the sum of their noise's variances; `squared`: of `deviations`, on
/// level 0 of the contrast.
#[inline(always)]
pub(crate) fn stop(p: f32, q: f32, variance: f32, squared: f32) -> f32 {
    let (off, floor) = (p - q, SAME_LIGHT * (p + q));
    let most = squared * variance + floor * floor;
    let left = 1.0 - off * off / (most + LEAST_VARIANCE);
    let left = if left > 0.0 { left } else { 0.0 };
    left * left
}
