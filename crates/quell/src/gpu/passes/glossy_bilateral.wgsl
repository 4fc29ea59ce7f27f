// Stages 9 and 10, one pixel an invocation.
@group(0) @binding(2) var<storage, read> guides: array<Guide>;
@group(0) @binding(3) var<storage, read> input: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> output: array<vec4f>;

fn glossy_input(i: u32) -> vec3f {
    return input[i].xyz;
}

@compute @workgroup_size(8, 8)
fn horizontal(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        output[index_of(pixel)] = vec4f(glossy_bilateral(vec2i(1, 0), pixel), 0.0);
    }
}

@compute @workgroup_size(8, 8)
fn vertical(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        output[index_of(pixel)] = vec4f(glossy_bilateral(vec2i(0, 1), pixel), 0.0);
    }
}
