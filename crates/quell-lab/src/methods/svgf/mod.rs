//! Spatiotemporal Variance-Guided Filtering (Schied, Kaplanyan, Wyman, Patney, Chaitanya, Burgess, Liu, Dachsbacher,
//! Lefohn, Salvi: "Spatiotemporal Variance-Guided Filtering: Real-Time Reconstruction for Path-Traced Global
//! Illumination", HPG 2017).
//!
//! The paper filters direct and indirect light separately and without albedo; here these are matte and glossy. Its last
//! stage, temporal anti-aliasing, is left out, since frames have no jitter as a rule; `svgf+taa` has quell's.
//! Departures: `docs/baselines.md`.

mod levels;

use self::levels::{to_the_128th, wavelet_level};
use super::surface::{DEPTH, GRADIENT, Guides, Reprojection, Rows, Taps, signals};
use super::wavelet::exp_neg;
use super::{Input, Method, composite};
use crate::error::Error;
use crate::tone::luminance;
use fearless_simd::Level;
use quell::{Frame, Plane, Rgb, Size};

/// The parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Least weight of the newest frame's colour.
    pub colour_alpha: f32,
    /// Least weight of the newest frame's moments.
    pub moments_alpha: f32,
    /// Levels of the wavelet.
    pub levels: usize,
    /// The level whose output is the next frame's history, from 0.
    pub feedback: usize,
    /// Differences of depth, in sizes of what the slope explains.
    pub sigma_z: f32,
    /// Differences of luminance, in standard deviations.
    pub sigma_l: f32,
}

impl Constants {
    /// Section 4 of the paper; sigma_n is 128 always.
    pub const PAPER: Self =
        Self { colour_alpha: 0.2, moments_alpha: 0.2, levels: 5, feedback: 0, sigma_z: 1.0, sigma_l: 4.0 };
    /// The defaults of the code that the authors published later.
    pub const LATER: Self =
        Self { colour_alpha: 0.05, moments_alpha: 0.2, levels: 4, feedback: 1, sigma_z: 1.0, sigma_l: 10.0 };
}

/// Names and constants.
pub const VARIANTS: &[(&str, Constants)] = &[("svgf", Constants::PAPER), ("svgf:later", Constants::LATER)];

/// Frames that are counted at most.
const LONGEST: f32 = 32.0;
/// Histories shorter than this estimate variance in space (section 4.2).
const SHORT: f32 = 4.0;
/// Their window is 7x7.
const SHORT_RADIUS: isize = 3;
/// epsilon of the depth weight, as a part of the view depth: rounding, and what bends.
const DEPTH_EPSILON: f32 = 1e-3;

/// Channels of filtered light: red, green, blue, variance of luminance; matte, then glossy.
const LIGHT: usize = 8;
/// Channels of moments: mu1, mu2 of matte, of glossy, and the number of frames.
const MOMENTS: usize = 5;
const LENGTH: usize = 4;

/// The method.
pub struct Svgf {
    name: String,
    constants: Constants,
    level: Level,
    state: Option<State>,
}

struct State {
    index: i64,
    /// The frame before.
    guides: Guides,
    history: Rows,
    moments: Rows,
    /// Buffers of this frame.
    now: (Guides, Rows, Rows),
    noisy: Rows,
    scratch: Rows,
}

impl Svgf {
    /// The paper's, or `svgf:later` with the constants of the code that the authors published afterwards.
    pub fn new(name: &str, constants: Constants) -> Self {
        Self { name: name.to_owned(), constants, level: Level::new(), state: None }
    }

    /// Filters a frame up to the variance estimate: accumulated light with variance, and moments.
    fn accumulate(&self, frame: &Frame<'_>, state: &mut State, follows: bool) {
        let width = frame.size.width;
        let (guides, light, moments) = &mut state.now;
        guides.read(frame);
        signals(frame, &mut state.noisy);
        let reprojection = follows.then(|| Reprojection::new(frame, guides, &state.guides));
        let (noisy, history, old_moments) = (&state.noisy, &state.history, &state.moments);
        light.fill_both(moments, |y, light, moments| {
            for x in 0..width {
                let taps = reprojection.as_ref().map(|r| r.taps(x, y)).unwrap_or_default();
                self.accumulate_pixel(x, width, &taps, history, old_moments, |c| noisy.at(x, y, c), light, moments);
            }
        });
        // Section 4.2, spatial estimate, where there is too little history.
        let (guides, light, moments) = (&*guides, &*light, &*moments);
        state.scratch.fill(|y, row| {
            for c in 0..LIGHT {
                row[c * width..][..width].copy_from_slice(light.row(y, c));
            }
            for x in 0..width {
                if moments.at(x, y, LENGTH) < SHORT && guides.is_surface(x, y) {
                    self.spatial_estimate(x, y, guides, light, moments, row);
                }
            }
        });
        std::mem::swap(&mut state.now.1, &mut state.scratch);
    }

