// Stage 2 of the sequence filter, one pixel an invocation.
fn count_at(i: u32) -> f32 {
    return counts[i][settings.place];
}

fn given_at(i: u32) -> f32 {
    if settings.given == 0u {
        return -1.0;
    }
    return given[i];
}

@compute @workgroup_size(8, 8)
fn variance(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let p = index_of(pixel);
        pooled[p] = vec4f(light[p].xyz, pooled_variance(pixel));
    }
}
