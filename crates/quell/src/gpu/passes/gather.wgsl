// Stage 1 of the sequence filter, one pixel an invocation. A layer of each array is a frame.
fn frame_at(place: i32) -> WindowFrame {
    return frames[place];
}

fn surface_at(there: WindowFrame, pixel: vec2i) -> SurfacePoint {
    let texel = textureLoad(surfaces, pixel, there.layer, 0);
    return SurfacePoint(texel.x, textureLoad(surface_normals, pixel, there.layer, 0).xyz, texel.yzw);
}

fn seen_colour_at(there: WindowFrame, pixel: vec2i) -> vec3f {
    return textureLoad(seen_colours, pixel, there.layer, 0).xyz;
}

fn seen_normal_at(there: WindowFrame, pixel: vec2i) -> vec3f {
    return textureLoad(seen_normals, pixel, there.layer, 0).xyz;
}

fn sample_at(k: u32, there: WindowFrame, pixel: vec2i) -> vec3f {
    switch k {
        case 0u: { return textureLoad(samples_0, pixel, there.layer, 0).xyz; }
        case 1u: { return textureLoad(samples_1, pixel, there.layer, 0).xyz; }
        case 2u: { return textureLoad(samples_2, pixel, there.layer, 0).xyz; }
        default: { return textureLoad(samples_3, pixel, there.layer, 0).xyz; }
    }
}

fn light_at(k: u32, there: WindowFrame, pixel: vec2i) -> vec2f {
    switch k {
        case 0u: { return textureLoad(light_0, pixel, there.layer, 0).xy; }
        case 1u: { return textureLoad(light_1, pixel, there.layer, 0).xy; }
        case 2u: { return textureLoad(light_2, pixel, there.layer, 0).xy; }
        default: { return textureLoad(light_3, pixel, there.layer, 0).xy; }
    }
}

@compute @workgroup_size(8, 8)
fn gather_samples(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    var result = gather(pixel);
    // Of all planes of the frame.
    var largest = 1.0;
    if settings.begins == 0u {
        largest = most[p];
    }
    for (var k = 0u; k < settings.planes; k++) {
        largest = max(largest, result.counts[k]);
        switch k {
            case 0u: { mean_0[p] = result.means[k]; }
            case 1u: { mean_1[p] = result.means[k]; }
            case 2u: { mean_2[p] = result.means[k]; }
            default: { mean_3[p] = result.means[k]; }
        }
    }
    counts[p] = result.counts;
    most[p] = largest;
}
