// Twin of mirror_image.rs: where the mirror image of a glossy surface was in the previous frame, and which of the four
// pixels there still show the same reflector.

// The unit vector along `v`; 0 where it has no length.
fn normalize_or_zero(v: vec3f) -> vec3f {
    let squared = dot(v, v);
    if squared > 0.0 {
        return v / sqrt(squared);
    }
    return vec3f(0.0);
}

// `v` mirrored in the plane through the origin with this normal.
fn mirrored_in(v: vec3f, normal: vec3f) -> vec3f {
    return v - 2.0 * dot(v, normal) * normal;
}

// Reflections so sharp that every hit distance is that of the image.
fn is_mirror(roughness: f32) -> bool {
    return roughness < settings.mirror.mirror_roughness;
}

// What a pixel reflects, and its distance.
struct Reflected {
    // The reflected point; of no meaning where the distance is not finite.
    point: vec3f,
    // As filtered by `filtered_hit`.
    distance: f32,
}

fn reflected_at(pixel: vec2i, hit_distance: f32) -> Reflected {
    let eye_ray = normalize_or_zero(ray_direction(frame.view, sample_position(pixel)));
    let reflected = mirrored_in(eye_ray, surface_of(pixel).normal);
    return Reflected(world_of(pixel) + reflected * select(0.0, hit_distance, hit_distance < FAR), hit_distance);
}

// How far a mirror's previous pixel is to be trusted: its reflected ray ended as far from it as the point that is reflected
// now lies, but for `least`, the size of a pixel: neighbours see a contact that far apart. 1 where the frame before had no hit
// distance (0).
fn same_hit(q: vec2i, hit: Reflected, least: f32) -> f32 {
    let there = hit_before(q, depth_before(q));
    if there <= 0.0 {
        return 1.0;
    }
    let ends = hit.distance < FAR;
    let ended = there < FAR;
    if !(ends && ended) {
        return select(0.0, 1.0, ends == ended);
    }
    let wanted = length(hit.point - world_before(q));
    let begin = max(settings.mirror.hit_tolerance * wanted, least);
    return 1.0 - hermite_step(begin, settings.surface.falloff * begin, abs(wanted - there));
}

// The reflector that a previous pixel must show, and how.
struct WantedReflector {
    id: u32,
    roughness: f32,
    rejection: u32,
    // For `same_hit`.
    least: f32,
}

fn reflector_trust(expected: Expected, wanted: WantedReflector, hit: Reflected, q: vec2i) -> f32 {
    if !contains_before(q) {
        return 0.0;
    }
    let there = before_at(q);
    if there.depth == BACKGROUND
        || there.id != wanted.id
        || abs(there.roughness - wanted.roughness) > settings.mirror.reflector_roughness
        || dot(there.normal, expected.normal) < settings.mirror.reflector_normal_min {
        return 0.0;
    }
    var trust = distance_trust(expected, q, wanted.rejection);
    if is_mirror(wanted.roughness) {
        trust *= same_hit(q, hit, wanted.least);
    }
    return trust;
}

// Position and normal of a previous pixel, 0 where it has no weight.
struct Tap {
    position: vec3f,
    normal: vec3f,
    weight: f32,
}

fn tap_of(visible: Lookup, k: i32, weight: f32) -> Tap {
    if !(weight > 0.0) {
        return Tap(vec3f(0.0), vec3f(0.0), 0.0);
    }
    let q = footprint_pixel(visible.first, k);
    return Tap(world_before(q), before_at(q).normal, weight);
}

// How far the normal of a tap with weight is from this one.
fn bend_of(tap: Tap, normal: vec3f) -> f32 {
    return select(0.0, length(tap.normal - normal), tap.weight > 0.0);
}

// How far the normal of a pixel of the footprint is from this one, where it shows the object `id`.
fn bend_beside(visible: Lookup, k: i32, id: u32, normal: vec3f) -> f32 {
    let q = footprint_pixel(visible.first, k);
    if !contains_before(q) {
        return 0.0;
    }
    let there = before_at(q);
    return select(0.0, length(there.normal - normal), there.depth != BACKGROUND && there.id == id);
}

