// Twin of reference.rs: stage 8.

// Where the history of a pixel lies: where the surface was visible, and its mirror image shown by the same reflector.
fn glossy_temporal_lookup(pixel: vec2i) -> Lookup {
    if frame.glossy_history == 0u || !is_surface(pixel) {
        return no_lookup();
    }
    var expected = expected_surface(pixel);
    if !expected.found {
        return no_lookup();
    }
    let visible = surface_lookup(expected, pixel);
    if settings.mirror.virtual_reprojection == 0u || frame.has_glossy_hit == 0u || visible.trust <= 0.0 {
        return visible;
    }
    expected = previous_reflector(expected, visible, pixel);
    let hit = filtered_hit(pixel);
    var place = Place(vec2f(0.0), false);
    if settings.mirror.curvature != 0u {
        place = bent_coordinate(expected, visible, hit, pixel);
    }
    if !place.found {
        place = virtual_coordinate(expected, hit, pixel);
    }
    if !place.found {
        return no_lookup();
    }
    var reflected = reflector_lookup(expected, place.coordinate, reflected_at(pixel, hit), pixel);
    reflected.trust *= visible.trust;
    return reflected;
}

// Stage 8 at one pixel.
fn glossy_temporal(
    pixel: vec2i,
    changed: f32,
    current: texture_2d<f32>,
    history: texture_2d<f32>,
    history_length: texture_2d<f32>,
) -> Accumulated {
    let lookup = glossy_temporal_lookup(pixel);
    return accumulate(settings.glossy_blend, pixel, lookup, changed, current, history, history_length);
}
