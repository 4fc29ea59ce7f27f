// Twin of reference.rs: stage 1 of the sequence filter, the mean of the samples met along each surface's motion
// trajectory, four colour planes at a time.
//
// The pass supplies the structs `GatherSettings` (as `settings`) and `WindowFrame`, and of the frame at a place of the window
// `frame_at`, `surface_at`, `is_mirror`, `seen_colour_at`, `seen_normal_at`, `motion_at`, `sample_at` and
// `light_at` (mean of a light around a pixel, and its deviation, below 0 where it has no noise).

// What is asked of a pixel's surface.
struct SurfacePoint {
    inverse_depth: f32,
    normal: vec3f,
    position: vec3f,
}

// Distance of `s` from the tangent plane of `reference`.
fn off_plane(s: SurfacePoint, reference: SurfacePoint) -> f32 {
    return abs(dot(s.position - reference.position, reference.normal));
}

// How far a pixel of another frame is believed to show the tracked surface; below 0: it shows another. `miss`: how far motion
// there and back again misses, in pixels; below 0: unknown.
fn same_surface(s: SurfacePoint, tracked: SurfacePoint, pixel_size: f32, length_there: f32, miss: f32) -> f32 {
    if (s.inverse_depth > 0.0) != (tracked.inverse_depth > 0.0) {
        return -1.0;
    }
    let has_normals = any(s.normal != vec3f(0.0)) || any(tracked.normal != vec3f(0.0));
    let cosine = select(1.0, dot(s.normal, tracked.normal), has_normals);
    if pixel_size > 0.0 {
        let off = off_plane(s, tracked);
        let d = s.position - tracked.position;
        let reach = settings.standing_reach * max(pixel_size, off);
        let near = dot(d, d) < reach * reach;
        if off < settings.plane_distance * pixel_size && (near || cosine > settings.plane_normal) {
            return select(-1.0, 1.0, cosine >= settings.standing_normal);
        }
    }
    // It moves, or positions are unknown: the surface there must come from here.
    if miss > settings.round_trip + settings.round_trip_share * length_there {
        return -1.0;
    }
    var depth_change = 0.0;
    if tracked.inverse_depth > 0.0 {
        depth_change = abs(s.inverse_depth / tracked.inverse_depth - 1.0);
    }
    let same = depth_change <= settings.moving_depth && cosine >= settings.moving_normal;
    return select(-1.0, settings.moving_weight, same);
}

// Of the four planes, those that a bit is set of.
fn planes_of(mask: u32) -> vec4<bool> {
    return (vec4u(mask) & vec4u(1u, 2u, 4u, 8u)) != vec4u(0u);
}

var<private> sums: array<vec3f, 4>;
var<private> total: vec4f;
var<private> squares: vec4f;
var<private> second: vec4f;
// Moments about the first sample: differences of large numbers lose less.
var<private> pivot: vec4f;
// What is seen in mirrors and through glass at the pixel that is estimated.
var<private> seen_here: array<vec3f, 2>;
var<private> mirror_here: bool;
// The light around the pixel that is estimated, and the planes without noise there.
var<private> light_here: array<vec2f, 4>;
var<private> free: u32;

// What is left of a sample's weight where its light differs by more than noise from the light here.
fn light_likeness(here: vec2f, there: vec2f) -> f32 {
    let d = here.x - there.x;
    let mean = 0.5 * (here.x + there.x);
    let a = max(here.y, 0.0);
    let noise = a * a + there.y * there.y;
    let low = settings.light_deviations;
    let high = settings.light_deviations_high;
    let scale = settings.light_noise * mean;
    let share = noise / (noise + scale * scale + LEAST_NOISE);
    let deviations = low * low + max(high * high - low * low, 0.0) * share;
    let contrast = settings.light_contrast * mean;
    let allowed = deviations * noise + contrast * contrast;
    let squared = d * d;
    if squared <= allowed {
        return 1.0;
    }
    let left = allowed / squared;
    return left * left;
}

// Of one of the four planes; black light has mean 0.
fn light_of(k: u32, there: WindowFrame, pixel: vec2i) -> vec2f {
    if there.places[k] != PLANE_THERE {
        return vec2f(0.0);
    }
    return light_at(k, there, pixel);
}

