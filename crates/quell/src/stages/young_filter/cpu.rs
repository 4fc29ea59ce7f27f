//! The filter of young history on runs of pixels.

use super::{LEAST_NEIGHBOURS, Lobe, OF_A_FRAME, contact, counted, fade, most_noise, prior, stop};
use crate::kernels::edge_cpu::{RUN, Run};
use crate::kernels::math::luminance;

/// Fade and frames of a run of pixels; says whether any of them is filtered.
#[inline(always)]
pub(crate) fn shares(
    length: &[f32],
    roughness: &[f32],
    (end, lobe, most): (f32, Option<Lobe>, f32),
    share: &mut Run,
    frames: &mut Run,
) -> bool {
    let n = length.len();
    let (roughness, share, frames) = (&roughness[..n], &mut share[..n], &mut frames[..n]);
    let mut any = 0.0;
    for i in 0..n {
        let room = lobe.map_or(1.0, |lobe| lobe.room(roughness[i]));
        share[i] = fade(length[i], end) * room;
        frames[i] = counted(length[i], most);
        any += share[i];
    }
    any > 0.0
}

/// From a tap's edge weights to its weights: times the centre's share and the tap's own frames.
#[inline(always)]
pub(crate) fn by_frames(weights: &mut [f32], share: &[f32], length: &[f32], most: f32) {
    let n = weights.len();
    let (share, length) = (&share[..n], &length[..n]);
    for i in 0..n {
        weights[i] *= share[i] * counted(length[i], most);
    }
}

/// The filtered channel; background, and what has history enough, passes through. `part`: of one unit of weight.
#[inline(always)]
pub(crate) fn finish(sums: &[f32], part: &[f32], share: &[f32], depth: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, part, share) = (&sums[..n], &part[..n], &share[..n]);
    let (depth, centre) = (&depth[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] * part[i];
        out[i] = if (depth[i] < f32::INFINITY) & (share[i] > 0.0) { mean } else { centre[i] };
    }
}

/// Luminance of a run.
#[inline(always)]
pub(crate) fn luminances([r, g, b]: [&[f32]; 3], out: &mut [f32]) {
    let n = out.len();
    let (r, g, b) = (&r[..n], &g[..n], &b[..n]);
    for i in 0..n {
        out[i] = luminance([r[i], g[i], b[i]]);
    }
}

/// What level 0 gathers of a run's taps to know the noise. Luminances are differences to the centre's: nothing cancels.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Spread {
    /// Sums of edge weights w and of their squares, with the centre's.
    edges: [Run; 2],
    /// Sums of w N, w N x and w N x^2, with the centre's.
    moments: [Run; 3],
    /// Sum of w^2 N, without the centre's.
    squares: Run,
}

impl Spread {
    pub fn new() -> Self {
        Self { edges: [[1.0; RUN]; 2], moments: [[0.0; RUN]; 3], squares: [0.0; RUN] }
    }

    /// The centre alone; `frames`: N.
    #[inline(always)]
    pub fn begin(&mut self, frames: &[f32]) {
        let n = frames.len();
        self.edges = [[1.0; RUN]; 2];
        self.moments[0][..n].copy_from_slice(frames);
        self.moments[1] = [0.0; RUN];
        self.moments[2] = [0.0; RUN];
        self.squares = [0.0; RUN];
    }

    /// Adds a tap from lane `first` on: edge weights, history lengths, luminances of the taps and of the centres. What it adds to
    /// the variance of the mean: [`Spread::square`].
    #[inline(always)]
    pub fn add(&mut self, first: usize, weights: &[f32], length: &[f32], most: f32, (q, p): (&[f32], &[f32])) {
        let n = weights.len();
        let (length, q, p) = (&length[..n], &q[..n], &p[..n]);
        let [edges, edge_squares] = &mut self.edges;
        let [m0, m1, m2] = &mut self.moments;
        let (edges, edge_squares) = (&mut edges[first..][..n], &mut edge_squares[first..][..n]);
        let (m0, m1, m2) = (&mut m0[first..][..n], &mut m1[first..][..n], &mut m2[first..][..n]);
        for i in 0..n {
            let w = weights[i];
            let framed = w * counted(length[i], most);
            let x = q[i] - p[i];
            edges[i] += w;
            edge_squares[i] += w * w;
            m0[i] += framed;
            m1[i] += framed * x;
            m2[i] += framed * x * x;
        }
    }

    /// Adds a tap's part to the variance of the mean, from lane `first` on: edge weights, and what of them the first stop leaves.
    #[inline(always)]
    pub fn square(&mut self, first: usize, (weights, like): (&[f32], &[f32]), length: &[f32], most: f32) {
        let n = weights.len();
        let (like, length, squares) = (&like[..n], &length[..n], &mut self.squares[first..][..n]);
        for i in 0..n {
            let weight = weights[i] * like[i];
            squares[i] += weight * (weight * counted(length[i], most));
        }
    }

