// Stage 3 of the sequence filter, one level, one pixel an invocation.
fn compared_at(i: u32) -> vec4f {
    return compared[i];
}

@compute @workgroup_size(8, 8)
fn filter_level(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        filtered[index_of(pixel)] = filtered_level(pixel);
    }
}
