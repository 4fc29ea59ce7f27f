// Twin of reproject.rs: where a surface was in the previous frame, and which of the four pixels there still show it.
//
// The pass supplies the planes of the guides, now and before.
//
// The four pixels of a footprint are spelt out, and their weights are a vector: arrays that a loop indexes lie in memory on a
// GPU, not in registers.

// The surface that history must show: where it was, as far as motion says.
struct Expected {
    // Its place in the previous image, continuous coordinate in pixels of this frame.
    coordinate: vec2f,
    // A point of it, at the previous frame's time.
    position: vec3f,
    // Its normal at that time.
    normal: vec3f,
    // View depth now: the scale of distances.
    view_depth: f32,
    // It moved by itself.
    moved: bool,
    // False: background, unknown motion, off screen, or a moving surface of which the previous image has no trace.
    found: bool,
}

// Up to four pixels of the previous image with weights that add up to 1, and how far they are to be trusted.
struct Lookup {
    // First pixel of the footprint.
    first: vec2i,
    // Weights of its four pixels; 0 for those that show something else.
    weight: vec4f,
    // rho, 0..1; 0: there is no history.
    trust: f32,
    // Colours are fetched from 4x4 pixels by Catmull and Rom's spline: all four show what is looked for.
    spline: bool,
}

fn no_lookup() -> Lookup {
    return Lookup(vec2i(0), vec4f(0.0), 0.0, false);
}

// Position of a pixel of the previous image, whose depth must be finite.
fn world_before(pixel: vec2i) -> vec3f {
    return world(frame.before_view, sample_position_before(pixel), depth_before(pixel));
}

fn sample_position_before(pixel: vec2i) -> vec2f {
    return pixel_centre(pixel) + frame.before_jitter;
}

fn on_screen(coordinate: vec2f) -> bool {
    let guard = settings.surface.guard_band;
    return all(coordinate >= vec2f(guard)) && all(coordinate <= vec2f(frame.whole) - guard);
}

// The bilinear footprint: first pixel, and the weight of each of the four.
struct Footprint {
    first: vec2i,
    weight: vec4f,
}

fn footprint_of(coordinate: vec2f) -> Footprint {
    let corner = coordinate - 0.5;
    let base = floor(corner);
    let t = corner - base;
    return Footprint(
        own_pixel(vec2i(base)),
        vec4f((1.0 - t.x) * (1.0 - t.y), t.x * (1.0 - t.y), (1.0 - t.x) * t.y, t.x * t.y),
    );
}

// Pixel k of the footprint that begins at `first`.
fn footprint_pixel(first: vec2i, k: i32) -> vec2i {
    return first + vec2i(k & 1, k >> 1u);
}

// The pixel of a footprint that shows an object with the largest weight, and that weight; negative: none does.
struct Nearest {
    pixel: vec2i,
    weight: f32,
}

fn nearer(so_far: Nearest, q: vec2i, weight: f32, id: u32) -> Nearest {
    if contains_before(q) {
        let there = before_at(q);
        if there.depth != BACKGROUND && there.id == id && weight >= so_far.weight {
            return Nearest(q, weight);
        }
    }
    return so_far;
}

