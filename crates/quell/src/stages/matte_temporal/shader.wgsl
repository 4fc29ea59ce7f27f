// Twin of reference.rs: stage 3.

// Where the history of a pixel lies.
fn matte_temporal_lookup(pixel: vec2i) -> Lookup {
    if frame.matte_history == 0u || !is_surface(pixel) {
        return no_lookup();
    }
    let expected = expected_surface(pixel);
    if !expected.found {
        return no_lookup();
    }
    return surface_lookup(expected, pixel);
}

// Stage 3 at one pixel.
fn matte_temporal(
    pixel: vec2i,
    changed: f32,
    current: texture_2d<f32>,
    history: texture_2d<f32>,
    history_length: texture_2d<f32>,
) -> Accumulated {
    let lookup = matte_temporal_lookup(pixel);
    return accumulate(settings.matte_blend, pixel, lookup, changed, current, history, history_length);
}
