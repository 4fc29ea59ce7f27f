//! Any bytes as a glTF file: loaded under small limits, and a little of it traced.
//!
//!     RUSTC_BOOTSTRAP=1 cargo fuzz run gltf -- -max_total_time=600 -rss_limit_mb=2048 -timeout=10

#![no_main]

use libfuzzer_sys::fuzz_target;
use quell_trace::gltf::{Limits, Options, load_bytes};
use quell_trace::{Control, RenderOptions, Tracer};
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits { file_bytes: 1 << 20, json_bytes: 1 << 20, decoded_bytes: 16 << 20, triangles: 100_000 };
    let options = Options { limits, ..Options::default() };
    let Ok(loaded) = load_bytes(bytes.to_vec(), Path::new("no such folder"), "fuzz", &options) else { return };
    if let Ok(tracer) = Tracer::new(&loaded.scene, 3, 1) {
        let options = RenderOptions { direct_samples: 1, bounces: 1, ..RenderOptions::new(quell::Size::new(4, 3)) };
        let _ = tracer.render(&options, &Control::default());
    }
});
