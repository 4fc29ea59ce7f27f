//! Edge-avoiding a-trous wavelets (Dammertz, Sewtz, Hanika, Lensch: "Edge-Avoiding A-Trous Wavelet Transform for fast
//! Global Illumination Filtering", HPG 2010): each frame by itself, no history.
//!
//! Light is filtered without albedo (section 4); matte and glossy separately, with their own colour weights.

use super::surface::{BACKGROUND, DEPTH, FAR, Guides, NORMAL, Rows, positions, signals};
use super::wavelet::{BLOCK, CENTRE, Lanes, exp_neg, load, taps};
use super::{Input, Method, composite};
use crate::error::Error;
use crate::tone::luminance;
use fearless_simd::{Level, dispatch};
use quell::{Plane, Rgb};

/// The three sigmas of equations 6 to 8, which the paper leaves to the scene, in units that scale with it; and the levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Levels of the wavelet; level i has taps 2^i pixels apart.
    pub levels: usize,
    /// sigma_rt of the first level, in units of the signal's mean luminance over the frame's surfaces; halves every
    /// level.
    pub colour: f32,
    /// sigma_n.
    pub normal: f32,
    /// sigma_x, as a part of the view depth.
    pub position: f32,
}

impl Default for Constants {
    /// Fitted: docs/baselines.md.
    fn default() -> Self {
        Self { levels: 5, colour: 50.0, normal: 0.28, position: 0.07 }
    }
}

/// Channels: red, green, blue of matte, then of glossy.
const LIGHT: usize = 6;

/// The method.
pub struct Atrous {
    constants: Constants,
    level: Level,
    buffers: Option<Buffers>,
}

struct Buffers {
    guides: Guides,
    position: Rows,
    light: Rows,
    next: Rows,
}

impl Default for Atrous {
    fn default() -> Self {
        Self::new(Constants::default())
    }
}

impl Atrous {
    /// With other constants than the fitted ones.
    pub fn new(constants: Constants) -> Self {
        Self { constants, level: Level::new(), buffers: None }
    }
}

impl Method for Atrous {
    fn name(&self) -> String {
        "atrous".to_owned()
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let frame = input.frame;
        let rows = |channels| Rows::new(frame.size, channels);
        let kept = self.buffers.take().filter(|b| b.guides.size() == frame.size);
        let mut buffers = kept.unwrap_or_else(|| Buffers {
            guides: Guides::new(frame.size),
            position: rows(3),
            light: rows(LIGHT),
            next: rows(LIGHT),
        });
        let Buffers { guides, position, light, next } = &mut buffers;
        guides.read(frame);
        signals(frame, light);
        positions(frame, guides, position);
        let mut sigma_colour = mean_luminances(light, guides).map(|mean| self.constants.colour * mean);
        for level in 0..self.constants.levels {
            let inverse = sigma_colour.map(|s| if s > 0.0 { 1.0 / (s * s) } else { 0.0 });
            let (simd, constants, width) = (self.level, &self.constants, frame.size.width);
            next.fill(|y, row| {
                for x in (0..width).step_by(BLOCK) {
                    let len = BLOCK.min(width - x);
                    let sums = dispatch!(simd, _simd => block(constants, 1 << level, inverse, guides, position, light, (x, y)));
                    for (c, sums) in sums.iter().flatten().enumerate() {
                        row[c * width + x..][..len].copy_from_slice(&sums[..len]);
                    }
                }
            });
            std::mem::swap(light, next);
            sigma_colour = sigma_colour.map(|s| 0.5 * s);
        }
        let [matte, glossy] = [0, 3].map(|c| light.picture(c));
        self.buffers = Some(buffers);
        Ok(composite(frame, Some(matte.view()), Some(glossy.view())))
    }
}

/// Mean luminance of both signals over all surfaces.
fn mean_luminances(light: &Rows, guides: &Guides) -> [f32; 2] {
    let quell::Size { width, height } = light.size();
    let (mut sums, mut count) = ([0.0f64; 2], 0u64);
    for y in 0..height {
        for x in (0..width).filter(|&x| guides.is_surface(x, y)) {
            count += 1;
            for (signal, sum) in sums.iter_mut().enumerate() {
                *sum += f64::from(luminance(std::array::from_fn(|c| light.at(x, y, 3 * signal + c))));
            }
        }
    }
    sums.map(|sum| (sum / count.max(1) as f64) as f32)
}

/// Equations 5 to 8 for the block from (x, y) on: w = w_rt w_n w_x, each min(1, exp(-|difference|^2 / sigma^2)); the
/// distance of normals is divided by step^2.
#[inline(always)]
fn block(
    constants: &Constants,
    step: usize,
    inverse_colour: [f32; 2],
    guides: &Guides,
    position: &Rows,
    light: &Rows,
    (x, y): (usize, usize),
) -> [[Lanes; 3]; 2] {
    let own = |rows: &Rows, c| load(rows.row(y, c), x as isize, 0.0);
    let [nx, ny, nz] = [0, 1, 2].map(|c| own(&guides.surface, NORMAL + c));
    let [px, py, pz] = [0, 1, 2].map(|c| own(position, c));
    let own_light = [[0, 1, 2], [3, 4, 5]].map(|signal| signal.map(|c| own(light, c)));
    let inverse_normal = 1.0 / (constants.normal * constants.normal * (step * step) as f32);
    let mut inverse_position = own(&guides.surface, DEPTH);
    for z in &mut inverse_position {
        let sigma = constants.position * *z;
        *z = if *z < BACKGROUND { 1.0 / (sigma * sigma) } else { 1.0 };
    }
    let mut sums = own_light;
    sums.iter_mut().flatten().flatten().for_each(|s| *s *= CENTRE);
    let mut weights = [[CENTRE; BLOCK]; 2];
    let squared = |a: f32, b: f32, c: f32| a * a + b * b + c * c;
    #[rustfmt::skip]
    taps(light.size(), step, (x, y), #[inline(always)] |tap| {
        let load = |rows: &Rows, c, outside| load(rows.row(tap.y, c), tap.x, outside);
        let [qnx, qny, qnz] = [0, 1, 2].map(|c| load(&guides.surface, NORMAL + c, 0.0));
        // Outside the image is far away: weight 0.
        let [qx, qy, qz] = [0, 1, 2].map(|c| load(position, c, -FAR));
        let mut surface = [0.0; BLOCK];
        for i in 0..BLOCK {
            surface[i] = squared(nx[i] - qnx[i], ny[i] - qny[i], nz[i] - qnz[i]) * inverse_normal
                + squared(px[i] - qx[i], py[i] - qy[i], pz[i] - qz[i]) * inverse_position[i];
        }
        for signal in 0..2 {
            let [pr, pg, pb] = &own_light[signal];
            let [r, g, b] = [0, 1, 2].map(|c| load(light, 3 * signal + c, 0.0));
            let (weights, inverse) = (&mut weights[signal], inverse_colour[signal]);
            let [sr, sg, sb] = &mut sums[signal];
            for i in 0..BLOCK {
                let colour = squared(pr[i] - r[i], pg[i] - g[i], pb[i] - b[i]) * inverse;
                let w = tap.weight * exp_neg(surface[i] + colour);
                weights[i] += w;
                sr[i] += w * r[i];
                sg[i] += w * g[i];
                sb[i] += w * b[i];
            }
        }
    });
    for signal in 0..2 {
        for sums in &mut sums[signal] {
            for i in 0..BLOCK {
                sums[i] /= weights[signal][i];
            }
        }
    }
    sums
}
