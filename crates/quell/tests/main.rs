//! The integration tests of the denoiser, one binary: what holds of every back end, and that the back ends agree.

mod suite {
    #[cfg(all(feature = "cpu", feature = "threads"))]
    mod agreement;
    #[cfg(feature = "cpu")]
    mod antialiasing;
    mod contract;
    #[cfg(feature = "cpu")]
    mod convergence;
    mod frames;
    #[cfg(feature = "gpu-native")]
    mod gpu;
    mod invariants;
    mod public_names;
    mod sequence;
}
