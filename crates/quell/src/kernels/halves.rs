//! Half floats to single precision, on any number of lanes: the same bits with and without instructions for it. The crate `half`
//! asks for the instruction at every call, so that loops over its conversion are no vectors.

use half::f16;

/// The value of a half float. Of what is no number another may come out.
#[inline(always)]
pub(crate) fn widen(h: f16) -> f32 {
    const EXPONENT: u32 = 0x0f80_0000;
    const REBIAS: u32 = (127 - 15) << 23;
    let bits = u32::from(h.to_bits());
    let magnitude = (bits & 0x7fff) << 13;
    let exponent = magnitude & EXPONENT;
    let rebiased = magnitude + REBIAS;
    // Subnormal: its mantissa counts from the least normal number on, which is subtracted again.
    let subnormal = f32::from_bits(rebiased + (1 << 23)) - f32::from_bits(REBIAS + (1 << 23));
    let whole = if exponent == EXPONENT { rebiased + REBIAS } else { rebiased };
    let found = if exponent == 0 { subnormal.to_bits() } else { whole };
    f32::from_bits(found | (bits & 0x8000) << 16)
}

#[cfg(feature = "cpu")]
pub(crate) use lanes::{Eights, Runs, widen_eight, widen_from};

#[cfg(feature = "cpu")]
mod lanes {
    use super::widen;
    use fearless_simd::{Level, Simd, f32x8, prelude::*};
    use half::f16;

    #[cfg(target_arch = "x86_64")]
    fearless_simd::kernel!(
        #[inline]
        fn widen_avx2(_avx2: Avx2, halves: [u16; 8]) -> [f32; 8] {
            bytemuck::cast(std::arch::x86_64::_mm256_cvtph_ps(bytemuck::cast(halves)))
        }
    );

    #[cfg(target_arch = "x86_64")]
    fearless_simd::kernel!(
        #[inline]
        fn widen_avx512(_avx512: Avx512, halves: [u16; 8]) -> [f32; 8] {
            bytemuck::cast(std::arch::x86_64::_mm256_cvtph_ps(bytemuck::cast(halves)))
        }
    );

    /// [`widen`] on eight lanes.
    #[inline(always)]
    pub(crate) fn widen_eight<S: Simd>(simd: S, halves: [f16; 8]) -> f32x8<S> {
        let values: [f32; 8] = match simd.level() {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(token) => widen_avx512(token, bytemuck::cast(halves)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(token) => widen_avx2(token, bytemuck::cast(halves)),
            _ => std::array::from_fn(|i| widen(halves[i])),
        };
        values.simd_into(simd)
    }

    /// Half floats that are read by runs of `N`, also the last ones: one comparison a run, and no function is called.
    pub(crate) struct Runs<'a, const N: usize> {
        data: &'a [f16],
        /// The last `N` and as many zeros.
        last: Vec<f16>,
        /// Where those begin.
        from: usize,
    }

    impl<'a, const N: usize> Runs<'a, N> {
        const ZEROS: &'static [f16; N] = &[f16::ZERO; N];

        pub(crate) fn new(data: &'a [f16]) -> Self {
            let from = data.len().saturating_sub(N);
            let mut last = vec![f16::ZERO; 2 * N];
            last.iter_mut().zip(&data[from..]).for_each(|(last, value)| *last = *value);
            Self { data, last, from }
        }

        /// Those from `at` on, which is no more than `isize::MAX`; beyond the end 0.
        #[inline(always)]
        pub(crate) fn at(&self, at: usize) -> &[f16; N] {
            // That the sums do not overflow is plain to the compiler so.
            let at = at & (usize::MAX >> 1);
            let last = at.wrapping_sub(self.from) & (usize::MAX >> 1);
            let run = match self.data.get(at..at + N) {
                Some(run) => Some(run),
                None => self.last.get(last..last + N),
            };
            match run {
                Some(run) => run.first_chunk().unwrap_or(Self::ZEROS),
                None => Self::ZEROS,
            }
        }
    }

    /// [`widen`] of eight of a run, from `first` on.
    #[inline(always)]
    pub(crate) fn widen_from<S: Simd, const N: usize>(simd: S, run: &[f16; N], first: usize) -> f32x8<S> {
        let halves = match run.get(first..first + 8) {
            Some(some) => *some.first_chunk().unwrap_or(&[f16::ZERO; 8]),
            None => [f16::ZERO; 8],
        };
        widen_eight(simd, halves)
    }

    /// Half floats that are read by eights, also the last ones. No function is called: a loop around keeps its sums in registers.
    #[derive(Clone, Copy)]
    pub(crate) struct Eights<'a> {
        data: &'a [f16],
        /// The last eight and eight zeros.
        last: [f16; 16],
        /// Where those begin.
        from: usize,
    }

    impl<'a> Eights<'a> {
        pub(crate) fn new(data: &'a [f16]) -> Self {
            let from = data.len().saturating_sub(8);
            let mut last = [f16::ZERO; 16];
            last.iter_mut().zip(&data[from..]).for_each(|(last, value)| *last = *value);
            Self { data, last, from }
        }

        /// [`widen`] of those from `at` on; beyond the end 0.
        #[inline(always)]
        pub(crate) fn widen<S: Simd>(&self, simd: S, at: usize) -> f32x8<S> {
            let run = match self.data.get(at..) {
                Some(rest) => rest.first_chunk::<8>(),
                None => None,
            };
            let halves = match run {
                Some(run) => *run,
                None => match self.last.get(at.wrapping_sub(self.from)..) {
                    Some(rest) => *rest.first_chunk::<8>().unwrap_or(&[f16::ZERO; 8]),
                    None => [f16::ZERO; 8],
                },
            };
            widen_eight(simd, halves)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_float_has_its_value() {
        let all: Vec<f16> = (0..=u16::MAX).map(f16::from_bits).collect();
        for h in &all {
            assert!(widen(*h).to_bits() == h.to_f32().to_bits() || (h.is_nan() && widen(*h).is_nan()), "{h:?}");
        }
        #[cfg(feature = "cpu")]
        crate::simd::dispatch!(crate::simd::level(), simd => {
            let eights = Eights::new(&all);
            for at in (0..all.len()).step_by(5) {
                let found: [f32; 8] = eights.widen(simd, at).into();
                for (i, value) in found.into_iter().enumerate() {
                    let expected = all.get(at + i).map_or(0.0, |h| h.to_f32());
                    assert!(value.to_bits() == expected.to_bits() || (value.is_nan() && expected.is_nan()), "{at} {i}");
                }
            }
            for n in 0..50 {
                let few = Eights::new(&all[0x3c00..][..n]);
                let runs = Runs::<24>::new(&all[0x3c00..][..n]);
                for at in 0..n + 3 {
                    let run = runs.at(at);
                    for (i, value) in run.iter().enumerate() {
                        assert_eq!(*value, if at + i < n { all[0x3c00 + at + i] } else { f16::ZERO }, "{n} {at}");
                    }
                    let found: [f32; 8] = widen_from(simd, run, 5).into();
                    assert_eq!(found, std::array::from_fn(|i| run[5 + i].to_f32()), "{n} {at}");
                    let found: [f32; 8] = few.widen(simd, at).into();
                    let expected = std::array::from_fn(|i| if at + i < n { all[0x3c00 + at + i].to_f32() } else { 0.0 });
                    assert_eq!(found, expected, "{n} {at}");
                }
            }
        });
    }
}
