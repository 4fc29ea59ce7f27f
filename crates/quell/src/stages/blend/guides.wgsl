// Twin of `guide_albedo` and `guide_normal` of window/features.rs: as seen in mirrors and through glass, else the surface's.
fn guide_albedo(here: WindowFrame, pixel: vec2i) -> vec3f {
    if has(here, HAS_SEEN_COLOUR) {
        return textureLoad(seen_colours, pixel, here.layer, 0).xyz;
    }
    if has(here, HAS_SURFACE_COLOUR) {
        return textureLoad(surface_colours, pixel, here.picture, 0).xyz;
    }
    return vec3f(0.0);
}

fn guide_normal(here: WindowFrame, pixel: vec2i) -> vec3f {
    if has(here, HAS_SEEN_NORMAL) {
        return textureLoad(seen_normals, pixel, here.layer, 0).xyz;
    }
    return textureLoad(surface_normals, pixel, here.layer, 0).xyz;
}
