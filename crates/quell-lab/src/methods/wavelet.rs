//! The a-trous wavelet's pattern of taps (Dammertz et al. 2010, section 2), as loops along rows.

use quell::Size;

/// The B3 spline that generates the kernel, one axis.
const SPLINE: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Weight of the kernel's centre.
pub(super) const CENTRE: f32 = SPLINE[2] * SPLINE[2];
/// Pixels of a row that are worked on at once: their sums stay in the nearest cache.
pub(super) const BLOCK: usize = 64;

/// One value for each pixel of a block.
pub(super) type Lanes = [f32; BLOCK];

/// A block's values of a row, from column `x` on; `outside` beyond the row's ends. Whole blocks of fixed length are what
/// makes the loops over them vectors without remainders.
#[inline(always)]
pub(super) fn load(row: &[f32], x: isize, outside: f32) -> Lanes {
    let mut lanes = [outside; BLOCK];
    if let Some(inside) = usize::try_from(x).ok().and_then(|x| row.get(x..x + BLOCK)) {
        lanes.copy_from_slice(inside);
    } else {
        for (i, lane) in lanes.iter_mut().enumerate() {
            if let Some(value) = usize::try_from(x + i as isize).ok().and_then(|x| row.get(x)) {
                *lane = *value;
            }
        }
    }
    lanes
}

/// One tap of every pixel of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tap {
    /// h: its weight in the kernel.
    pub(super) weight: f32,
    /// p - q in pixels, up to the sign.
    pub(super) offset: [f32; 2],
    /// Its row.
    pub(super) y: usize,
    /// Column of the first pixel's tap; taps may lie outside the row.
    pub(super) x: isize,
}

/// Calls `f` for the 24 taps, `step` pixels apart, about the block that begins at (x, y); without the centre.
#[inline(always)]
pub(super) fn taps(size: Size, step: usize, (x, y): (usize, usize), mut f: impl FnMut(Tap)) {
    for k in 0..25 {
        let (column, row) = (k % 5, k / 5);
        let reach = |i: usize| (i as isize - 2) * step as isize;
        let tap_y = y.wrapping_add_signed(reach(row));
        if k != 12 && tap_y < size.height {
            f(Tap {
                weight: SPLINE[column] * SPLINE[row],
                offset: [reach(column) as f32, reach(row) as f32],
                y: tap_y,
                x: x as isize + reach(column),
            });
        }
    }
}

/// exp(-x) for x >= 0, to 3e-6 of the value; 0 beyond 87 and for NaN. Only additions and multiplications, so that
/// loops stay vectors.
#[inline(always)]
pub(super) fn exp_neg(x: f32) -> f32 {
    /// Adding this rounds to an integer in the lowest bits of the mantissa.
    const ROUND: f32 = 12_582_912.0;
    let t = x * -std::f32::consts::LOG2_E;
    let t = if t > -126.0 { t } else { -126.0 };
    let rounded = t + ROUND;
    let f = t - (rounded - ROUND);
    // 2^f on -0.5..0.5: the series of exp(f ln 2).
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5 + f * (0.055_504_11 + f * (0.009_618_129 + f * 0.001_333_356))));
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_neg_is_exp_of_minus() {
        for i in 0..870 {
            let x = i as f32 * 0.1;
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(exp_neg(x)) / exact - 1.0).abs() < 2e-5, "{x}");
        }
        for x in [90.0, 1e30, f32::INFINITY, f32::NAN] {
            assert!(exp_neg(x).abs() < 1e-30, "{x}");
        }
    }

    #[test]
    fn the_kernel_adds_up_to_1_inside() {
        let size = Size::new(70, 33);
        let ones = vec![1.0; size.width];
        for step in [1, 2, 16] {
            for (x, y) in [(0, 0), (64, 32), (64, 16), (0, 16)] {
                let mut sums = [CENTRE; BLOCK];
                taps(size, step, (x, y), |tap| {
                    assert_eq!(tap.x as f32, x as f32 + tap.offset[0]);
                    assert_eq!(tap.y as f32, y as f32 + tap.offset[1]);
                    let inside = load(&ones, tap.x, 0.0);
                    sums.iter_mut().zip(inside).for_each(|(s, inside)| *s += tap.weight * inside);
                });
                for (i, sum) in sums[..BLOCK.min(size.width - x)].iter().enumerate() {
                    let inside = |at: usize, extent: usize| at >= 2 * step && at + 2 * step < extent;
                    assert_eq!((sum - 1.0).abs() < 1e-6, inside(x + i, size.width) && inside(y, size.height));
                }
            }
        }
    }
}
