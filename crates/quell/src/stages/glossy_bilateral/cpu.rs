//! Stages 9 and 10 on runs of pixels.

use super::{KernelSize, LOBE_SPREAD};
use crate::kernels::edge_cpu::{RUN, Run};
use crate::kernels::math::exp_negative;
use crate::settings::{GlossyBilateral, GlossyRadius};

/// Radii of a run of pixels, in pixels; 0: pass through. `hit`: empty where the host gave no hit distance;
/// `focal_px`, `perspective`: the camera's.
#[inline(always)]
pub(crate) fn radii(
    settings: &GlossyBilateral,
    size: &KernelSize,
    (focal_px, perspective): (f32, bool),
    has_roughness: bool,
    (depth, roughness, hit): (&[f32], &[f32], &[f32]),
    out: &mut [f32],
) {
    let n = out.len();
    let (depth, roughness) = (&depth[..n], &roughness[..n]);
    match settings.radius {
        GlossyRadius::Constant => out.fill(size.constant_radius_px),
        GlossyRadius::Footprint if !has_roughness => out.fill(size.max_radius_px),
        GlossyRadius::Footprint => {
            for i in 0..n {
                let spread = LOBE_SPREAD * roughness[i] * roughness[i] * focal_px;
                let hit = if hit.is_empty() { f32::INFINITY } else { hit[i] };
                let nearness = if perspective { 1.0 / (1.0 + depth[i] / hit) } else { hit };
                let radius = spread * nearness;
                // As `min` of the standard library: a NaN (0 times infinity) gives the limit.
                out[i] = if radius < size.max_radius_px { radius } else { size.max_radius_px };
            }
        }
    }
    for i in 0..n {
        if out[i] < settings.min_radius {
            out[i] = 0.0;
        }
        if depth[i] == f32::INFINITY {
            out[i] = 0.0; // background passes through
        }
    }
}

/// -1 / (2 sigma^2) of a run, `sigma` the share of the radius.
#[inline(always)]
pub(crate) fn exponents(sigma: f32, radius: &Run) -> Run {
    let mut out = [0.0; RUN];
    for i in 0..RUN {
        let deviation = sigma * radius[i];
        out[i] = -1.0 / (2.0 * deviation * deviation);
    }
    out
}

/// The Gaussian of a tap `offset` pixels away; 0 beyond the radius.
#[inline(always)]
pub(crate) fn gaussian(offset: f32, exponent: &Run, radius: &Run) -> Run {
    let mut out = [0.0; RUN];
    for i in 0..RUN {
        let g = exp_negative(offset * offset * exponent[i]);
        out[i] = if offset > radius[i] { 0.0 } else { g };
    }
    out
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
