// What all stages share.

// Luminance of linear Rec. 709.
fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

// exp(-energy), nearly: twin of energy.rs.
fn weight(energy: f32) -> f32 {
    var b = max(1.0 - energy * (1.0 / 16.0), 0.0);
    b *= b;
    b *= b;
    b *= b;
    return b * b;
}
