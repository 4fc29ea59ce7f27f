//! The tap pattern of stages 4 and 7 \[S, E]: a spiral whose tap i of N lies at radius ((i + j) / N) R and angle
//! 2 pi (T (i + j) / N + phi), truncated to whole pixels, under a Gaussian.
//!
//! Its density falls as 1/r, so it is centre-heavy by itself. Spin phi and radial jitter j repeat over 4x4 pixels,
//! permuted from frame to frame: that costs no quality against a hash where the 16 are well spread, and it makes
//! every tap a shifted row for the CPU.

use super::math::{exp_negative, sin_cos_turns};
use crate::settings::{MatteBilateral, MattePrefilter, OffScreen, REFERENCE_ROWS};

/// Side of the square over which the pattern repeats, pixels.
pub const PERIOD: usize = 4;
/// Patterns in it.
pub const PHASES: usize = PERIOD * PERIOD;

/// One tap: an offset in whole pixels and its Gaussian weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpiralTap {
    /// To the right.
    pub dx: i32,
    /// Down.
    pub dy: i32,
    /// Gaussian of the distance, 1 at the centre.
    pub weight: f32,
}

/// What makes a spiral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpiralShape {
    /// Taps, the centre not counted.
    pub taps: u32,
    /// Radius in pixels of this image.
    pub radius_px: f32,
    /// Standard deviation of the Gaussian, of the radius.
    pub sigma: f32,
    /// Turns; 0: from the table.
    pub turns: u32,
    /// Which of the stages asks: they use different permutations, or their lattices align.
    pub stage: u32,
    /// Frame index; 0 where the pattern stands still.
    pub frame: i64,
    /// What happens beyond the edge.
    pub off_screen: OffScreen,
}

impl SpiralShape {
    /// The spiral of stage 4.
    pub fn prefilter(s: &MattePrefilter, rows: usize, frame: i64) -> Self {
        Self {
            taps: s.taps,
            radius_px: s.radius * rows as f32 / REFERENCE_ROWS,
            sigma: s.sigma,
            turns: s.turns,
            stage: 0,
            frame: if s.rotate { frame } else { 0 },
            off_screen: s.off_screen,
        }
    }

    /// Pixels along an axis to the farthest tap, over the patterns of all frames.
    pub(crate) fn farthest(shape: impl Fn(i64) -> Self) -> usize {
        (0..PHASES as i64).map(|frame| Spiral::new(&shape(frame)).reach()).max().unwrap_or(0)
    }

    /// The spiral of stage 7.
    pub fn bilateral(s: &MatteBilateral, rows: usize, frame: i64) -> Self {
        Self {
            taps: s.taps,
            radius_px: s.radius * rows as f32 / REFERENCE_ROWS,
            sigma: s.sigma,
            turns: s.turns,
            stage: 1,
            frame: if s.rotate { frame } else { 0 },
            off_screen: s.off_screen,
        }
    }
}

/// The taps of all 16 phases. The centre pixel is always taken as well, with weight 1, and is not listed.
#[derive(Clone, Debug, PartialEq)]
pub struct Spiral {
    taps: Vec<SpiralTap>,
    per_phase: usize,
}

/// Turns of low discrepancy for N taps \[E: the engine's table]; between its entries the nearest N's.
fn best_turns(taps: u32) -> u32 {
    match taps {
        0..=3 => 1,
        4..=7 => 2,
        8..=15 => 5,
        16..=33 => 7,
        34..=64 => 11,
        _ => 13,
    }
}

/// Ranks of a 4x4 Bayer matrix: neighbours get distant ranks.
const BAYER: [u32; PHASES] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

impl Spiral {
    /// An empty pattern, to be filled by [`Spiral::fill`].
    pub fn empty() -> Self {
        Self { taps: Vec::new(), per_phase: 0 }
    }

    /// The pattern for a shape.
    pub fn new(shape: &SpiralShape) -> Self {
        let mut spiral = Self::empty();
        spiral.fill(shape);
        spiral
    }