// How unlike the things are that the pixel shows here, and `pixel` of another frame there, in a mirror or through
// glass, as the exponent of a weight.
fn seen_distance(here: WindowFrame, there: WindowFrame, pixel: vec2i) -> f32 {
    if !has(here, HAS_SEEN) || !has(there, HAS_SEEN) {
        return 0.0;
    }
    // Light that was divided by what it shows never mixes with light that was not.
    if mirror_here != is_mirror(there, pixel) {
        return APART;
    }
    let d = seen_here[0] - seen_colour_at(there, pixel);
    let normal = seen_normal_at(there, pixel);
    let has_normals = any(seen_here[1] != vec3f(0.0)) || any(normal != vec3f(0.0));
    let bend = select(0.0, 1.0 - dot(seen_here[1], normal), has_normals);
    return dot(d, d) * 0.5 / (settings.seen_albedo * settings.seen_albedo) + settings.seen_normal * bend;
}

// What is left of each plane's weight where the light of another frame differs from the light here; 0 where there is no noise.
fn likenesses(there: WindowFrame, pixel: vec2i) -> vec4f {
    var found = vec4f(0.0);
    for (var k = 0u; k < settings.planes; k++) {
        if (free & (1u << k)) == 0u {
            let around = light_of(k, there, pixel);
            found[k] = light_likeness(light_here[k], vec2f(around.x, max(around.y, 0.0)));
        }
    }
    return found;
}

// One sample: `trust` in the surface, times each plane's weight; only for the planes in `mask`.
fn add(there: WindowFrame, pixel: vec2i, trust: f32, of_frame: vec4f, mask: u32) {
    var weights = trust * of_frame;
    let of_mirrors = settings.seen & mask;
    if of_mirrors != 0u {
        let likeness = weight(seen_distance(frame_at(settings.centre), there, pixel));
        weights *= select(vec4f(1.0), vec4f(likeness), planes_of(of_mirrors));
    }
    let counts_here = planes_of(mask) & (there.places != vec4u(PLANE_UNKNOWN));
    weights = select(vec4f(0.0), weights, counts_here);
    var off = -pivot;
    for (var k = 0u; k < settings.planes; k++) {
        if weights[k] > 0.0 && there.places[k] == PLANE_THERE {
            let colour = sample_at(k, there, pixel);
            off[k] = luminance(colour) - pivot[k];
            sums[k] += weights[k] * colour;
        }
    }
    second += weights * off * off;
    total += weights;
    squares += weights * weights;
}

