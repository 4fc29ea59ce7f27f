//! Row loops compiled for the widest instruction set that the machine has.

use fearless_simd::Level;

/// [`fearless_simd::dispatch`], on x86-64 without code for SSE4.2. Such code took a third of the time to compile this crate, and made
/// `denoise` 1.04 times as fast at most as what SSE2 can (docs/performance.md).
#[cfg(target_arch = "x86_64")]
macro_rules! dispatch {
    (@on $token:expr, $simd:pat => $op:expr) => {{
        let token = $token;
        let $simd = token;
        fearless_simd::Simd::vectorize(
            token,
            #[inline(always)]
            || $op,
        )
    }};
    ($level:expr, $simd:pat => $op:expr) => {{
        let level: fearless_simd::Level = $level;
        if let Some(avx512) = level.as_avx512() {
            crate::simd::dispatch!(@on avx512, $simd => $op)
        } else if let Some(avx2) = level.as_avx2() {
            crate::simd::dispatch!(@on avx2, $simd => $op)
        } else if let Some(sse2) = level.as_sse2() {
            crate::simd::dispatch!(@on sse2, $simd => $op)
        } else {
            unreachable!("x86-64 has SSE2")
        }
    }};
}
#[cfg(target_arch = "x86_64")]
pub(crate) use dispatch;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use fearless_simd::dispatch;

/// Runs a call of an `#[inline(always)]` function on the widest vectors. Products and sums are fused only where that is asked for by
/// name (`mul_add_precise`, which rounds once on every machine): the same bits on every machine.
macro_rules! widest {
    ($call:expr) => {{
        crate::simd::dispatch!(crate::simd::level(), _simd => $call);
    }};
}

pub(crate) use widest;

/// The machine's widest, or in tests the one asked for.
pub(crate) fn level() -> Level {
    #[cfg(test)]
    if let Some(level) = tests::LEVEL.lock().ok().and_then(|level| *level) {
        return level;
    }
    Level::new()
}

#[cfg(test)]
mod tests {
    use crate::plane::Size;
    use crate::sequence::testing::frame;
    use crate::sequence::{Filtered, SequenceDenoiser, SequenceSettings};
    use fearless_simd::Level;
    use std::sync::Mutex;

    pub(super) static LEVEL: Mutex<Option<Level>> = Mutex::new(None);

    fn run() -> Vec<Filtered> {
        let mut denoiser = SequenceDenoiser::new(SequenceSettings::default()).unwrap();
        let mut out = Vec::new();
        for t in 0..3 {
            out.extend(denoiser.push(frame(t, Size::new(37, 21)), true).unwrap());
        }
        out.extend(denoiser.finish().unwrap());
        out
    }

    /// Products and sums are not fused, or by `mul_add_precise`, so instruction sets that can fuse them give the bits of those that cannot.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let best = Level::new();
        let mut levels = vec![Level::baseline()];
        #[cfg(target_arch = "x86_64")]
        levels.extend(best.as_avx2().map(Level::Avx2));
        let widest = run();
        for level in levels {
            *LEVEL.lock().unwrap() = Some(level);
            let found = run();
            *LEVEL.lock().unwrap() = None;
            assert_eq!(found, widest, "{level:?} and {best:?}");
        }
    }
}