// Glossy light: the footprint at a virtual coordinate, each pixel tested for the same reflector, and in mirrors for the same
// reflected point. Never by point distance: there the previous surface is another point of the mirror.
fn reflector_lookup(expected: Expected, coordinate: vec2f, hit: Reflected, pixel: vec2i) -> Lookup {
    if !on_screen(coordinate) {
        return no_lookup();
    }
    let own = surface_of(pixel);
    let rejection = select(REJECTION_PLANE, REJECTION_OFF, settings.surface.rejection == REJECTION_OFF);
    let footprint = footprint_of(to_before(coordinate));
    let least = settings.surface.pixel_distance * pixel_size_at(frame.view, expected.view_depth);
    let wanted = WantedReflector(own.id, own.roughness, rejection, least);
    let trusts = vec4f(
        reflector_trust(expected, wanted, hit, footprint_pixel(footprint.first, 0)),
        reflector_trust(expected, wanted, hit, footprint_pixel(footprint.first, 1)),
        reflector_trust(expected, wanted, hit, footprint_pixel(footprint.first, 2)),
        reflector_trust(expected, wanted, hit, footprint_pixel(footprint.first, 3)),
    );
    var found = lookup_of(footprint, trusts);
    let whole = all((trusts > vec4f(0.0)) | (footprint.weight <= vec4f(0.0)));
    let inside = contains_before(footprint.first - 1) && contains_before(footprint.first + 2);
    found.spline = whole && inside && found.trust > 0.0 && own.roughness < settings.mirror.spline_below;
    return found;
}

// The reflector at a pixel as the four pixels at its old place show it: `visible` is their lookup.
//
// A mirror that turns hardly moves its own points, but moves its image twice as fast: motion alone cannot tell that
// it rests. It counts as resting where its normal changed by no more than it varies between the four pixels, and its
// plane did not shift; then `expected` stays as it is. Else it becomes their mean position and normal.
//
// Where the jitter changed, the samples of both frames lie up to a pixel apart on the same reflector: twice as much as the normal varies
// between all four pixels, also those without weight, is then no turn, and what it bends over a pixel no shift.
fn previous_reflector(expected: Expected, visible: Lookup, pixel: vec2i) -> Expected {
    let a = tap_of(visible, 0, visible.weight.x);
    let b = tap_of(visible, 1, visible.weight.y);
    let c = tap_of(visible, 2, visible.weight.z);
    let d = tap_of(visible, 3, visible.weight.w);
    let position = a.weight * a.position + b.weight * b.position + c.weight * c.position + d.weight * d.position;
    let sum = a.weight * a.normal + b.weight * b.normal + c.weight * c.normal + d.weight * d.normal;
    let normal = normalize_or_zero(sum);
    var spread = max(max(bend_of(a, normal), bend_of(b, normal)), max(bend_of(c, normal), bend_of(d, normal)));
    var slack = 0.0;
    if any(frame.jitter != frame.before_jitter) {
        let id = surface_of(pixel).id;
        slack = max(spread, max(
            max(bend_beside(visible, 0, id, normal), bend_beside(visible, 1, id, normal)),
            max(bend_beside(visible, 2, id, normal), bend_beside(visible, 3, id, normal)),
        ));
        spread = JITTERED_TURN * slack;
    }
    let turned = length(surface_of(pixel).normal - normal) > spread + SAME_NORMAL;
    let shift = abs(dot(world_of(pixel) - position, normal));
    let shifted = shift > (SAME_PLANE_PX + slack) * pixel_size_at(frame.view, expected.view_depth);
    var before = expected;
    if expected.moved || turned || shifted {
        before.position = position;
        before.normal = normal;
        before.moved = true;
    }
    return before;
}

// Glossy light: where the mirror image at a pixel was. `hit_distance` as filtered by `filtered_hit`.
//
// A plane mirror's image lies behind the surface, on the eye ray, as far as the hit point lies before it. Where the
// reflector moved by itself, the hit point is mirrored in the plane that it had before.
fn virtual_coordinate(expected: Expected, hit_distance: f32, pixel: vec2i) -> Place {
    let position = world_of(pixel);
    let eye_ray = normalize_or_zero(ray_direction(frame.view, sample_position(pixel)));
    let is_finite = hit_distance < FAR;
    let distance = min(hit_distance, settings.mirror.max_hit_distance * expected.view_depth);
    var before: Place;
    if !expected.moved {
        if is_finite {
            before = pixel_of(frame.previous_view, position + eye_ray * distance);
        } else {
            before = pixel_of_direction(frame.previous_view, eye_ray);
        }
    } else {
        let reflected = mirrored_in(eye_ray, surface_of(pixel).normal);
        if is_finite {
            let hit = position + reflected * distance;
            let mirrored = hit - 2.0 * dot(hit - expected.position, expected.normal) * expected.normal;
            before = pixel_of(frame.previous_view, mirrored);
        } else {
            before = pixel_of_direction(frame.previous_view, mirrored_in(reflected, expected.normal));
        }
    }
    // Unjittered previous pixel = projection; the footprint is addressed from pixel centres, as motion is.
    before.coordinate -= frame.jitter;
    return before;
}