    /// Computes the pattern anew without allocating, where it had as many taps before.
    pub fn fill(&mut self, shape: &SpiralShape) {
        let n = shape.taps as usize;
        self.per_phase = n;
        self.taps.clear();
        let turns = if shape.turns == 0 { best_turns(shape.taps) } else { shape.turns };
        let radius = f64::from(shape.radius_px);
        let sigma = f64::from(shape.sigma) * radius;
        // Odd multipliers permute the 16 ranks; frame and stage choose the permutation, the offset walks.
        let frame = shape.frame.rem_euclid(PHASES as i64) as u32;
        for phase in 0..PHASES as u32 {
            let rank = BAYER[phase as usize];
            let spin = (rank * 5 + frame * 7 + shape.stage * 11) % PHASES as u32;
            let jitter = (rank * (3 + 8 * shape.stage) + frame * 9 + 5 * shape.stage) % PHASES as u32;
            let jitter = (f64::from(jitter) + 0.5) / PHASES as f64;
            // Within one arm spacing: beyond it the spiral repeats itself.
            let spin = (f64::from(spin) + 0.5 * f64::from(shape.stage)) / PHASES as f64;
            for i in 0..n {
                let r = (i as f64 + jitter) / n as f64 * radius;
                let (s, c) = sin_cos_turns(f64::from(turns) * (i as f64 + jitter) / n as f64 + spin);
                let (dx, dy) = ((r * c).trunc(), (r * s).trunc());
                let weight =
                    if sigma > 0.0 { exp_negative((-(dx * dx + dy * dy) / (2.0 * sigma * sigma)) as f32) } else { 0.0 };
                self.taps.push(SpiralTap { dx: dx as i32, dy: dy as i32, weight });
            }
        }
    }

    /// The taps for pixel (x, y).
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> &[SpiralTap] {
        self.phase((y % PERIOD) * PERIOD + x % PERIOD)
    }

    /// The taps of phase (y mod 4) * 4 + x mod 4.
    #[inline]
    pub fn phase(&self, phase: usize) -> &[SpiralTap] {
        &self.taps[phase * self.per_phase..][..self.per_phase]
    }

    /// Furthest offset along an axis, pixels: the border that a tile needs.
    pub fn reach(&self) -> usize {
        self.taps.iter().map(|t| t.dx.unsigned_abs().max(t.dy.unsigned_abs()) as usize).max().unwrap_or(0)
    }
}

/// Where a tap lands: `Some` coordinate inside 0..extent, or `None` where it is left out.
#[inline(always)]
pub fn land(position: i32, extent: usize, off_screen: OffScreen) -> Option<usize> {
    let extent = extent as i32;
    if (0..extent).contains(&position) {
        return Some(position as usize);
    }
    match off_screen {
        OffScreen::Skip => None,
        OffScreen::Mirror => {
            let mirrored = if position < 0 { -1 - position } else { 2 * extent - 1 - position };
            (0..extent).contains(&mirrored).then_some(mirrored as usize)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(stage: u32, frame: i64) -> SpiralShape {
        SpiralShape { taps: 24, radius_px: 32.0, sigma: 0.5, turns: 0, stage, frame, off_screen: OffScreen::Skip }
    }

    #[test]
    fn phases_frames_and_stages_differ() {
        let a = Spiral::new(&shape(0, 0));
        assert_ne!(a, Spiral::new(&shape(0, 1)));
        assert_ne!(a, Spiral::new(&shape(1, 0)));
        assert_eq!(a, Spiral::new(&shape(0, 16)));
        for p in 1..PHASES {
            assert_ne!(a.phase(0), a.phase(p));
        }
        assert!(a.reach() <= 32 && a.reach() > 28);
    }

    #[test]
    fn the_sixteen_phases_together_are_centred() {
        // The mean offset over a period is small against the radius: no drift of light across the image.
        for stage in 0..2 {
            let spiral = Spiral::new(&shape(stage, 3));
            let mut sum = [0.0; 2];
            let mut weight = 0.0;
            for phase in 0..PHASES {
                for tap in spiral.phase(phase) {
                    sum[0] += tap.weight * tap.dx as f32;
                    sum[1] += tap.weight * tap.dy as f32;
                    weight += tap.weight;
                }
            }
            assert!(sum[0].abs() / weight < 0.7 && sum[1].abs() / weight < 0.7, "{sum:?} {weight}");
        }
    }

    #[test]
    fn mirrored_taps_come_back() {
        assert_eq!(land(-1, 5, OffScreen::Mirror), Some(0));
        assert_eq!(land(5, 5, OffScreen::Mirror), Some(4));
        assert_eq!(land(-9, 5, OffScreen::Mirror), None);
        assert_eq!(land(-1, 5, OffScreen::Skip), None);
    }
}