    /// Section 4.1, temporal filtering, and 4.2, variance estimation, of one pixel.
    #[expect(clippy::too_many_arguments, reason = "what a pixel reads and writes")]
    #[inline(always)]
    fn accumulate_pixel(
        &self,
        x: usize,
        width: usize,
        taps: &Taps,
        history: &Rows,
        old_moments: &Rows,
        noisy: impl Fn(usize) -> f32,
        light: &mut [f32],
        moments: &mut [f32],
    ) {
        let length = (taps.mean(old_moments, LENGTH) + 1.0).min(LONGEST);
        let (alpha, moments_alpha) = match taps.is_empty() {
            true => (1.0, 1.0),
            false => (self.constants.colour_alpha.max(1.0 / length), self.constants.moments_alpha.max(1.0 / length)),
        };
        for signal in 0..2 {
            let new: Rgb = std::array::from_fn(|c| noisy(3 * signal + c));
            let l = luminance(new);
            let mut mu = [l, l * l];
            for (m, mu) in mu.iter_mut().enumerate() {
                let old = taps.mean(old_moments, 2 * signal + m);
                *mu = old + (*mu - old) * moments_alpha;
                moments[(2 * signal + m) * width + x] = *mu;
            }
            for c in 0..3 {
                let old = taps.mean(history, 4 * signal + c);
                light[(4 * signal + c) * width + x] = old + (new[c] - old) * alpha;
            }
            light[(4 * signal + 3) * width + x] = (mu[1] - mu[0] * mu[0]).max(0.0);
        }
        moments[LENGTH * width + x] = length;
    }

    /// Section 4.2: colour and moments by a 7x7 bilateral filter driven by depth and normal; the variance is raised
    /// by 4/N, which favours too much blur over too little at the start.
    fn spatial_estimate(&self, x: usize, y: usize, guides: &Guides, light: &Rows, moments: &Rows, row: &mut [f32]) {
        let Size { width, height } = guides.size();
        let z = guides.surface.at(x, y, DEPTH);
        let gradient = [0, 1].map(|axis| guides.slope.at(x, y, GRADIENT + axis));
        let n = guides.normal(x, y);
        let (mut total, mut colour, mut mu) = (0.0, [0.0; 6], [0.0; 4]);
        for k in 0..49 {
            let (dx, dy) = (k % 7 - SHORT_RADIUS, k / 7 - SHORT_RADIUS);
            let (qx, qy) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if qx >= width || qy >= height {
                continue;
            }
            let m = guides.normal(qx, qy);
            let explained = (gradient[0] * dx as f32 + gradient[1] * dy as f32).abs();
            let off = (guides.surface.at(qx, qy, DEPTH) - z).abs();
            let w_z = exp_neg(off / (self.constants.sigma_z * explained + DEPTH_EPSILON * z));
            let w_n = to_the_128th((n[0] * m[0] + n[1] * m[1] + n[2] * m[2]).max(0.0));
            let w = if k == 24 { 1.0 } else { w_z * w_n };
            total += w;
            for signal in 0..2 {
                for c in 0..3 {
                    colour[3 * signal + c] += w * light.at(qx, qy, 4 * signal + c);
                }
            }
            for (m, mu) in mu.iter_mut().enumerate() {
                *mu += w * moments.at(qx, qy, m);
            }
        }
        let raised = SHORT / moments.at(x, y, LENGTH).max(1.0);
        for signal in 0..2 {
            for c in 0..3 {
                row[(4 * signal + c) * width + x] = colour[3 * signal + c] / total;
            }
            let [mu1, mu2] = [mu[2 * signal] / total, mu[2 * signal + 1] / total];
            row[(4 * signal + 3) * width + x] = (mu2 - mu1 * mu1).max(0.0) * raised;
        }
    }
}