// By how much the reflected previous eye ray of one pixel misses the hit point.
fn bent_miss(q: vec2i, hit: vec3f, is_finite: bool, reflected: vec3f) -> vec3f {
    let ray = normalize_or_zero(ray_direction(frame.before_view, sample_position_before(q)));
    let away = mirrored_in(ray, before_at(q).normal);
    let wanted = select(reflected, normalize_or_zero(hit - world_before(q)), is_finite);
    return wanted - away;
}

// Glossy light: on a curved reflector: the place in the previous image whose surface reflected the same hit point
// into the eye. None where the four pixels at the surface's old place (`visible`) have one normal: plane.
//
// At each of the four the reflected previous eye ray misses the hit point by some angle; that miss is taken as linear
// in the place, and its zero is the answer: one step of Newton's method, which knows both curvatures, and motion of
// reflector and camera. Where it fails (silhouettes, focus, bumps) it is the surface's own place.
//
// Where the jitter changed, on a reflector at rest the step begins at the surface's own place, where the normal of now tells the
// miss exactly.
fn bent_coordinate(expected: Expected, visible: Lookup, hit_distance: f32, pixel: vec2i) -> Place {
    let seen = visible.weight > vec4f(0.0);
    let t0 = tap_of(visible, 0, visible.weight.x);
    let t1 = tap_of(visible, 1, visible.weight.y);
    let t2 = tap_of(visible, 2, visible.weight.z);
    let t3 = tap_of(visible, 3, visible.weight.w);
    // Of the first that is seen; with none of them there is no bend.
    let normal = select(select(select(t3.normal, t2.normal, seen.z), t1.normal, seen.y), t0.normal, seen.x);
    let bend = max(max(bend_of(t0, normal), bend_of(t1, normal)), max(bend_of(t2, normal), bend_of(t3, normal)));
    if bend <= SAME_NORMAL {
        return Place(vec2f(0.0), false);
    }
    // In pixels of the frame before, as its miss is.
    let surface = to_before(expected.coordinate);
    if !all(seen) {
        return Place(expected.coordinate, true);
    }
    let eye_ray = normalize_or_zero(ray_direction(frame.view, sample_position(pixel)));
    let reflected = mirrored_in(eye_ray, surface_of(pixel).normal);
    let is_finite = hit_distance < FAR;
    let hit = world_of(pixel) + reflected * select(0.0, hit_distance, is_finite);
    let f0 = bent_miss(footprint_pixel(visible.first, 0), hit, is_finite, reflected);
    let f1 = bent_miss(footprint_pixel(visible.first, 1), hit, is_finite, reflected);
    let f2 = bent_miss(footprint_pixel(visible.first, 2), hit, is_finite, reflected);
    let f3 = bent_miss(footprint_pixel(visible.first, 3), hit, is_finite, reflected);
    let middle = 0.25 * ((f0 + f1) + (f2 + f3));
    let du = 0.5 * ((f1 - f0) + (f3 - f2));
    let dv = 0.5 * ((f2 - f0) + (f3 - f1));
    let a = dot(du, du);
    let b = dot(du, dv);
    let c = dot(dv, dv);
    let rests = any(frame.jitter != frame.before_jitter) && !expected.moved;
    var from_place = floor(surface - 0.5) + 1.0 + frame.before_jitter - frame.jitter * frame.to_before;
    var miss = middle;
    if rests {
        from_place = surface;
        let ray = normalize_or_zero(ray_direction(frame.before_view, surface + frame.jitter * frame.to_before));
        miss = reflected - mirrored_in(ray, surface_of(pixel).normal);
    }
    let p = dot(du, miss);
    let q = dot(dv, miss);
    let determinant = a * c - b * b;
    if !(determinant > LEAST_BENT_DETERMINANT * a * c) {
        return Place(expected.coordinate, true);
    }
    let newton = vec2f(b * q - c * p, b * p - a * q) / determinant;
    // As seen from pixel centres: history is addressed as motion is.
    let place = from_place + newton;
    let good = length(place - surface) <= settings.mirror.farthest_bent_px;
    return Place(select(expected.coordinate, place / frame.to_before, good), true);
}

