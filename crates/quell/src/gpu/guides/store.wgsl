// Needs the planes `geometry_out`, `surface_out` and `moving_out`.

fn store_guide(pixel: vec2i, guide: Guide) {
    let moves = Moving(guide.motion, guide.glossy_hit, guide.confidence_in);
    textureStore(geometry_out, pixel, pack_geometry(guide.normal, guide.depth));
    textureStore(surface_out, pixel, pack_surface(guide.id, guide.roughness, guide.normal));
    textureStore(moving_out, pixel, pack_moving(moves, guide.depth));
}
