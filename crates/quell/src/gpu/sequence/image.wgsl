// Where a pixel of the sequence filter's buffers lies.
fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(settings.size));
}

fn index_of(pixel: vec2i) -> u32 {
    return u32(pixel.y) * settings.size.x + u32(pixel.x);
}
