// Twin of reference.rs: stages 4 and 7, which differ in the pattern only.
//
// The pass supplies `spiral_tap` and `sparse_input`.

// The sparse cross-bilateral filter at one pixel.
fn sparse_bilateral(pixel: vec2i, stops: EdgeStops, shape: SpiralSettings) -> vec3f {
    let centre = sparse_input(pixel);
    let p = surface_of(pixel);
    if p.view_depth == BACKGROUND {
        return centre;
    }
    let pixel_size = pixel_size_at(frame.view, p.view_depth);
    var sum = centre;
    var total = 1.0;
    let first = spiral_at(pixel, shape.taps);
    let size = vec2i(frame.size);
    for (var i = 0u; i < shape.taps; i++) {
        let tap = spiral_tap(first + i);
        let qx = land(pixel.x + tap.dx, size.x, shape.mirror != 0u);
        let qy = land(pixel.y + tap.dy, size.y, shape.mirror != 0u);
        if qx < 0 || qy < 0 {
            continue;
        }
        let q = vec2i(qx, qy);
        let origin = ray_origin(frame.view, sample_position(q));
        let direction = ray_direction(frame.view, sample_position(q));
        let w = tap.weight * edge_weight(stops, p, surface_of(q), origin, direction, pixel_size);
        if w > 0.0 {
            sum += w * sparse_input(q);
            total += w;
        }
    }
    return sum / total;
}
