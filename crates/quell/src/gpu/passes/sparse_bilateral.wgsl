// Stages 4 and 7, one pixel an invocation.
struct SpiralTap {
    @align(16) dx: i32,
    dy: i32,
    weight: f32,
}

fn spiral_tap(i: u32) -> SpiralTap {
    return spiral[i];
}

fn sparse_input(pixel: vec2i) -> vec3f {
    return first_colour(textureLoad(input, pixel, 0));
}

fn store(pixel: vec2i, colour: vec3f) {
    textureStore(output, pixel, vec4f(stored_colour(colour), 0.0));
}

@compute @workgroup_size(8, 8)
fn matte_prefilter(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, sparse_bilateral(pixel, settings.matte_edge, settings.matte_prefilter));
    }
}

@compute @workgroup_size(8, 8)
fn matte_bilateral(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store(pixel, sparse_bilateral(pixel, settings.matte_edge, settings.matte_bilateral));
    }
}
