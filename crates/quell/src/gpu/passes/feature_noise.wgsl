// The sequence filter's feature buffers of one frame, one pixel an invocation.
fn inverse_depth_at(pixel: vec2i) -> f32 {
    return textureLoad(surfaces, pixel, settings.layer, 0).x;
}

// Unit normal, or zeros; the fourth is 1 in a mirror or glass.
fn normal_at(pixel: vec2i) -> vec4f {
    return textureLoad(surface_normals, pixel, settings.layer, 0);
}

@compute @workgroup_size(8, 8)
fn local_features(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = inverse_depth_at(pixel);
    let facing = normal_at(pixel);
    let noise = feature_noise(pixel, here, facing.xyz);
    let slopes = vec2f(slope(pixel, vec2i(1, 0), here), slope(pixel, vec2i(0, 1), here));
    geometry[p] = vec4f(slopes, here, noise.x);
    normals[p] = vec4f(facing.xyz, noise.y);
    var colour = vec3f(0.0);
    if (settings.seen & SEEN_COLOURS) != 0u {
        colour = textureLoad(seen_colours, pixel, settings.layer, 0).xyz;
    }
    local_seen_colours[p] = vec4f(colour + vec3f(DIVIDED * facing.w, 0.0, 0.0), facing.w);
    var seen = vec3f(0.0);
    if (settings.seen & SEEN_NORMALS) != 0u {
        seen = textureLoad(seen_normals, pixel, settings.layer, 0).xyz;
    }
    local_seen_normals[p] = vec4f(seen, 0.0);
}