// The glossy hit distance of a pixel after the 3x3 filter over the same reflector; a mirror's as it is.
fn filtered_hit(pixel: vec2i) -> f32 {
    let own = surface_of(pixel);
    let own_hit = moving_at(pixel, own.view_depth).glossy_hit;
    if settings.mirror.hit_filter == HIT_FILTER_OFF || is_mirror(own.roughness) {
        return own_hit;
    }
    let h0 = hit_beside(own, pixel, vec2i(-1, -1));
    let h1 = hit_beside(own, pixel, vec2i(0, -1));
    let h2 = hit_beside(own, pixel, vec2i(1, -1));
    let h3 = hit_beside(own, pixel, vec2i(-1, 0));
    let h5 = hit_beside(own, pixel, vec2i(1, 0));
    let h6 = hit_beside(own, pixel, vec2i(-1, 1));
    let h7 = hit_beside(own, pixel, vec2i(0, 1));
    let h8 = hit_beside(own, pixel, vec2i(1, 1));
    if settings.mirror.hit_filter == HIT_FILTER_MIN {
        return min(min(min(h0, h1), min(h2, h3)), min(min(own_hit, h5), min(min(h6, h7), h8)));
    }
    // The value whose rank is the middle.
    let others = u32(h0 < NO_HIT) + u32(h1 < NO_HIT) + u32(h2 < NO_HIT) + u32(h3 < NO_HIT) + u32(h5 < NO_HIT)
        + u32(h6 < NO_HIT) + u32(h7 < NO_HIT) + u32(h8 < NO_HIT);
    let middle = (others + 1u) / 2u;
    return ranked_hit(vec3f(h0, h1, h2), vec3f(h3, own_hit, h5), vec3f(h6, h7, h8), middle);
}

// Beyond every hit distance, `FAR` too.
const NO_HIT: f32 = 2e30;

// The glossy hit distance of a neighbour on the same reflector, else `NO_HIT`.
fn hit_beside(own: Surface, pixel: vec2i, offset: vec2i) -> f32 {
    let q = pixel + offset;
    if !contains(q) {
        return NO_HIT;
    }
    let there = surface_of(q);
    if there.id != own.id || there.view_depth == BACKGROUND {
        return NO_HIT;
    }
    return moving_at(q, there.view_depth).glossy_hit;
}

fn order_hits(a: ptr<function, f32>, b: ptr<function, f32>) {
    let least = min(*a, *b);
    *b = max(*a, *b);
    *a = least;
}

// Of nine values the one of this rank, 0..4: the exchanges of Floyd's network for nine (Knuth, TAOCP 5.3.4) that the lowest
// five need.
fn ranked_hit(a: vec3f, b: vec3f, c: vec3f, rank: u32) -> f32 {
    var v0 = a.x;
    var v1 = a.y;
    var v2 = a.z;
    var v3 = b.x;
    var v4 = b.y;
    var v5 = b.z;
    var v6 = c.x;
    var v7 = c.y;
    var v8 = c.z;
    order_hits(&v0, &v1);
    order_hits(&v3, &v4);
    order_hits(&v6, &v7);
    order_hits(&v1, &v2);
    order_hits(&v4, &v5);
    order_hits(&v7, &v8);
    order_hits(&v0, &v1);
    order_hits(&v3, &v4);
    order_hits(&v6, &v7);
    order_hits(&v0, &v3);
    order_hits(&v3, &v6);
    order_hits(&v0, &v3);
    order_hits(&v1, &v4);
    order_hits(&v4, &v7);
    order_hits(&v1, &v4);
    order_hits(&v5, &v8);
    order_hits(&v2, &v5);
    order_hits(&v1, &v3);
    order_hits(&v2, &v6);
    order_hits(&v4, &v6);
    order_hits(&v2, &v4);
    order_hits(&v2, &v3);
    return select(select(select(select(v4, v3, rank == 3u), v2, rank == 2u), v1, rank == 1u), v0, rank == 0u);
}
