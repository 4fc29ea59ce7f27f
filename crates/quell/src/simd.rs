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
    use crate::plane::{Plane, Size};
    use crate::sequence::{Filtered, Light, LightKind, SequenceDenoiser, SequenceFrame, SequenceSettings};
    use fearless_simd::Level;
    use std::sync::Mutex;

    pub(super) static LEVEL: Mutex<Option<Level>> = Mutex::new(None);

    fn run() -> Vec<Filtered> {
        let size = Size::new(37, 21);
        let mut denoiser = SequenceDenoiser::new(SequenceSettings::default()).unwrap();
        let mut out = Vec::new();
        for t in 0..3i64 {
            let mut frame = SequenceFrame::new(t, size);
            let value = |x: usize, y: usize, k: usize| {
                let hash =
                    (x * 7919 + y * 104_729 + k * 1_299_709 + t as usize * 15_485_863).wrapping_mul(2_654_435_761);
                (hash >> 7 & 0xffff) as f32 / 21_845.0
            };
            for (k, kind) in
                [LightKind::MatteDirect, LightKind::Transmission, LightKind::Beauty].into_iter().enumerate()
            {
                frame.lights.push(Light::new("light", kind, Plane::from_fn(size, |x, y| [value(x, y, k); 3])));
            }
            frame.depth = Some(Plane::from_fn(size, |x, y| 3.0 + 0.1 * x as f32 + 0.01 * value(x, y, 5)));
            frame.normal = Some(Plane::from_fn(size, |x, y| [0.1 * value(x, y, 6), 0.0, 1.0]));
            frame.seen_albedo = Some(Plane::from_fn(size, |x, y| [0.3 * value(x / 4, y, 7); 3]));
            frame.albedo = Some(Plane::from_fn(size, |x, y| [0.3 * value(x / 3, y / 3, 8); 3]));
            frame.motion_to_previous = Some(Plane::filled(size, [0.3, 0.1]));
            out.extend(denoiser.push(frame, true).unwrap());
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
