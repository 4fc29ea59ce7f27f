//! The colour clamp of stages 3, 8, 11 and `antialiasing`: history is held to what the current signal shows nearby, per channel in
//! YCoCg.

use super::math::{rgb_from_ycocg, three, ycocg_from_rgb};
use crate::frame::Rgb;
use crate::settings::Clip;

/// Minimum and maximum per YCoCg channel.
#[derive(Clone, Copy, Debug)]
pub struct ColourBox {
    /// Least values.
    pub low: [f32; 3],
    /// Greatest values.
    pub high: [f32; 3],
}

impl ColourBox {
    /// Of the given neighbours (the centre among them), linear RGB. `Clip::Off` gives an infinite box.
    pub fn of(neighbours: impl Iterator<Item = Rgb>, clip: Clip, gamma: f32) -> Self {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        if clip == Clip::Off {
            return Self { low: high, high: low };
        }
        let (mut sum, mut squares, mut count) = ([0.0f32; 3], [0.0f32; 3], 0.0f32);
        for rgb in neighbours {
            let c = ycocg_from_rgb(rgb);
            for k in 0..3 {
                low[k] = low[k].min(c[k]);
                high[k] = high[k].max(c[k]);
                sum[k] += c[k];
                squares[k] += c[k] * c[k];
            }
            count += 1.0;
        }
        if clip == Clip::Sigma && count > 0.0 {
            for k in 0..3 {
                let mean = sum[k] / count;
                let deviation = (squares[k] / count - mean * mean).max(0.0).sqrt();
                low[k] = mean - gamma * deviation;
                high[k] = mean + gamma * deviation;
            }
        }
        Self { low, high }
    }

    /// Made to hold linear `rgb`, too.
    #[inline(always)]
    pub(crate) fn widen(&mut self, rgb: Rgb) {
        let c = ycocg_from_rgb(rgb);
        for k in 0..3 {
            self.low[k] = self.low[k].min(c[k]);
            self.high[k] = self.high[k].max(c[k]);
        }
    }

    /// `rgb` held to the box. A channel that only the clamp made negative becomes 0.
    #[inline(always)]
    pub fn clamp(&self, rgb: Rgb) -> Rgb {
        let c = ycocg_from_rgb(rgb);
        // Without branches: the compiler makes vectors of it.
        let within = |k: usize| (c[k] >= self.low[k]) & (c[k] <= self.high[k]);
        let inside = within(0) & within(1) & within(2);
        let clamped = rgb_from_ycocg(three(|k| c[k].max(self.low[k]).min(self.high[k])));
        let held = three(|k| if (clamped[k] < 0.0) & (rgb[k] >= 0.0) { 0.0 } else { clamped[k] });
        three(|k| if inside { rgb[k] } else { held[k] }) // not even rounding may change what needs no clamp
    }
}

/// Values under this share of what they would be scaled to say nothing of how passes share it: the quotient of two
/// numbers so far apart amplifies rounding, and overflows where history has faded to almost 0.
pub(crate) const LEAST_SHARE: f32 = 1e-9;

#[inline(always)]
fn tells_shares(value: f32, target: f32) -> bool {
    value.abs() > LEAST_SHARE * target.abs()
}

/// How one channel of a joint pass's history follows the clamp of the beauty's: by the same ratio; where the beauty's
/// history is next to 0, the clamped value is shared out as the current signal is.
///
/// `pass`, `history`, `clamped`: histories of the pass and of the beauty before and after the clamp; `pass_now`,
/// `now`: the current signals.
#[inline(always)]
pub fn follow(pass: f32, history: f32, clamped: f32, pass_now: f32, now: f32) -> f32 {
    if clamped == history {
        pass
    } else if tells_shares(history, clamped) {
        pass * (clamped / history)
    } else if tells_shares(now, clamped) {
        clamped * (pass_now / now)
    } else {
        0.0
    }
}

/// [`follow`] for the beauty itself, to the bit: `clamped` as [`shareable`] leaves it.
#[inline(always)]
pub fn follow_itself(history: f32, clamped: f32) -> f32 {
    let scaled = history * (clamped / history);
    let scaled = if tells_shares(history, clamped) { scaled } else { clamped };
    if clamped == history { history } else { scaled }
}

/// The clamped beauty, with 0 where neither history nor the current signal says how passes would share a value.
#[inline(always)]
pub fn shareable(history: f32, clamped: f32, now: f32) -> f32 {
    if clamped == history || tells_shares(history, clamped) || tells_shares(now, clamped) { clamped } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_neighbourhood_clamps_to_itself() {
        let b = ColourBox::of([[0.5, 0.25, 1.0]; 9].into_iter(), Clip::Box, 0.0);
        assert_eq!(b.clamp([0.5, 0.25, 1.0]), [0.5, 0.25, 1.0]);
        let c = b.clamp([9.0, 0.0, 0.0]);
        for k in 0..3 {
            assert!((c[k] - [0.5, 0.25, 1.0][k]).abs() < 1e-6);
        }
        let off = ColourBox::of([[0.5; 3]; 9].into_iter(), Clip::Off, 0.0);
        assert_eq!(off.clamp([9.0, 0.0, 3.0]), [9.0, 0.0, 3.0]);
    }

    #[test]
    fn passes_follow_the_clamp_and_still_add_up() {
        for (history, clamped, now) in [
            (2.0, 1.0, 0.7),
            (0.0, 0.5, 2.0),
            (0.0, 0.5, 0.0),
            (1.0, 1.0, 0.0),
            (1e-40, 0.5, 2.0),
            (3e-44, 3e30, 1e-44),
        ] {
            let clamped = shareable(history, clamped, now);
            let sum: f32 = [0.25, 0.75].iter().map(|s| follow(s * history, history, clamped, s * now, now)).sum();
            assert!((sum - clamped).abs() < 1e-6, "{history} {clamped} {now}: {sum}");
            assert!(follow(0.0, history, clamped, 0.0, now).is_finite());
        }
    }
}
