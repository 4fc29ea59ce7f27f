//! The stages of the pipeline, one folder each. `mod.rs` is the contract; `reference.rs` the specification, scalar and
//! obvious; `cpu.rs` the same function on rows for the fast back end.

pub mod composite;
pub mod direct_taa;
pub mod disocclusion;
pub mod firefly;
pub mod glossy_bilateral;
pub mod glossy_temporal;
pub mod matte_bilateral;
pub mod matte_prefilter;
pub mod matte_temporal;