impl Method for Svgf {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn reset(&mut self) {
        self.state = None;
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let frame = input.frame;
        let rows = |channels| Rows::new(frame.size, channels);
        let kept = self.state.take().filter(|s| s.guides.size() == frame.size);
        let follows = kept.as_ref().is_some_and(|s| s.index.abs_diff(frame.index) == 1);
        let mut state = kept.unwrap_or_else(|| State {
            index: frame.index,
            guides: Guides::new(frame.size),
            history: rows(LIGHT),
            moments: rows(MOMENTS),
            now: (Guides::new(frame.size), rows(LIGHT), rows(MOMENTS)),
            noisy: rows(6),
            scratch: rows(LIGHT),
        });
        self.accumulate(frame, &mut state, follows);
        // Section 4.3: the wavelet. The history is dead now and serves as a buffer.
        let State { history, now: (guides, light, _), scratch, .. } = &mut state;
        for level in 0..self.constants.levels {
            wavelet_level(self.level, &self.constants, 1 << level, guides, light, scratch);
            std::mem::swap(light, scratch);
            if level == self.constants.feedback {
                history.clone_from(light);
            }
        }
        let [matte, glossy] = [0, 4].map(|c| light.picture(c));
        state.index = frame.index;
        std::mem::swap(&mut state.guides, &mut state.now.0);
        std::mem::swap(&mut state.moments, &mut state.now.2);
        self.state = Some(state);
        Ok(composite(frame, Some(matte.view()), Some(glossy.view())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::{Camera, FrameBuf};
    use quell_trace::{Control, RenderOptions, Tracer, builtin};

    /// The estimates of the matte signal's variance after `frames`.
    fn estimate(frames: &[FrameBuf]) -> Plane<f32> {
        let size = frames[0].size;
        let mut svgf = Svgf::new("svgf", Constants::PAPER);
        for (before, frame) in frames[..frames.len() - 1].iter().zip(&frames[1..]) {
            svgf.denoise(&Input { frame: &before.frame(&[]), halves: None }).unwrap();
            assert_eq!(before.index + 1, frame.index);
        }
        let last = &frames[frames.len() - 1];
        let mut state = svgf.state.take().unwrap();
        svgf.accumulate(&last.frame(&[]), &mut state, true);
        Plane::from_fn(size, |x, y| state.now.1.at(x, y, 3))
    }

    /// A wall whose pixels are a level times 0..2, evenly: variance level^2 / 3. The level rises from left to right.
    #[test]
    fn the_variance_is_within_a_factor_of_2_after_8_frames() {
        let size = Size::new(96, 64);
        let level = |x: usize| 0.1 + x as f32 * 0.1;
        let mut random = 7u64;
        let mut noise = move || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 40) as f32 / (1u64 << 24) as f32
        };
        let camera = Camera::perspective([0.0, 0.0, 4.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
        let frames: Vec<FrameBuf> = (0..8)
            .map(|index| {
                let mut f = FrameBuf::new(size, camera);
                f.index = index;
                f.matte = Some(Plane::from_fn(size, |x, _| [2.0 * level(x) * noise(); 3]));
                f.motion = Some(Plane::filled(size, [0.0; 2]));
                f
            })
            .collect();
        let estimate = estimate(&frames);
        let ratio = |x: usize, y: usize| estimate.at(x, y) * 3.0 / level(x).powi(2);
        let mut ratios: Vec<f32> = (0..size.pixels()).map(|i| ratio(i % size.width, i / size.width)).collect();
        ratios.sort_by(f32::total_cmp);
        let mean = ratios.iter().sum::<f32>() / ratios.len() as f32;
        let within = ratios.iter().filter(|r| (0.5..=2.0).contains(*r)).count() as f32 / ratios.len() as f32;
        // The moments' weights w are a 1/N mean of 5 frames, then 0.2 each: 1 - sum w^2 = 0.85 of the variance.
        assert!((mean - 0.85).abs() < 0.03, "mean ratio {mean}");
        assert!(within > 0.85, "{within} of the pixels are within a factor of 2");
    }

    /// Path-traced light: the true variance is that of 48 frames.
    #[test]
    fn the_variance_of_traced_light_is_within_a_factor_of_2_after_8_frames() {
        let size = Size::new(64, 36);
        let scene = builtin("cornell-box").unwrap();
        let tracer = Tracer::new(&scene, 0, 1).unwrap();
        let frames: Vec<FrameBuf> = (0..48)
            .map(|seed| {
                let options = RenderOptions { seed, direct_samples: 1, ..RenderOptions::new(size) };
                let mut frame = tracer.render(&options, &Control::default()).unwrap().frame;
                (frame.index, frame.previous_camera) = (seed as i64, frame.camera);
                frame.motion = Some(Plane::filled(size, [0.0; 2]));
                frame
            })
            .collect();
        let matte = |i: usize, x: usize, y: usize| f64::from(luminance(frames[i].matte.as_ref().unwrap().at(x, y)));
        let (mut truth, mut estimated) = (vec![0.0; 16 * 9], vec![0.0; 16 * 9]);
        let estimates: Vec<Plane<f32>> = (0..6).map(|k| estimate(&frames[8 * k..8 * k + 8])).collect();
        for y in 0..size.height {
            for x in 0..size.width {
                let cell = y / 4 * 16 + x / 4;
                let mean = (0..48).map(|i| matte(i, x, y)).sum::<f64>() / 48.0;
                truth[cell] += (0..48).map(|i| (matte(i, x, y) - mean).powi(2)).sum::<f64>() / 47.0;
                estimated[cell] += estimates.iter().map(|e| f64::from(e.at(x, y))).sum::<f64>() / 6.0;
            }
        }
        // Sums over 4x4 pixels: of a single pixel's 48 frames not even the truth is known well.
        let lit: Vec<f64> = truth.iter().zip(&estimated).filter(|(t, _)| **t > 0.0).map(|(t, e)| e / t).collect();
        let within = lit.iter().filter(|r| (0.5..=2.0).contains(*r)).count() as f64 / lit.len() as f64;
        assert!(within > 0.95, "{within} of the cells are within a factor of 2");
    }
}
