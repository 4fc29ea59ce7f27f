//! The schedules: loops over rows, runs and taps, loads and stores. What is computed there stands in the stages'
//! `cpu.rs`.

pub(crate) mod antialiasing;
pub(crate) mod change;
pub(crate) mod composite;
pub(crate) mod direct_taa;
pub(crate) mod disocclusion;
pub(crate) mod firefly;
pub(crate) mod glossy_bilateral;
pub(crate) mod sparse_bilateral;
pub(crate) mod stabilise;
pub(crate) mod temporal;
pub(crate) mod variance;
pub(crate) mod wavelet;
pub(crate) mod young_filter;
