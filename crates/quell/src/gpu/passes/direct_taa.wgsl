// Stage 11, one pixel an invocation.
@group(0) @binding(2) var<storage, read> guides: array<Guide>;
@group(0) @binding(3) var<storage, read> input: array<vec4f>;
@group(0) @binding(4) var<storage, read> history: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> output: array<vec4f>;

fn direct_at(i: u32) -> vec3f {
    return input[i].xyz;
}

fn direct_history_at(i: u32) -> vec3f {
    return history[i].xyz;
}

@compute @workgroup_size(8, 8)
fn antialias(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        output[index_of(pixel)] = vec4f(direct_taa(pixel), 0.0);
    }
}