    /// The sums of w^2 N from lane `first` on.
    #[inline(always)]
    pub fn squares(&mut self, first: usize) -> &mut [f32] {
        &mut self.squares[first..]
    }

    /// The variance of the filtered luminance. `part`: one over the sum of the weights of the mean; `own`: the centres' weights
    /// in it; `light`: their luminance.
    #[inline(always)]
    pub fn finish(
        &self,
        (part, share, frames): (&[f32], &[f32], &[f32]),
        own: &[f32],
        depth: &[f32],
        light: &[f32],
        out: &mut [f32],
    ) {
        let n = out.len();
        let (part, share, frames) = (&part[..n], &share[..n], &frames[..n]);
        let (own, depth, light) = (&own[..n], &depth[..n], &light[..n]);
        let [edges, edge_squares] = self.edges.each_ref().map(|v| &v[..n]);
        let [m0, m1, m2] = self.moments.each_ref().map(|v| &v[..n]);
        let squares = &self.squares[..n];
        for i in 0..n {
            let count = edges[i] * edges[i] / edge_squares[i];
            let spread = m2[i] - m1[i] * m1[i] / m0[i];
            let spread = if spread > 0.0 { spread } else { 0.0 };
            let known = count >= LEAST_NEIGHBOURS;
            let unbiased = count / if known { count - 1.0 } else { 1.0 };
            let of_a_frame = if known { spread / edges[i] * unbiased } else { frames[i] * (light[i] * light[i]) };
            let sum = of_a_frame * (own[i] * (own[i] / frames[i]) + share[i] * share[i] * squares[i]);
            out[i] = if depth[i] < f32::INFINITY { sum * part[i] * part[i] } else { light[i] * light[i] };
        }
    }
}

/// The luminance stop of a tap; luminances and variances of the taps and of the centres.
#[inline(always)]
pub(crate) fn refuse(weights: &mut [f32], light: (&[f32], &[f32]), noise: (&[f32], &[f32]), squared: f32) {
    let n = weights.len();
    let (lq, lp) = (&light.0[..n], &light.1[..n]);
    let (vq, vp) = (&noise.0[..n], &noise.1[..n]);
    for i in 0..n {
        weights[i] *= stop(lp[i], lq[i], vp[i] + vq[i], squared);
    }
}

/// The same where the noise counts no more than `most_noise` says; `most`: frames that count, `contrast`: squared.
#[inline(always)]
pub(crate) fn refuse_within(
    weights: &mut [f32],
    light: (&[f32], &[f32]),
    noise: (&[f32], &[f32]),
    (length, frames): (&[f32], &[f32]),
    (most, squared, contrast): (f32, f32, f32),
) {
    let n = weights.len();
    let (lq, lp) = (&light.0[..n], &light.1[..n]);
    let (vq, vp) = (&noise.0[..n], &noise.1[..n]);
    let (length, frames) = (&length[..n], &frames[..n]);
    for i in 0..n {
        let found = squared * (vp[i] + vq[i]);
        let (p, q) = ((lp[i], vp[i], frames[i]), (lq[i], vq[i], counted(length[i], most)));
        let bound = most_noise(p, q, squared, contrast);
        weights[i] *= stop(lp[i], lq[i], if found < bound { found } else { bound }, 1.0);
    }
}

/// Times what noise leaves of the contact stop; luminances and variances of the taps and of the centres.
#[inline(always)]
pub(crate) fn contact_by_noise(
    weights: &mut [f32],
    stops: &[f32],
    light: (&[f32], &[f32]),
    noise: (&[f32], &[f32]),
    part: f32,
) {
    let n = weights.len();
    let (stops, lq, lp) = (&stops[..n], &light.0[..n], &light.1[..n]);
    let (vq, vp) = (&noise.0[..n], &noise.1[..n]);
    for i in 0..n {
        weights[i] *= contact(stops[i], lp[i], lq[i], vp[i] + vq[i], part);
    }
}

/// The same where the noise is not known, by the frames of the taps and of the centres.
#[inline(always)]
pub(crate) fn contact_by_prior(
    weights: &mut [f32],
    stops: &[f32],
    light: (&[f32], &[f32]),
    (length, frames): (&[f32], &[f32]),
    (most, part): (f32, f32),
) {
    let n = weights.len();
    let (stops, lq, lp) = (&stops[..n], &light.0[..n], &light.1[..n]);
    let (length, frames) = (&length[..n], &frames[..n]);
    for i in 0..n {
        let variance = OF_A_FRAME * prior((lp[i], frames[i]), (lq[i], counted(length[i], most)));
        weights[i] *= contact(stops[i], lp[i], lq[i], variance, part);
    }
}