// Matte light: the surface at a pixel, where it was.
fn expected_surface(pixel: vec2i) -> Expected {
    let own = surface_of(pixel);
    let motion = moving_at(pixel, own.view_depth).motion;
    var expected = Expected(vec2f(0.0), vec3f(0.0), own.normal, own.view_depth, false, false);
    expected.coordinate = pixel_centre(pixel) + motion;
    if own.view_depth == BACKGROUND || !on_screen(expected.coordinate) {
        return expected;
    }
    expected.position = own.position;
    let by_camera = pixel_of(frame.previous_view, expected.position);
    let difference = by_camera.coordinate - sample_position(pixel) - motion;
    expected.moved = !by_camera.found || length(difference) > settings.surface.static_motion;
    if !expected.moved {
        expected.found = true;
        return expected;
    }
    // Motion gives the pixel but not the depth: the nearest previous pixel of the same object anchors the plane.
    let footprint = footprint_of(to_before(expected.coordinate));
    var nearest = Nearest(vec2i(0), -1.0);
    nearest = nearer(nearest, footprint_pixel(footprint.first, 0), footprint.weight.x, own.id);
    nearest = nearer(nearest, footprint_pixel(footprint.first, 1), footprint.weight.y, own.id);
    nearest = nearer(nearest, footprint_pixel(footprint.first, 2), footprint.weight.z, own.id);
    nearest = nearer(nearest, footprint_pixel(footprint.first, 3), footprint.weight.w, own.id);
    if nearest.weight < 0.0 {
        return expected;
    }
    let anchor = world_before(nearest.pixel);
    let travelled =
        abs(view_depth_of(frame.previous_view, anchor) - view_depth_of(frame.previous_view, expected.position));
    if travelled > settings.surface.moving_depth * own.view_depth {
        return expected;
    }
    expected.position = anchor;
    expected.normal = before_at(nearest.pixel).normal;
    expected.found = true;
    return expected;
}

fn distance_trust(expected: Expected, q: vec2i, rejection: u32) -> f32 {
    let surface = settings.surface;
    if rejection == REJECTION_OFF {
        return 1.0;
    }
    let offset = world_before(q) - expected.position;
    var distance = length(offset);
    var begin = surface.point_distance * expected.view_depth;
    if rejection == REJECTION_PLANE {
        distance = abs(dot(offset, expected.normal));
        begin = max(
            surface.plane_distance * expected.view_depth,
            surface.pixel_distance * pixel_size_at(frame.view, expected.view_depth),
        );
    }
    return 1.0 - hermite_step(begin, surface.falloff * begin, distance);
}

// The lookup of a footprint whose pixels are trusted so far.
fn lookup_of(footprint: Footprint, trusts: vec4f) -> Lookup {
    let weight = select(vec4f(0.0), footprint.weight, trusts > vec4f(0.0));
    let total = weight.x + weight.y + weight.z + weight.w;
    if total < LEAST_FOOTPRINT {
        return no_lookup();
    }
    let trusted = weight.x * trusts.x + weight.y * trusts.y + weight.z * trusts.z + weight.w * trusts.w;
    return Lookup(footprint.first, weight / total, trusted / total, false);
}

// How far a pixel of the previous image is to be trusted to show the expected surface of this object.
fn surface_trust(expected: Expected, q: vec2i, id: u32) -> f32 {
    if !contains_before(q) {
        return 0.0;
    }
    let there = before_at(q);
    if there.depth == BACKGROUND
        || there.id != id
        || dot(there.normal, expected.normal) < settings.surface.normal_min {
        return 0.0;
    }
    return distance_trust(expected, q, settings.surface.rejection);
}

// The bilinear footprint at the expected place, each of its four pixels tested singly.
fn surface_lookup(expected: Expected, pixel: vec2i) -> Lookup {
    let id = surface_of(pixel).id;
    let footprint = footprint_of(to_before(expected.coordinate));
    let trusts = vec4f(
        surface_trust(expected, footprint_pixel(footprint.first, 0), id),
        surface_trust(expected, footprint_pixel(footprint.first, 1), id),
        surface_trust(expected, footprint_pixel(footprint.first, 2), id),
        surface_trust(expected, footprint_pixel(footprint.first, 3), id),
    );
    var found = lookup_of(footprint, trusts);
    // The mean over the part of the footprint that shows the surface lies beside the place: less of it, less trust.
    let part = dot(select(vec4f(0.0), footprint.weight, trusts > vec4f(0.0)), vec4f(1.0));
    if part > 0.0 {
        found.trust *= part / (part + settings.surface.lost_footprint * (1.0 - part));
    }
    return found;
}
