// Twin of mod.rs and reference.rs: stages 9 and 10.
//
// The pass supplies `glossy_input`.

// Radius at a surface pixel, in pixels; 0: pass through. `axis`: (1, 0) or (0, 1).
fn glossy_radius_px(axis: vec2i, pixel: vec2i) -> f32 {
    let glossy = settings.glossy_bilateral;
    var radius = glossy.max_radius_px;
    if glossy.radius == RADIUS_CONSTANT {
        radius = glossy.constant_radius_px;
    } else if frame.has_roughness != 0u {
        let roughness = surface_of(pixel).roughness;
        let spread = LOBE_SPREAD * roughness * roughness * frame.view.focal_px;
        var nearness = 1.0;
        if frame.has_glossy_hit != 0u {
            nearness = glossy_mean_nearness(pixel);
        }
        var bend = 0.0;
        if glossy.curvature != 0u {
            bend = glossy_normal_change(axis, pixel);
        }
        // Multiplied through by the nearness: at a hit distance of 0 its inverse is infinite.
        let footprint = spread * nearness / (1.0 + 2.0 * frame.view.focal_px * bend * nearness);
        radius = select(0.0, min(footprint, glossy.max_radius_px), spread > 0.0);
    }
    return select(radius, 0.0, radius < glossy.min_radius);
}

// 1 / (1 + l / d) for one pixel; parallel rays: the distance itself, in units of a pixel's size over the focal length.
fn glossy_nearness(pixel: vec2i, depth: f32) -> f32 {
    let hit = moving_at(pixel, depth).glossy_hit;
    if frame.view.perspective == 0u {
        return hit;
    }
    // d / (d + l): at a hit distance of 0 the quotient l / d is infinite.
    return hit / (hit + depth);
}

// Mean over the 3x3 neighbours of the same object. One path's own distance goes with its own light: a kernel sized by
// it would blur bright samples more than dark ones, which loses energy.
fn glossy_mean_nearness(pixel: vec2i) -> f32 {
    let id = surface_of(pixel).id;
    var sum = 0.0;
    var count = 0.0;
    for (var k = 0; k < 9; k++) {
        let q = pixel + vec2i(k % 3, k / 3) - 1;
        if contains(q) {
            let there = surface_of(q);
            if there.id == id && there.view_depth != BACKGROUND {
                sum += glossy_nearness(q, there.view_depth);
                count += 1.0;
            }
        }
    }
    return sum / count;
}

// The larger change of the normal to the two neighbours along the axis that show the same object.
fn glossy_normal_change(axis: vec2i, pixel: vec2i) -> f32 {
    let own = surface_of(pixel);
    var squared = 0.0;
    for (var side = -1; side <= 1; side += 2) {
        let q = pixel + side * axis;
        if contains(q) {
            let there = surface_of(q);
            if there.id == own.id && there.view_depth != BACKGROUND {
                let change = there.normal - own.normal;
                squared = max(squared, dot(change, change));
            }
        }
    }
    return sqrt(squared);
}

// Stage 9 or 10 at one pixel.
fn glossy_bilateral(axis: vec2i, pixel: vec2i) -> vec3f {
    let glossy = settings.glossy_bilateral;
    let centre = glossy_input(pixel);
    let p = surface_of(pixel);
    if p.view_depth == BACKGROUND {
        return centre;
    }
    let radius = glossy_radius_px(axis, pixel);
    if radius <= 0.0 {
        return centre;
    }
    let pixel_size = pixel_size_at(frame.view, p.view_depth);
    let sigma = glossy.sigma * radius;
    var sum = centre;
    var total = 1.0;
    for (var side = -1; side <= 1; side += 2) {
        var ceiling = FAR;
        for (var k = 1; k <= glossy.reach; k++) {
            let offset = f32(k * glossy.step_px);
            let q = pixel + side * k * glossy.step_px * axis;
            if offset > radius || !contains(q) {
                break;
            }
            let origin = ray_origin(frame.view, sample_position(q));
            let direction = ray_direction(frame.view, sample_position(q));
            var edge = edge_weight(settings.glossy_edge, p, surface_of(q), origin, direction, pixel_size);
            if glossy.monotone != 0u {
                edge = min(edge, ceiling);
                ceiling = edge;
            }
            let w = edge * exp_negative(-offset * offset / (2.0 * sigma * sigma));
            if w > 0.0 {
                sum += w * glossy_input(q);
                total += w;
            }
        }
    }
    return sum / total;
}
