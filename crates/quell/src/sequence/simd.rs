//! Row loops compiled for the widest instruction set that the machine has.

/// Runs a call of an `#[inline(always)]` function on the widest vectors. Products and sums are never fused: the same
/// bits on every machine.
macro_rules! widest {
    ($call:expr) => {{
        #[cfg(feature = "cpu")]
        fearless_simd::dispatch!(fearless_simd::Level::new(), _simd => $call);
        #[cfg(not(feature = "cpu"))]
        $call;
    }};
}

pub(super) use widest;
