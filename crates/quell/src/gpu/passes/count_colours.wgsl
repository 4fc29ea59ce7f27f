// Counts what stages repair as they load the host's colours. A colour that is not there is bound to a black texel.

@compute @workgroup_size(8, 8)
fn count_colours(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        count_colour(PLANE_DIRECT, textureLoad(direct, pixel, 0));
        count_colour(PLANE_MATTE, textureLoad(matte, pixel, 0));
        count_colour(PLANE_GLOSSY, textureLoad(glossy, pixel, 0));
        count_colour(PLANE_DIRECT_MATTE, textureLoad(direct_matte, pixel, 0));
        count_colour(PLANE_DIRECT_GLOSSY, textureLoad(direct_glossy, pixel, 0));
        count_colour(PLANE_MATTE_WEIGHT, textureLoad(matte_weight, pixel, 0));
        count_colour(PLANE_GLOSSY_WEIGHT, textureLoad(glossy_weight, pixel, 0));
    }
    flush_counts(local);
}
