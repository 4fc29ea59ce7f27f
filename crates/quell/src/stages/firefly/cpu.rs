//! Stage 6 on runs of pixels: a network of exchanges, without branches.

use super::MIDDLE;
use crate::settings::Firefly;

/// Neighbours of a pixel, itself among them, in reading order.
pub(crate) const NEIGHBOURS: usize = 9;

/// Brings the median of nine to place 4 (Smith's network of 19 exchanges). Written out: only so does the compiler keep
/// the nine in registers and take many lanes at a time.
macro_rules! exchange_network {
    ($exchange:ident) => {
        $exchange!(1, 2);
        $exchange!(4, 5);
        $exchange!(7, 8);
        $exchange!(0, 1);
        $exchange!(3, 4);
        $exchange!(6, 7);
        $exchange!(1, 2);
        $exchange!(4, 5);
        $exchange!(7, 8);
        $exchange!(0, 3);
        $exchange!(5, 8);
        $exchange!(4, 7);
        $exchange!(3, 6);
        $exchange!(1, 4);
        $exchange!(2, 5);
        $exchange!(4, 7);
        $exchange!(4, 2);
        $exchange!(6, 4);
        $exchange!(4, 2);
    };
}

/// The median of nine.
#[inline(always)]
pub(crate) fn median(mut v: [f32; NEIGHBOURS]) -> f32 {
    macro_rules! exchange {
        ($a:literal, $b:literal) => {
            let (x, y) = (v[$a], v[$b]);
            v[$a] = if y < x { y } else { x };
            v[$b] = if y < x { x } else { y };
        };
    }
    exchange_network!(exchange);
    v[MIDDLE]
}

/// Which of nine is the median; of equal values the first in reading order counts as the least.
#[inline(always)]
#[expect(unused_assignments, reason = "nobody asks for the last exchange's keys")]
pub(crate) fn rank(values: [f32; NEIGHBOURS]) -> u32 {
    let mut key = [0; NEIGHBOURS];
    for k in 0..NEIGHBOURS {
        key[k] = ordered(values[k]);
    }
    let mut place: [u32; NEIGHBOURS] = [0, 1, 2, 3, 4, 5, 6, 7, 8];
    macro_rules! exchange {
        ($a:literal, $b:literal) => {
            let swap = (key[$b] < key[$a]) | ((key[$b] == key[$a]) & (place[$b] < place[$a]));
            (key[$a], key[$b]) = if swap { (key[$b], key[$a]) } else { (key[$a], key[$b]) };
            (place[$a], place[$b]) = if swap { (place[$b], place[$a]) } else { (place[$a], place[$b]) };
        };
    }
    exchange_network!(exchange);
    place[MIDDLE]
}

/// Whether a value gives way to the median.
#[inline(always)]
pub(crate) fn is_replaced(settings: &Firefly, value: f32, median: f32) -> bool {
    settings.plain | (value > settings.threshold * median)
}

/// An integer whose order is the total order of floating-point numbers.
#[inline(always)]
fn ordered(v: f32) -> i32 {
    let bits = v.to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_finds_the_median() {
        // The 0-1 principle: a network that works on all sequences of zeros and ones works.
        for mask in 0..1u32 << NEIGHBOURS {
            let v: [f32; NEIGHBOURS] = std::array::from_fn(|i| (mask >> i & 1) as f32);
            let ones = mask.count_ones() as usize;
            let expected = if ones > NEIGHBOURS / 2 { 1.0 } else { 0.0 };
            assert_eq!(median(v), expected, "{mask:b}");
            let mut ranked: Vec<(f32, usize)> = v.iter().copied().zip(0..).collect();
            ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(rank(v) as usize, ranked[MIDDLE].1, "{mask:b}");
        }
        assert!(ordered(-0.0) < ordered(0.0) && ordered(-2.0) < ordered(-1.0) && ordered(1.0) < ordered(2.0));
    }
}