// Samples along the motion trajectory of a pixel, forward or back in time.
fn follow(pixel: vec2i, forward: bool, reflected: bool, mask: u32) {
    // A band counts rows as the whole picture does: sums of floats are the same.
    let extent = vec2f(f32(settings.size.x), f32(settings.picture_height));
    let sign = select(-1, 1, forward);
    let steps = min(select(settings.centre, settings.count - 1 - settings.centre, forward), settings.steps);
    let origin = vec2f(f32(pixel.x), f32(settings.first_row + pixel.y));
    var at = origin;
    var nearest = pixel;
    var tracked = surface_at(frame_at(settings.centre), pixel);
    var power = vec4f(1.0);
    for (var k = 1; k <= steps; k++) {
        let before = frame_at(settings.centre + sign * (k - 1));
        let there = frame_at(settings.centre + sign * k);
        power *= settings.decay;
        if !has_motion(before, forward) {
            return;
        }
        let m = motion_at(before, forward, reflected, nearest);
        at += m;
        // Unknown motion ends the trajectory.
        if !(all(at > vec2f(-0.5)) && all(at < extent - 0.5)) {
            return;
        }
        if abs(at.y - origin.y) > settings.farthest {
            return;
        }
        let repeated = (has(before, HAS_REPEATED_NOISE) || has(there, HAS_REPEATED_NOISE))
            && all(abs(at - origin) < vec2f(settings.same_noise));
        let has_back = has_motion(there, !forward);
        let corner = floor(at);
        let t = at - corner;
        var pixel_size = 0.0;
        if tracked.inverse_depth > 0.0 {
            pixel_size = there.pixel_angle / tracked.inverse_depth;
        }
        // Of the four pixels around, the nearest that shows the surface: the one with the largest bilinear share. Mostly that is the
        // nearest of all, and the others are not asked. Along the trajectory of what a mirror shows, those that show the same there
        // go first.
        let first = select(0, 1, t.x > 0.5) | select(0, 2, t.y > 0.5);
        var best = 0.0;
        var best_alike = false;
        var trust = 0.0;
        for (var i = 0; i < 4; i++) {
            let tap = i ^ first;
            let d = vec2i(tap & 1, tap >> 1);
            let share = select(1.0 - t.x, t.x, d.x == 1) * select(1.0 - t.y, t.y, d.y == 1);
            var q = vec2i(corner) + d;
            q.y -= settings.first_row;
            if share <= 0.0 || share < settings.least_share || any(q < vec2i(0)) || any(q >= vec2i(settings.size)) {
                continue;
            }
            if best_alike && share <= best {
                continue;
            }
            let alike = !reflected || weight(seen_distance(frame_at(settings.centre), there, q)) >= settings.seen_alike;
            if !alike && (best_alike || share <= best) {
                continue;
            }
            var miss = -1.0;
            if has_back {
                miss = length(m + motion_at(there, !forward, reflected, q));
            }
            let found = same_surface(surface_at(there, q), tracked, pixel_size, length(m), miss);
            if found >= 0.0 {
                best = share;
                best_alike = alike;
                trust = found;
                nearest = q;
            }
        }
        if best == 0.0 {
            return;
        }
        if !repeated {
            add(there, nearest, trust, power * likenesses(there, nearest), mask);
        }
        let s = surface_at(there, nearest);
        // A surface that moves carries its reference along; one that stands keeps the first, so that errors do not add.
        if !(pixel_size > 0.0 && off_plane(s, tracked) < settings.plane_distance * pixel_size) {
            tracked = s;
        }
    }
}

// All samples of the pixel, itself first.
fn gather_trajectories(pixel: vec2i, reflected: bool, mask: u32) {
    add(frame_at(settings.centre), pixel, 1.0, vec4f(1.0), mask);
    follow(pixel, false, reflected, mask);
    if settings.future != 0u {
        follow(pixel, true, reflected, mask);
    }
}

// What a pixel's samples come to: means with the variance of one sample's luminance as the fourth number, and the samples
// that each mean is worth.
struct Gathered {
    means: array<vec4f, 4>,
    counts: vec4f,
}

// Stage 1 at one pixel.
fn gather(pixel: vec2i) -> Gathered {
    let here = frame_at(settings.centre);
    mirror_here = is_mirror(here, pixel);
    if has(here, HAS_SEEN) {
        seen_here[0] = seen_colour_at(here, pixel);
        seen_here[1] = seen_normal_at(here, pixel);
    }
    for (var k = 0u; k < settings.planes; k++) {
        if here.places[k] == PLANE_THERE {
            pivot[k] = luminance(sample_at(k, here, pixel));
        }
        light_here[k] = light_of(k, here, pixel);
        if light_here[k].y < 0.0 {
            free |= 1u << k;
        }
    }
    let all_planes = (1u << settings.planes) - 1u;
    var reflected = 0u;
    if mirror_here {
        reflected = settings.reflected;
    }
    if (all_planes & ~reflected) != 0u {
        gather_trajectories(pixel, false, all_planes & ~reflected);
    }
    // Along the trajectory of what a mirror shows.
    if reflected != 0u {
        gather_trajectories(pixel, true, reflected);
    }
    var result: Gathered;
    for (var k = 0u; k < settings.planes; k++) {
        let colour = sums[k] / total[k];
        let is_free = (free & (1u << k)) != 0u;
        let count = select(total[k] * total[k] / squares[k], FREE_COUNT, is_free);
        let mean = luminance(colour) - pivot[k];
        let spread = max(second[k] / total[k] - mean * mean, 0.0);
        var moment = 0.0;
        if count > LEAST_COUNT && !is_free {
            moment = spread * count / (count - 1.0);
        }
        result.means[k] = vec4f(colour, moment);
        result.counts[k] = count;
    }
    return result;
}
