//! Any bytes as an EXR file: read, mapped to roles, made a frame of the filter, and put back.
//!
//!     RUSTC_BOOTSTRAP=1 cargo fuzz run exr -- -max_total_time=600 -rss_limit_mb=2048 -timeout=10

#![no_main]

use libfuzzer_sys::fuzz_target;
use quell_frames::{AdaptOptions, Adapter, Links, MapOptions, map_roles, read_image_from};
use std::io::Cursor;
use std::path::Path;
use std::sync::Once;

/// A panic inside the crate `exr` is caught where quell calls it; any other is a find.
fn tolerate_decoders() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let inside = panic.location().is_some_and(|place| place.file().contains("/exr-1."));
            if !inside {
                report(panic);
                std::process::abort();
            }
        }));
    });
}

fuzz_target!(|bytes: &[u8]| {
    tolerate_decoders();
    let Ok(image) = read_image_from(Cursor::new(bytes), Path::new("fuzz.exr")) else { return };
    let window = image.full_window();
    let Ok(mappings) = map_roles(&[(String::new(), &image)], &MapOptions::default()) else { return };
    if window.size.pixels() > 1 << 16 {
        return;
    }
    let mut images = vec![image];
    for mapping in mappings {
        let Ok(adapter) = Adapter::new(mapping, window, &images, None, &AdaptOptions::default()) else { continue };
        let mut links = Links::default();
        let Ok(made) = adapter.frame(1, &images, &mut links) else { continue };
        let _ = adapter.frame(2, &images, &mut links);
        let lights: Vec<_> = made.frame.lights.iter().map(|light| light.light.clone()).collect();
        let _ = adapter.write_back(&mut images, &made.frame, &lights, made.frame.alpha.as_ref());
    }
});
