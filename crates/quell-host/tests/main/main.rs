//! Tests of the host.

mod manifest;
mod views;

use quell_host::{Gpu, Wanted};
use std::sync::Arc;

/// Any adapter, also one in software. Without one a test prints why it did nothing; with `QUELL_REQUIRE_GPU=1` it fails.
fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::open(Wanted::Named("")) {
        Ok(gpu) => Some(Arc::new(gpu)),
        Err(why) => {
            let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
            assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
            println!("SKIPPED: {why}");
            None
        }
    }
}
