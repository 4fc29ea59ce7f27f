//! The stages of both filters, one folder each. `mod.rs` is the contract; `reference.rs` the specification, scalar and
//! obvious; `cpu.rs` the same function on rows for the fast back end; `shader.wgsl` on the GPU (none where that stage runs on the
//! CPU alone). `matte_bilateral` is `matte_prefilter` with other taps.
//!
//! | filter | its stages, in order |
//! |---|---|
//! | real-time ([`crate::pipeline`]) | `matte_temporal`, `young_filter`, `matte_prefilter`, `disocclusion`, `firefly`, `matte_bilateral`, `glossy_temporal`, `young_filter`, `glossy_bilateral`, `direct_taa`, `composite`, `antialiasing` |
//! | sequences ([`crate::sequence`]) | `reflection_motion`, `gather`, `feature_noise`, `variance`, `wavelet`, `residual`, `recombine` (sum), `stabilise`, `blend`, `recombine` (rescale) |
//!
//! Sources in the tables: \[S] the talk's slides, \[A] the abstract, \[E] the authors' engine and later work, \[I] inferred, \[O] open, so ours;
//! more in `docs/paper.md`.

pub mod antialiasing;
#[cfg(feature = "internals")]
pub mod blend;
#[cfg(not(feature = "internals"))]
pub(crate) mod blend;
#[cfg(all(test, feature = "cpu"))]
mod causal;
pub mod composite;
pub mod direct_taa;
pub mod disocclusion;
#[cfg(feature = "internals")]
pub mod feature_noise;
#[cfg(not(feature = "internals"))]
pub(crate) mod feature_noise;
pub mod firefly;
#[cfg(feature = "internals")]
pub mod gather;
#[cfg(not(feature = "internals"))]
pub(crate) mod gather;
pub mod glossy_bilateral;
pub mod glossy_temporal;
pub mod matte_bilateral;
pub mod matte_prefilter;
pub mod matte_temporal;
#[cfg(feature = "internals")]
pub mod recombine;
#[cfg(not(feature = "internals"))]
pub(crate) mod recombine;
#[cfg(feature = "internals")]
pub mod reflection_motion;
#[cfg(not(feature = "internals"))]
pub(crate) mod reflection_motion;
#[cfg(feature = "internals")]
pub mod residual;
#[cfg(not(feature = "internals"))]
pub(crate) mod residual;
#[cfg(feature = "internals")]
pub mod stabilise;
#[cfg(not(feature = "internals"))]
pub(crate) mod stabilise;
#[cfg(feature = "internals")]
pub mod variance;
#[cfg(not(feature = "internals"))]
pub(crate) mod variance;
#[cfg(feature = "internals")]
pub mod wavelet;
#[cfg(not(feature = "internals"))]
pub(crate) mod wavelet;
pub mod young_filter;
