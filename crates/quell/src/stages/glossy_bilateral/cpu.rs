//! Stages 9 and 10 on runs of pixels.

use super::{KernelSize, LOBE_SPREAD};
use crate::kernels::math::exp_negative;
use crate::settings::{GlossyBilateral, GlossyRadius};

/// 1 / (1 + l / d) of each pixel; parallel rays: d itself.
#[inline(always)]
pub(crate) fn nearness(perspective: bool, depth: &[f32], hit: &[f32], out: &mut [f32]) {
    if !perspective {
        out.copy_from_slice(hit);
        return;
    }
    let n = out.len();
    let (depth, hit) = (&depth[..n], &hit[..n]);
    for i in 0..n {
        out[i] = 1.0 / (1.0 + depth[i] / hit[i]);
    }
}

/// Adds the nearness of those neighbours that are surfaces of the same object, and counts them.
#[inline(always)]
pub(crate) fn add_neighbours(
    (depth, id, nearness): (&[f32], &[u32], &[f32]),
    own: &[u32],
    sum: &mut [f32],
    count: &mut [f32],
) {
    let n = sum.len();
    let (depth, id, nearness, own, count) = (&depth[..n], &id[..n], &nearness[..n], &own[..n], &mut count[..n]);
    for i in 0..n {
        let same = (id[i] == own[i]) & (depth[i] < f32::INFINITY);
        sum[i] = if same { sum[i] + nearness[i] } else { sum[i] };
        count[i] = if same { count[i] + 1.0 } else { count[i] };
    }
}

/// Radii in pixels; 0: pass through. `nearness`: mean over the neighbours; `focal_px`: the camera's.
#[inline(always)]
pub(crate) fn radii(
    settings: &GlossyBilateral,
    size: &KernelSize,
    focal_px: f32,
    has_roughness: bool,
    (depth, roughness, nearness): (&[f32], &[f32], &[f32]),
    out: &mut [f32],
) {
    let n = out.len();
    let (depth, roughness, nearness) = (&depth[..n], &roughness[..n], &nearness[..n]);
    match settings.radius {
        GlossyRadius::Constant => out.fill(size.constant_radius_px),
        GlossyRadius::Footprint if !has_roughness => out.fill(size.max_radius_px),
        GlossyRadius::Footprint => {
            for i in 0..n {
                let spread = LOBE_SPREAD * roughness[i] * roughness[i] * focal_px;
                let radius = spread * nearness[i];
                // As `min` of the standard library: a NaN (0 times infinity) gives the limit.
                out[i] = if radius < size.max_radius_px { radius } else { size.max_radius_px };
            }
        }
    }
    for i in 0..n {
        // Background passes through.
        let filtered = (out[i] >= settings.min_radius) & (depth[i] < f32::INFINITY);
        out[i] = if filtered { out[i] } else { 0.0 };
    }
}

/// -1 / (2 sigma^2) of a run, `sigma` the share of the radius.
#[inline(always)]
pub(crate) fn exponents(sigma: f32, radius: &[f32], out: &mut [f32]) {
    for (out, radius) in out.iter_mut().zip(radius) {
        let deviation = sigma * radius;
        *out = -1.0 / (2.0 * deviation * deviation);
    }
}

/// The Gaussian of a tap `offset` pixels away; 0 beyond the radius.
#[inline(always)]
pub(crate) fn gaussian(offset: f32, exponent: &[f32], radius: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (exponent, radius) = (&exponent[..n], &radius[..n]);
    for i in 0..n {
        let g = exp_negative(offset * offset * exponent[i]);
        out[i] = if offset > radius[i] { 0.0 } else { g };
    }
}

/// From edge weights to weights, and their sum. `ceiling`: the least edge weight so far on the way outwards, where
/// weights may only fall.
#[inline(always)]
pub(crate) fn admit(gaussian: &[f32], ceiling: Option<&mut [f32]>, weights: &mut [f32], total: &mut [f32]) {
    let n = weights.len();
    if let Some(ceiling) = ceiling {
        for (w, ceiling) in weights.iter_mut().zip(ceiling) {
            *ceiling = if *w < *ceiling { *w } else { *ceiling };
            *w = *ceiling;
        }
    }
    let (gaussian, total) = (&gaussian[..n], &mut total[..n]);
    for i in 0..n {
        // A radius of 0 has no Gaussian: its exponent is infinite.
        let w = weights[i] * gaussian[i];
        let w = if w > 0.0 { w } else { 0.0 };
        weights[i] = w;
        total[i] += w;
    }
}

/// The filtered channel; pixels without a kernel pass through to the bit.
#[inline(always)]
pub(crate) fn finish(sums: &[f32], total: &[f32], radius: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, total, radius, centre) = (&sums[..n], &total[..n], &radius[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] / total[i];
        out[i] = if radius[i] > 0.0 { mean } else { centre[i] };
    }
}