/// The first level's luminance stop of a tap, in `like`; luminances and frames of the taps and of the centres, `squared`: of the contrast.
#[inline(always)]
pub(crate) fn alike(
    like: &mut [f32],
    light: (&[f32], &[f32]),
    (length, frames): (&[f32], &[f32]),
    most: f32,
    squared: f32,
) {
    let n = like.len();
    let (lq, lp) = (&light.0[..n], &light.1[..n]);
    let (length, frames) = (&length[..n], &frames[..n]);
    for i in 0..n {
        let variance = prior((lp[i], frames[i]), (lq[i], counted(length[i], most)));
        like[i] = stop(lp[i], lq[i], variance, squared);
    }
}

/// Leaves of a tap's weights what is alike; `refused` takes the rest, the centres' part of it.
#[inline(always)]
pub(crate) fn divide(weights: &mut [f32], like: &[f32], refused: &mut [f32]) {
    let n = weights.len();
    let (like, refused) = (&like[..n], &mut refused[..n]);
    for i in 0..n {
        let left = weights[i] * like[i];
        refused[i] += weights[i] - left;
        weights[i] = left;
    }
}

/// Adds a tap's part to the variance of the mean.
#[inline(always)]
pub(crate) fn vary(weights: &[f32], noise: &[f32], sums: &mut [f32]) {
    let n = weights.len();
    let (noise, sums) = (&noise[..n], &mut sums[..n]);
    for i in 0..n {
        sums[i] += weights[i] * weights[i] * noise[i];
    }
}

/// The variance of the filtered luminance from those parts; `centre`: as the level before left it.
#[inline(always)]
pub(crate) fn varied(sums: &[f32], part: &[f32], depth: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, part, depth, centre) = (&sums[..n], &part[..n], &depth[..n], &centre[..n]);
    for i in 0..n {
        out[i] = if depth[i] < f32::INFINITY { sums[i] * part[i] * part[i] } else { centre[i] };
    }
}

/// From the sums of a run's edge weights to what they lack to 1, of pixels that neighbours of other surfaces may help; says whether any
/// lacks something.
#[inline(always)]
pub(crate) fn lacking(sums: &mut [f32], (frames, share): (&[f32], &[f32]), depth: &[f32], most: f32) -> bool {
    let n = sums.len();
    let (frames, share, depth) = (&frames[..n], &share[..n], &depth[..n]);
    let mut any = 0.0;
    for i in 0..n {
        let lack = if sums[i] < 1.0 { 1.0 - sums[i] } else { 0.0 };
        let helped = (frames[i] < most) & (share[i] > 0.0) & (depth[i] < f32::INFINITY);
        sums[i] = if helped { lack } else { 0.0 };
        any += sums[i];
    }
    any > 0.0
}

/// A tap of a run where it counts though it shows another surface.
pub(crate) struct Others<'a> {
    /// Of the centres: what [`lacking`] found, the neighbours' share, their frames.
    pub lack: &'a [f32],
    pub share: &'a [f32],
    pub frames: &'a [f32],
    /// Of the taps: history length, depth, and 1 where there is one.
    pub length: &'a [f32],
    pub depth: &'a [f32],
    pub there: &'a [f32],
}

impl Others<'_> {
    /// Adds to the tap's weights, to their sums, and to [`Spread`]'s sums of squares. `isolated`: the parameter.
    #[inline(always)]
    pub fn add(&self, (isolated, most): (f32, f32), weights: &mut [f32], total: &mut [f32], squares: &mut [f32]) {
        let n = weights.len();
        let (lack, share, frames) = (&self.lack[..n], &self.share[..n], &self.frames[..n]);
        let (length, depth, there) = (&self.length[..n], &self.depth[..n], &self.there[..n]);
        let (total, squares) = (&mut total[..n], &mut squares[..n]);
        for i in 0..n {
            let length = counted(length[i], most);
            let left = isolated - frames[i];
            let added = lack[i] * if length < left { length } else { left };
            let adds = (lack[i] > 0.0) & (there[i] > 0.0) & (depth[i] < f32::INFINITY);
            let added = if adds { added } else { 0.0 };
            // The squares are of weights without the share, which is above 0 where something is added.
            let whole = share[i] * added;
            squares[i] += if adds { added * (2.0 * weights[i] / share[i] + added) / length } else { 0.0 };
            weights[i] += whole;
            total[i] += whole;
        }
    }
}
