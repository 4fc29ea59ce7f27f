//! Motion of sixteen pixels at once: what trajectories are made of.

use super::halves::widen_eight;
use super::lanes::BLOCK;
use crate::window::Vectors;
use fearless_simd::{Simd, f32x16, prelude::*};
use half::f16;

/// Motion vectors of these pixels: x, y.
#[inline(always)]
pub(crate) fn motion_of<S: Simd>(simd: S, motion: &Vectors, pixels: &[usize; BLOCK]) -> [f32x16<S>; 2] {
    const HALF: usize = BLOCK / 2;
    match motion {
        Vectors::Half(_, data) => {
            let mut v = [[[f16::ZERO; HALF]; 2]; 2];
            for i in 0..BLOCK {
                let [x, y] = data[pixels[i]];
                (v[0][i / HALF][i % HALF], v[1][i / HALF][i % HALF]) = (x, y);
            }
            [
                widen_eight(simd, v[0][0]).combine(widen_eight(simd, v[0][1])),
                widen_eight(simd, v[1][0]).combine(widen_eight(simd, v[1][1])),
            ]
        }
        Vectors::Full(plane) => {
            let mut v = [[0.0; BLOCK]; 2];
            for i in 0..BLOCK {
                let [x, y] = plane.data()[pixels[i]];
                (v[0][i], v[1][i]) = (x, y);
            }
            [v[0].simd_into(simd), v[1].simd_into(simd)]
        }
    }
}

/// [`f32::round`] of numbers above -0.5, to the bit but for the sign of 0.
#[inline(always)]
pub(crate) fn nearest<S: Simd>(simd: S, v: f32x16<S>) -> f32x16<S> {
    let whole = v.floor();
    (v - whole).simd_ge(f32x16::splat(simd, 0.5)).select(whole + 1.0, whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::{Plane, Size};

    #[test]
    fn places_are_rounded_as_one_by_one() {
        let mut values = vec![-0.499_999_97, -0.25, -1e-9, 0.0, 0.499_999_97, 0.5, 1.5, 2.5, 4096.5, 8_388_607.5];
        values.extend((0..300).map(|i| i as f32 * 0.083_7));
        values.resize(values.len().next_multiple_of(BLOCK), 0.0);
        crate::simd::dispatch!(crate::simd::level(), simd => {
            for some in values.chunks(BLOCK) {
                let found: [f32; BLOCK] = nearest(simd, f32x16::from_slice(simd, some)).into();
                assert_eq!(found.to_vec(), some.iter().map(|v| v.round()).collect::<Vec<_>>());
            }
        });
    }

    #[test]
    fn vectors_are_those_of_their_pixels() {
        let pixels: [usize; BLOCK] = std::array::from_fn(|i| i * i % 21);
        for scale in [0.25, 0.3] {
            let motion = Vectors::new(Plane::from_fn(Size::new(7, 3), |x, y| [scale * x as f32, -scale * y as f32]));
            crate::simd::dispatch!(crate::simd::level(), simd => {
                let [x, y] = motion_of(simd, &motion, &pixels);
                for (i, pixel) in pixels.into_iter().enumerate() {
                    assert_eq!([x.as_slice()[i], y.as_slice()[i]], motion.at(pixel));
                }
            });
        }
    }
}
