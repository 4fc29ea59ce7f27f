// Where a pixel of the sequence filter's buffers lies.
fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(settings.size));
}

fn index_of(pixel: vec2i) -> u32 {
    return u32(pixel.y) * settings.size.x + u32(pixel.x);
}

// The nearest pixel of the image.
fn clamped(pixel: vec2i) -> vec2i {
    return clamp(pixel, vec2i(0), vec2i(settings.size) - 1);
}

// To the nearest pixel, halves up, as Rust does for what is above -0.5.
fn rounded(v: vec2f) -> vec2i {
    let whole = floor(v);
    return vec2i(select(whole, whole + 1.0, v - whole >= vec2f(0.5)));
}
