// Needs the planes `geometry_before` and `surface_before`.

// What a pixel of the frame before shows.
struct Before {
    normal: vec3f,
    depth: f32,
    roughness: f32,
    id: u32,
}

fn depth_before(pixel: vec2i) -> f32 {
    return geometry_depth(textureLoad(geometry_before, pixel, 0));
}

fn before_at(pixel: vec2i) -> Before {
    let shape = textureLoad(geometry_before, pixel, 0);
    let skin = textureLoad(surface_before, pixel, 0);
    return Before(geometry_normal(shape, skin), geometry_depth(shape), surface_roughness(skin), surface_id(skin));
}
