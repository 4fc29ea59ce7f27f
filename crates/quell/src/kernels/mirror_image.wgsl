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
    var trusts = array(0.0, 0.0, 0.0, 0.0);
    for (var k = 0; k < 4; k++) {
        let q = footprint_pixel(footprint, k);
        if !contains_before(q) {
            continue;
        }
        let there = before_at(q);
        if there.depth == BACKGROUND
            || there.id != own.id
            || abs(there.roughness - own.roughness) > settings.mirror.reflector_roughness
            || dot(there.normal, expected.normal) < settings.mirror.reflector_normal_min {
            continue;
        }
        trusts[k] = distance_trust(expected, q, rejection);
        if is_mirror(own.roughness) {
            trusts[k] *= same_hit(q, hit, least);
        }
    }
    return lookup_of(footprint, trusts);
}

// The reflector at a pixel as the four pixels at its old place show it: `visible` is their lookup.
//
// A mirror that turns hardly moves its own points, but moves its image twice as fast: motion alone cannot tell that
// it rests. It counts as resting where its normal changed by no more than it varies between the four pixels, and its
// plane did not shift; then `expected` stays as it is. Else it becomes their mean position and normal.
fn previous_reflector(expected: Expected, visible: Lookup, pixel: vec2i) -> Expected {
    var taps = visible;
    var position = vec3f(0.0);
    var sum = vec3f(0.0);
    for (var k = 0; k < 4; k++) {
        if taps.weight[k] > 0.0 {
            position += taps.weight[k] * world_before(taps.pixel[k]);
            sum += taps.weight[k] * before_at(taps.pixel[k]).normal;
        }
    }
    let normal = normalize_or_zero(sum);
    var spread = 0.0;
    for (var k = 0; k < 4; k++) {
        if taps.weight[k] > 0.0 {
            spread = max(spread, length(before_at(taps.pixel[k]).normal - normal));
        }
    }
    let turned = length(surface_of(pixel).normal - normal) > spread + SAME_NORMAL;
    let shift = abs(dot(world_of(pixel) - position, normal));
    let shifted = shift > SAME_PLANE_PX * pixel_size_at(frame.view, expected.view_depth);
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
fn bent_coordinate(expected: Expected, visible: Lookup, hit_distance: f32, pixel: vec2i) -> Place {
    var taps = visible;
    var first = -1;
    var all_seen = true;
    var is_plane = true;
    for (var k = 0; k < 4; k++) {
        if !(taps.weight[k] > 0.0) {
            all_seen = false;
            continue;
        }
        if first < 0 {
            first = k;
        }
        let change = before_at(taps.pixel[k]).normal - before_at(taps.pixel[first]).normal;
        is_plane = is_plane && length(change) <= SAME_NORMAL;
    }
    if first < 0 || is_plane {
        return Place(vec2f(0.0), false);
    }
    // In pixels of the frame before, as its miss is.
    let surface = to_before(expected.coordinate);
    if !all_seen {
        return Place(expected.coordinate, true);
    }
    let eye_ray = normalize_or_zero(ray_direction(frame.view, sample_position(pixel)));
    let reflected = mirrored_in(eye_ray, surface_of(pixel).normal);
    let is_finite = hit_distance < FAR;
    let hit = world_of(pixel) + reflected * select(0.0, hit_distance, is_finite);
    let f0 = bent_miss(taps.pixel[0], hit, is_finite, reflected);
    let f1 = bent_miss(taps.pixel[1], hit, is_finite, reflected);
    let f2 = bent_miss(taps.pixel[2], hit, is_finite, reflected);
    let f3 = bent_miss(taps.pixel[3], hit, is_finite, reflected);
    let middle = 0.25 * ((f0 + f1) + (f2 + f3));
    let du = 0.5 * ((f1 - f0) + (f3 - f2));
    let dv = 0.5 * ((f2 - f0) + (f3 - f1));
    let a = dot(du, du);
    let b = dot(du, dv);
    let c = dot(dv, dv);
    let p = dot(du, middle);
    let q = dot(dv, middle);
    let determinant = a * c - b * b;
    if !(determinant > LEAST_BENT_DETERMINANT * a * c) {
        return Place(expected.coordinate, true);
    }
    let newton = vec2f(b * q - c * p, b * p - a * q) / determinant;
    let place = floor(surface - 0.5) + 1.0 + newton;
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
    var values: array<f32, 9>;
    var count = 0u;
    var least = own_hit;
    for (var k = 0; k < 9; k++) {
        let q = pixel + vec2i(k % 3, k / 3) - 1;
        if contains(q) {
            let there = surface_of(q);
            if there.id == own.id && there.view_depth != BACKGROUND {
                let hit = moving_at(q, there.view_depth).glossy_hit;
                values[count] = hit;
                count++;
                least = min(least, hit);
            }
        }
    }
    if settings.mirror.hit_filter == HIT_FILTER_MIN {
        return least;
    }
    // The value whose rank is the middle.
    let middle = count / 2u;
    for (var i = 0u; i < count; i++) {
        var below = 0u;
        var equal = 0u;
        for (var j = 0u; j < count; j++) {
            below += select(0u, 1u, values[j] < values[i]);
            equal += select(0u, 1u, values[j] == values[i]);
        }
        if below <= middle && middle < below + equal {
            return values[i];
        }
    }
    return own_hit;
}
