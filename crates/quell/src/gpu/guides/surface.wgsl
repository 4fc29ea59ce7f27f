// Needs the planes `geometry` and `surface`.

// The surface of a pixel; its position is only meaningful where it is no background.
fn surface_of(pixel: vec2i) -> Surface {
    let shape = textureLoad(geometry, pixel, 0);
    let skin = textureLoad(surface, pixel, 0);
    let depth = geometry_depth(shape);
    return Surface(
        world(frame.view, sample_position(pixel), depth),
        geometry_normal(shape, skin),
        depth,
        surface_roughness(skin),
        surface_id(skin),
    );
}
