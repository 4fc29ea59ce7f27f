// Twin of reference.rs: stage 3.

// Where the history of a pixel lies.
fn matte_temporal_lookup(pixel: vec2i) -> Lookup {
    if frame.has_history == 0u || !is_surface(pixel) {
        return no_lookup();
    }
    let expected = expected_surface(pixel);
    if !expected.found {
        return no_lookup();
    }
    return surface_lookup(expected, pixel);
}

// Stage 3 at one pixel.
fn matte_temporal(pixel: vec2i) -> Accumulated {
    return accumulate(settings.matte_blend, pixel, matte_temporal_lookup(pixel));
}
