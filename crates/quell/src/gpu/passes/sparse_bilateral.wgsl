// Stages 4 and 7, one pixel an invocation.
struct SpiralTap {
    @align(16) dx: i32,
    dy: i32,
    weight: f32,
}

@group(0) @binding(2) var<storage, read> guides: array<Guide>;
@group(0) @binding(3) var<storage, read> spiral: array<SpiralTap>;
@group(0) @binding(4) var<storage, read> input: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> output: array<vec4f>;

fn spiral_tap(i: u32) -> SpiralTap {
    return spiral[i];
}

fn sparse_input(i: u32) -> vec3f {
    return input[i].xyz;
}

@compute @workgroup_size(8, 8)
fn matte_prefilter(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        output[index_of(pixel)] = vec4f(sparse_bilateral(pixel, settings.matte_edge, settings.matte_prefilter), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn matte_bilateral(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        output[index_of(pixel)] = vec4f(sparse_bilateral(pixel, settings.matte_edge, settings.matte_bilateral), 0.0);
    }
}
