// What the luminance stop of stage 3 compares, one pixel an invocation.
fn compared_at(i: u32) -> vec4f {
    return compared[i];
}

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        compared[index_of(pixel)] = compared_mean(pixel);
    }
}
