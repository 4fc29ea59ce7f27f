//! Tests of the lab that need more than one module: independent implementations, the browser.

mod baselines;
mod browser;
mod compare;
mod comparison;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
mod gpu_traced;
mod metrics;
mod offline;
mod oidn;
#[cfg(feature = "gpu")]
mod package;
mod player;
mod references;
mod scorecard;
mod sequences;
mod synthetic;
#[cfg(feature = "gpu")]
mod web;
