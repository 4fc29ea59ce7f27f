// Feature buffers and light of a frame, for stages 2 and 3.
fn features_at(i: u32) -> Features {
    var features: Features;
    features.geometry = geometry[i];
    features.normal = normals[i];
    if settings.stops.colour > 0.0 || settings.mirror_tolerance != settings.tolerance {
        features.colour = feature_colours[i];
    }
    if settings.stops.seen_normal > 0.0 {
        features.seen_normal = seen_normals[i];
    }
    return features;
}

// A colour, and as the fourth number a variance.
fn light_at(i: u32) -> vec4f {
    return light[i];
}
