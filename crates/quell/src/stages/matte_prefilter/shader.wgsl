// Twin of reference.rs: stages 4 and 7, which differ in the pattern only.
//
// The pass supplies `spiral_tap` and `sparse_input`.

// K of the contact stop: how close the closest of what lies around a pixel is to it.
fn nearest_around(pixel: vec2i, p: Surface) -> f32 {
    var most = 0.0;
    for (var i = 0; i < 2; i++) {
        let far = select(CONTACT_FAR, CONTACT_NEAR, i == 0);
        most = max(most, closeness_at(p.position, p.normal, pixel + vec2i(-far, 0)));
        most = max(most, closeness_at(p.position, p.normal, pixel + vec2i(far, 0)));
        most = max(most, closeness_at(p.position, p.normal, pixel + vec2i(0, -far)));
        most = max(most, closeness_at(p.position, p.normal, pixel + vec2i(0, far)));
    }
    return most;
}

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
    var nearest = 0.0;
    if stops.contact > 0.0 {
        nearest = nearest_around(pixel, p);
    }
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
        let s = surface_of(q);
        var w = tap.weight * edge_weight(stops, p, s, origin, direction, pixel_size);
        if nearest > 0.0 {
            w *= contact_stop(s.position - p.position, nearest, stops.contact);
        }
        if w > 0.0 {
            sum += w * sparse_input(q);
            total += w;
        }
    }
    return sum / total;
}
