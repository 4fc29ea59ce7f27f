//! Row loops compiled for the widest instruction set that the machine has.

/// Runs a call of an `#[inline(always)]` function on the widest vectors. Products and sums are never fused: the same
/// bits on every machine.
macro_rules! widest {
    ($call:expr) => {{
        fearless_simd::dispatch!(crate::simd::level(), _simd => $call);
    }};
}

pub(crate) use widest;

/// The machine's widest, or in tests the one asked for.
pub(crate) fn level() -> fearless_simd::Level {
    #[cfg(test)]
    if let Some(level) = tests::LEVEL.lock().ok().and_then(|level| *level) {
        return level;
    }
    fearless_simd::Level::new()
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

    /// Products and sums are never fused, so instruction sets that can fuse them give the bits of those that cannot.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let best = Level::new();
        let mut levels = vec![Level::baseline()];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            levels.extend(best.as_avx2().map(Level::Avx2));
            levels.extend(best.as_sse4_2().map(Level::Sse4_2));
        }
        let widest = run();
        for level in levels {
            *LEVEL.lock().unwrap() = Some(level);
            let found = run();
            *LEVEL.lock().unwrap() = None;
            assert_eq!(found, widest, "{level:?} and {best:?}");
        }
    }
}
