// The light or picture as it came.
fn own_at(pixel: vec2i) -> vec3f {
    if settings.black != 0u {
        return vec3f(0.0);
    }
    return textureLoad(own, pixel, settings.layer, 0).xyz;
}
