//! Stages 9 and 10 on runs of pixels.

use super::{KernelSize, LOBE_SPREAD};
use crate::kernels::math::{exp_negative, three};
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

/// The squared change of the normal to a neighbour along the axis, where it shows the same object and changes most.
#[inline(always)]
pub(crate) fn bend_to(
    (depth, id, normal): (&[f32], &[u32], [&[f32]; 3]),
    (own, own_normal): (&[u32], [&[f32]; 3]),
    most: &mut [f32],
) {
    let n = most.len();
    let (depth, id, own) = (&depth[..n], &id[..n], &own[..n]);
    let (normal, own_normal) = (normal.map(|c| &c[..n]), own_normal.map(|c| &c[..n]));
    for i in 0..n {
        let [x, y, z] = three(|c| normal[c][i] - own_normal[c][i]);
        let squared = x * x + y * y + z * z;
        let larger = (id[i] == own[i]) & (depth[i] < f32::INFINITY) & (squared > most[i]);
        most[i] = if larger { squared } else { most[i] };
    }
}

/// Radii in pixels; 0: pass through. `nearness`: mean over the neighbours; `bend`: squared change of the normal;
/// `focal_px`: the camera's.
#[inline(always)]
pub(crate) fn radii(
    settings: &GlossyBilateral,
    size: &KernelSize,
    focal_px: f32,
    has_roughness: bool,
    (depth, roughness, nearness, bend): (&[f32], &[f32], &[f32], &[f32]),
    out: &mut [f32],
) {
    let n = out.len();
    let (depth, roughness, nearness, bend) = (&depth[..n], &roughness[..n], &nearness[..n], &bend[..n]);
    match settings.radius {
        GlossyRadius::Constant => out.fill(size.constant_radius_px),
        GlossyRadius::Footprint if !has_roughness => out.fill(size.max_radius_px),
        GlossyRadius::Footprint => {
            for i in 0..n {
                let spread = LOBE_SPREAD * roughness[i] * roughness[i] * focal_px;
                let radius = spread / (1.0 / nearness[i] + 2.0 * focal_px * bend[i].sqrt());
                // As `min` of the standard library: a NaN gives the limit.
                let radius = if radius < size.max_radius_px { radius } else { size.max_radius_px };
                out[i] = if spread > 0.0 { radius } else { 0.0 };
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

/// Shares of the radius from which on [`gaussian`] falls by no more than e^2 within it.
pub(crate) const GENTLE_SIGMA: f32 = 0.5;

/// The Gaussian of a tap `offset` pixels away; 0 beyond the radius. `GENTLE`: sigma is at least [`GENTLE_SIGMA`].
#[inline(always)]
pub(crate) fn gaussian<const GENTLE: bool>(offset: f32, exponent: &[f32], radius: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (exponent, radius) = (&exponent[..n], &radius[..n]);
    for i in 0..n {
        let x = offset * offset * exponent[i];
        let g = if GENTLE { exp_gentle(x) } else { exp_negative(x) };
        out[i] = if offset > radius[i] { 0.0 } else { g };
    }
}

/// e^x for -2 <= x <= 0, relative error under 3e-6: e^-1 times the fourth power of e^((x + 1) / 4) by Taylor's series.
/// Half the work of [`exp_negative`]; of no meaning beyond.
#[inline(always)]
fn exp_gentle(x: f32) -> f32 {
    const INVERSE_E: f32 = 0.367_879_44;
    let t = 0.25 * x + 0.25;
    let p = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0)))));
    let squared = p * p;
    INVERSE_E * squared * squared
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

/// The filtered channel; pixels without a kernel pass through to the bit. `share`: of one unit of weight.
#[inline(always)]
pub(crate) fn finish(sums: &[f32], share: &[f32], radius: &[f32], centre: &[f32], out: &mut [f32]) {
    let n = out.len();
    let (sums, share, radius, centre) = (&sums[..n], &share[..n], &radius[..n], &centre[..n]);
    for i in 0..n {
        let mean = sums[i] * share[i];
        out[i] = if radius[i] > 0.0 { mean } else { centre[i] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gentle_exponential_is_as_good_as_it_says() {
        for i in 0..=2000 {
            let x = -1e-3 * i as f32;
            let exact = f64::from(x).exp();
            assert!((f64::from(exp_gentle(x)) / exact - 1.0).abs() < 3e-6, "{x}");
        }
    }
}
