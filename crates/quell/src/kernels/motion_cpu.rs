//! Motion of eight or sixteen pixels at once: what trajectories are made of.

use super::halves::widen_eight;
use super::lanes::BLOCK;
use crate::window::{Motion, Vectors};
use fearless_simd::{Simd, f32x8, f32x16, prelude::*};
use half::f16;

/// Pixels of half a block.
const HALF: usize = BLOCK / 2;

/// Motion vectors of these pixels: x, y.
#[inline(always)]
pub(crate) fn motion_of_eight<S: Simd>(simd: S, motion: Motion<'_>, pixels: &[i32; HALF]) -> [f32x8<S>; 2] {
    if let (Vectors::Half(_, data), None) = (motion.surface, motion.reflection) {
        let mut v = [[f16::ZERO; HALF]; 2];
        for i in 0..HALF {
            let [x, y] = data[pixels[i] as usize];
            (v[0][i], v[1][i]) = (x, y);
        }
        return [widen_eight(simd, v[0]), widen_eight(simd, v[1])];
    }
    let mut v = [[0.0; HALF]; 2];
    for i in 0..HALF {
        let [x, y] = motion.at(pixels[i] as usize);
        (v[0][i], v[1][i]) = (x, y);
    }
    [v[0].simd_into(simd), v[1].simd_into(simd)]
}

/// [`motion_of_eight`] of sixteen.
#[inline(always)]
pub(crate) fn motion_of<S: Simd>(simd: S, motion: Motion<'_>, pixels: &[i32; BLOCK]) -> [f32x16<S>; 2] {
    let [first, last]: [[i32; HALF]; 2] = bytemuck::cast(*pixels);
    let (a, b) = (motion_of_eight(simd, motion, &first), motion_of_eight(simd, motion, &last));
    [a[0].combine(b[0]), a[1].combine(b[1])]
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
        let pixels: [i32; BLOCK] = std::array::from_fn(|i| (i * i % 21) as i32);
        for scale in [0.25, 0.3] {
            let motion = Vectors::new(Plane::from_fn(Size::new(7, 3), |x, y| [scale * x as f32, -scale * y as f32]));
            crate::simd::dispatch!(crate::simd::level(), simd => {
                let [x, y] = motion_of(simd, Motion { surface: &motion, reflection: None }, &pixels);
                for (i, pixel) in pixels.into_iter().enumerate() {
                    assert_eq!([x.as_slice()[i], y.as_slice()[i]], motion.at(pixel as usize));
                }
            });
        }
    }
}
