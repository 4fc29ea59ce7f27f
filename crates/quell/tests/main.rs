//! The integration tests of the denoiser, one binary: what holds of every back end, and that the back ends agree.

mod suite {
    mod agreement;
    mod contract;
    mod frames;
    mod invariants;
}
