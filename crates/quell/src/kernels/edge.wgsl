// Twin of edge.rs: the cross-bilateral weight of stages 4, 7, 9 and 10.

// The weight of tap `q` for centre `p`, 0..1, without the Gaussian.
//
// `q_origin`, `q_direction`: the ray of q's pixel, relative to the eye, direction scaled to one unit of view depth.
// `pixel_size`: of a pixel at p's depth, world units.
fn edge_weight(
    stops: EdgeStops,
    p: Surface,
    q: Surface,
    q_origin: vec3f,
    q_direction: vec3f,
    pixel_size: f32,
) -> f32 {
    if q.id != p.id || q.view_depth == BACKGROUND {
        return 0.0;
    }
    let facing = dot(p.normal, q_direction);
    var w_depth = 0.0;
    // Edge-on there is no quotient: WGSL promises nothing of infinities.
    if facing != 0.0 {
        let plane_depth = dot(p.normal, p.position - q_origin) / facing;
        if plane_depth > 0.0 && plane_depth < FAR {
            w_depth = max(1.0 - stops.depth * abs(q.view_depth - plane_depth) / p.view_depth, 0.0);
        }
    }
    let cosine = max(dot(p.normal, q.normal), 0.0);
    let squared = cosine * cosine;
    let w_normal = max(1.0 - stops.normal * (1.0 - squared * squared), 0.0);
    let offset = q.position - p.position;
    let distance = length(offset);
    var w_plane = 1.0;
    if distance >= COINCIDENT_PX * pixel_size {
        let out_of_plane = max(abs(dot(offset, p.normal)), abs(dot(offset, q.normal)));
        let w = max(1.0 - 2.0 * stops.plane * out_of_plane / distance, 0.0);
        w_plane = w * w;
    }
    let w_gloss = max(1.0 - GLOSS_SCALE * stops.gloss * abs(q.roughness - p.roughness), 0.0);
    return w_depth * w_normal * w_plane * w_gloss;
}

// h: how closely what lies at an offset faces a tangent plane's pixel; 1 / world unit.
fn closeness(offset: vec3f, normal: vec3f) -> f32 {
    let above = dot(offset, normal);
    if above > 0.0 {
        return above / dot(offset, offset);
    }
    return 0.0;
}

// h of what another pixel shows: 0 beyond the picture, and background.
fn closeness_at(centre: vec3f, normal: vec3f, r: vec2i) -> f32 {
    if !contains(r) {
        return 0.0;
    }
    let depth = depth_at(r);
    if depth == BACKGROUND {
        return 0.0;
    }
    return closeness(world(frame.view, sample_position(r), depth) - centre, normal);
}

// The contact stop of a pair; `nearest`: the largest h.
fn contact_stop(offset: vec3f, nearest: f32, contact: f32) -> f32 {
    let rest = max(1.0 - dot(offset, offset) * (nearest * nearest) / (contact * contact), 0.0);
    return rest * rest;
}
