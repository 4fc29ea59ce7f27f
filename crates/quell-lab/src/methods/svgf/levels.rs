//! Sections 4.3 and 4.4: the edge-stopping wavelet, of colour and of variance, on vectors.

use super::super::surface::{DEPTH, GRADIENT, Guides, NORMAL, Rows};
use super::super::wavelet::{BLOCK, CENTRE, Lanes, exp_neg, load, taps};
use super::{Constants, DEPTH_EPSILON};
use crate::tone::luminance;
use fearless_simd::{Level, dispatch};

/// epsilon of the luminance weight.
const LUMINANCE_EPSILON: f32 = 1e-10;

/// cos^sigma_n with sigma_n = 128.
#[inline(always)]
pub(super) fn to_the_128th(cos: f32) -> f32 {
    let mut power = cos;
    for _ in 0..7 {
        power *= power;
    }
    power
}

/// Section 4.3 and 4.4: one level of the edge-stopping wavelet, of colour and of variance, for both signals at once.
pub(super) fn wavelet_level(
    simd: Level,
    constants: &Constants,
    step: usize,
    guides: &Guides,
    light: &Rows,
    out: &mut Rows,
) {
    let width = light.size().width;
    out.fill(|y, row| {
        for x in (0..width).step_by(BLOCK) {
            let len = BLOCK.min(width - x);
            let sums = dispatch!(simd, _simd => block(constants, step, guides, light, (x, y)));
            for (c, sums) in sums.iter().flatten().enumerate() {
                row[c * width + x..][..len].copy_from_slice(&sums[..len]);
            }
        }
    });
}

/// The block from (x, y) on: four channels of light for each signal.
#[inline(always)]
fn block(constants: &Constants, step: usize, guides: &Guides, light: &Rows, (x, y): (usize, usize)) -> [[Lanes; 4]; 2] {
    // What belongs to p: its guides, and 1 / (sigma_l sqrt(g3x3(Var)) + eps) for each signal.
    let surface = |c| load(guides.surface.row(y, c), x as isize, 0.0);
    let [z, nx, ny, nz] = [surface(DEPTH), surface(NORMAL), surface(NORMAL + 1), surface(NORMAL + 2)];
    let [gx, gy] = [0, 1].map(|axis| load(guides.slope.row(y, GRADIENT + axis), x as isize, 0.0));
    let scale = [3, 7].map(|c| luminance_scale(constants, light, c, (x, y)));
    let mut own = [[0.0; BLOCK]; 2];
    let mut sums = [[[0.0; BLOCK]; 4]; 2];
    for signal in 0..2 {
        let [r, g, b, v] = [0, 1, 2, 3].map(|c| load(light.row(y, 4 * signal + c), x as isize, 0.0));
        let [sr, sg, sb, sv] = &mut sums[signal];
        for i in 0..BLOCK {
            own[signal][i] = luminance([r[i], g[i], b[i]]);
            (sr[i], sg[i], sb[i]) = (CENTRE * r[i], CENTRE * g[i], CENTRE * b[i]);
            sv[i] = CENTRE * CENTRE * v[i];
        }
    }
    let mut weights = [[CENTRE; BLOCK]; 2];
    #[rustfmt::skip]
    taps(light.size(), step, (x, y), #[inline(always)] |tap| {
        // Outside the image the normal is 0, and so is the weight.
        let surface = |c| load(guides.surface.row(tap.y, c), tap.x, 0.0);
        let [qz, qnx, qny, qnz] = [surface(DEPTH), surface(NORMAL), surface(NORMAL + 1), surface(NORMAL + 2)];
        let [ox, oy] = tap.offset.map(|o| o * constants.sigma_z);
        // What both signals share: -ln w_z, and h w_n.
        let (mut off, mut share) = ([0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..BLOCK {
            off[i] = (z[i] - qz[i]).abs() / ((gx[i] * ox + gy[i] * oy).abs() + DEPTH_EPSILON * z[i]);
            let cos = nx[i] * qnx[i] + ny[i] * qny[i] + nz[i] * qnz[i];
            share[i] = tap.weight * to_the_128th(if cos > 0.0 { cos } else { 0.0 });
        }
        for signal in 0..2 {
            let [r, g, b, v] = [0, 1, 2, 3].map(|c| load(light.row(tap.y, 4 * signal + c), tap.x, 0.0));
            let (own, scale, weights) = (&own[signal], &scale[signal], &mut weights[signal]);
            let [sr, sg, sb, sv] = &mut sums[signal];
            for i in 0..BLOCK {
                let l = luminance([r[i], g[i], b[i]]);
                let w = share[i] * exp_neg(off[i] + (own[i] - l).abs() * scale[i]);
                weights[i] += w;
                sr[i] += w * r[i];
                sg[i] += w * g[i];
                sb[i] += w * b[i];
                sv[i] += w * w * v[i];
            }
        }
    });
    for signal in 0..2 {
        let [sr, sg, sb, sv] = &mut sums[signal];
        for i in 0..BLOCK {
            let norm = 1.0 / weights[signal][i];
            (sr[i], sg[i], sb[i]) = (sr[i] * norm, sg[i] * norm, sb[i] * norm);
            sv[i] *= norm * norm;
        }
    }
    sums
}

/// 1 / (sigma_l sqrt(g3x3(Var)) + eps), the variance in channel `c`; pixels outside the image do not count.
#[inline(always)]
fn luminance_scale(constants: &Constants, light: &Rows, c: usize, (x, y): (usize, usize)) -> Lanes {
    const GAUSSIAN: [f32; 3] = [0.25, 0.5, 0.25];
    let (mut sum, mut total) = ([0.0; BLOCK], [0.0; BLOCK]);
    for (dy, wy) in GAUSSIAN.into_iter().enumerate() {
        let Some(row) = (y + dy).checked_sub(1).filter(|&row| row < light.size().height) else { continue };
        for (dx, wx) in GAUSSIAN.into_iter().enumerate() {
            // A variance is not below 0: that marks what lies outside.
            let variance = load(light.row(row, c), x as isize + dx as isize - 1, -1.0);
            for i in 0..BLOCK {
                let w = if variance[i] >= 0.0 { wx * wy } else { 0.0 };
                sum[i] += w * variance[i];
                total[i] += w;
            }
        }
    }
    sum.iter_mut().zip(total).for_each(|(s, total)| {
        *s = 1.0 / (constants.sigma_l * (*s / total).sqrt() + LUMINANCE_EPSILON);
    });
    sum
}
