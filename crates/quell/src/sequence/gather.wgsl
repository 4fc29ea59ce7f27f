// Stage 1: the mean of the samples met along each surface's way through the frames, four colour planes at a time. Twin
// of follow.rs (where the surface lies in the other frames) and accumulate.rs (the samples met there).

struct Gather {
    size: vec2u,
    // Row of the picture at which this begins, and rows of the picture.
    first_row: i32,
    picture_height: i32,
    // Frames in the window, the place among them of the one that is estimated, and frames that a way leads through at
    // most.
    count: i32,
    centre: i32,
    steps: i32,
    future: u32,
    // Rows up or down that a way may lead.
    farthest: f32,
    plane_distance: f32,
    round_trip: f32,
    seen_albedo: f32,
    seen_normal: f32,
    // The planes' bits: of light that is seen in mirrors and through glass, and of what moves by its own motion there.
    seen: u32,
    reflected: u32,
    // Planes, and whether these are the frame's first.
    planes: u32,
    begins: u32,
    // Weight of each plane one frame further away.
    decay: vec4f,
}

// A frame of the window.
struct Member {
    layer: i32,
    has: u32,
    // World-space size of a pixel per unit of depth; 0 where positions are unknown.
    pixel_angle: f32,
    unused: f32,
    // Where it has each plane.
    places: vec4u,
}

const TO_PREVIOUS = 1u;
const TO_NEXT = 2u;
const REFLECTION_TO_PREVIOUS = 4u;
const REFLECTION_TO_NEXT = 8u;
const SEEN = 16u;
const REPEATS_NOISE = 32u;

// A plane is black in that frame, among its samples, or it was clean there and is not kept.
const BLACK = 0u;
const AT = 1u;
const UNKNOWN = 2u;

@group(0) @binding(0) var<uniform> told: Gather;
// A layer is a frame. 1/depth (0: background) and the position.
@group(0) @binding(1) var surfaces: texture_2d_array<f32>;
// Unit normal, or zeros; the fourth is 1 in a mirror or glass.
@group(0) @binding(2) var surface_normals: texture_2d_array<f32>;
// What mirrors and glass show: colours, tone-mapped, and unit normals.
@group(0) @binding(3) var seen_colours: texture_2d_array<f32>;
@group(0) @binding(4) var seen_normals: texture_2d_array<f32>;
// Motion in pixels; unknown motion leads far out of the picture.
@group(0) @binding(5) var to_previous: texture_2d_array<f32>;
@group(0) @binding(6) var to_next: texture_2d_array<f32>;
@group(0) @binding(7) var reflection_to_previous: texture_2d_array<f32>;
@group(0) @binding(8) var reflection_to_next: texture_2d_array<f32>;
@group(0) @binding(9) var samples_0: texture_2d_array<f32>;
@group(0) @binding(10) var samples_1: texture_2d_array<f32>;
@group(0) @binding(11) var samples_2: texture_2d_array<f32>;
@group(0) @binding(12) var samples_3: texture_2d_array<f32>;
@group(0) @binding(13) var<storage, read> members: array<Member>;
// Means, with the variance of one sample's luminance as the fourth number.
@group(0) @binding(14) var<storage, read_write> mean_0: array<vec4f>;
@group(0) @binding(15) var<storage, read_write> mean_1: array<vec4f>;
@group(0) @binding(16) var<storage, read_write> mean_2: array<vec4f>;
@group(0) @binding(17) var<storage, read_write> mean_3: array<vec4f>;
// The samples that each mean is worth, and the largest count of all planes of the frame.
@group(0) @binding(18) var<storage, read_write> counts: array<vec4f>;
@group(0) @binding(19) var<storage, read_write> most: array<f32>;

// Weight of a sample that was matched by its motion alone.
const MOVING_WEIGHT = 0.7;
// Least cosine between normals of one surface now and then: standing, and turning.
const STANDING_NORMAL = 0.6;
const MOVING_NORMAL = 0.7;
// Pixels within which a point of the same plane is the same surface, whatever its normal; beyond, normals must agree.
const STANDING_REACH = 6.0;
const PLANE_NORMAL = 0.9;
// Part of a motion's length by which the way there and back may miss, beside `gather.round_trip`.
const ROUND_TRIP_SHARE = 0.05;
// Most relative change of depth a frame of a surface that moves.
const MOVING_DEPTH = 0.1;
// Taps with less of the bilinear weight are left out.
const LEAST_SHARE = 0.01;
// Noise that repeats (one seed for all frames) sticks to the pixel: nearer than this it is the same noise.
const SAME_NOISE = 0.75;
// Energy between light that was divided by what it shows and light that was not.
const APART = 1e9;

// What the filters ask of a pixel's guides.
struct Surface {
    inverse_depth: f32,
    normal: vec3f,
    position: vec3f,
}

fn surface_at(there: Member, pixel: vec2i) -> Surface {
    let texel = textureLoad(surfaces, pixel, there.layer, 0);
    return Surface(texel.x, textureLoad(surface_normals, pixel, there.layer, 0).xyz, texel.yzw);
}

// True where the pixel is a mirror or glass.
fn specular(there: Member, pixel: vec2i) -> bool {
    return textureLoad(surface_normals, pixel, there.layer, 0).w > 0.0;
}

fn has(there: Member, what: u32) -> bool {
    return (there.has & what) != 0u;
}

// Motion of a frame's surfaces, or of what mirrors and glass show: whether it is there.
fn has_motion(there: Member, forward: bool) -> bool {
    return has(there, select(TO_PREVIOUS, TO_NEXT, forward));
}

fn motion(there: Member, forward: bool, reflected: bool, pixel: vec2i) -> vec2f {
    if forward {
        if reflected && has(there, REFLECTION_TO_NEXT) {
            return textureLoad(reflection_to_next, pixel, there.layer, 0).xy;
        }
        return textureLoad(to_next, pixel, there.layer, 0).xy;
    }
    if reflected && has(there, REFLECTION_TO_PREVIOUS) {
        return textureLoad(reflection_to_previous, pixel, there.layer, 0).xy;
    }
    return textureLoad(to_previous, pixel, there.layer, 0).xy;
}

// Distance of `s` from the tangent plane of `reference`.
fn off_plane(s: Surface, reference: Surface) -> f32 {
    return abs(dot(s.position - reference.position, reference.normal));
}

// How far a pixel of another frame is believed to show the tracked surface; 0: it shows another. `miss`: of the way
// there and back, in pixels; below 0: unknown.
fn same_surface(s: Surface, tracked: Surface, pixel_size: f32, length_there: f32, miss: f32) -> f32 {
    if (s.inverse_depth > 0.0) != (tracked.inverse_depth > 0.0) {
        return 0.0;
    }
    let has_normals = any(s.normal != vec3f(0.0)) || any(tracked.normal != vec3f(0.0));
    let cosine = select(1.0, dot(s.normal, tracked.normal), has_normals);
    if pixel_size > 0.0 {
        let off = off_plane(s, tracked);
        let d = s.position - tracked.position;
        let reach = STANDING_REACH * max(pixel_size, off);
        let near = dot(d, d) < reach * reach;
        if off < told.plane_distance * pixel_size && (near || cosine > PLANE_NORMAL) {
            return select(0.0, 1.0, cosine >= STANDING_NORMAL);
        }
    }
    // It moves, or positions are unknown: the surface there must come from here.
    if miss > told.round_trip + ROUND_TRIP_SHARE * length_there {
        return 0.0;
    }
    var depth_change = 0.0;
    if tracked.inverse_depth > 0.0 {
        depth_change = abs(s.inverse_depth / tracked.inverse_depth - 1.0);
    }
    return select(0.0, MOVING_WEIGHT, depth_change <= MOVING_DEPTH && cosine >= MOVING_NORMAL);
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
var<private> specular_here: bool;

fn sample_of(k: u32, there: Member, pixel: vec2i) -> vec3f {
    switch k {
        case 0u: { return textureLoad(samples_0, pixel, there.layer, 0).xyz; }
        case 1u: { return textureLoad(samples_1, pixel, there.layer, 0).xyz; }
        case 2u: { return textureLoad(samples_2, pixel, there.layer, 0).xyz; }
        default: { return textureLoad(samples_3, pixel, there.layer, 0).xyz; }
    }
}

// How unlike the things are that the pixel shows here, and `pixel` of another frame there, in a mirror or through
// glass, as the exponent of a weight.
fn seen_energy(here: Member, there: Member, pixel: vec2i) -> f32 {
    if !has(here, SEEN) || !has(there, SEEN) {
        return 0.0;
    }
    // Light that was divided by what it shows never mixes with light that was not.
    if specular_here != specular(there, pixel) {
        return APART;
    }
    let d = seen_here[0] - textureLoad(seen_colours, pixel, there.layer, 0).xyz;
    let normal = textureLoad(seen_normals, pixel, there.layer, 0).xyz;
    let has_normals = any(seen_here[1] != vec3f(0.0)) || any(normal != vec3f(0.0));
    let bend = select(0.0, 1.0 - dot(seen_here[1], normal), has_normals);
    return dot(d, d) * 0.5 / (told.seen_albedo * told.seen_albedo) + told.seen_normal * bend;
}

// One tap: `share` of the pixel, times what each plane's weight has fallen to; only for the planes in `mask`.
fn add(there: Member, pixel: vec2i, share: f32, power: vec4f, mask: u32) {
    var weights = share * power;
    let of_mirrors = told.seen & mask;
    if of_mirrors != 0u {
        let likeness = weight(seen_energy(members[told.centre], there, pixel));
        weights *= select(vec4f(1.0), vec4f(likeness), planes_of(of_mirrors));
    }
    let counts_here = planes_of(mask) & (there.places != vec4u(UNKNOWN));
    weights = select(vec4f(0.0), weights, counts_here);
    var off = -pivot;
    for (var k = 0u; k < told.planes; k++) {
        if weights[k] > 0.0 && there.places[k] == AT {
            let colour = sample_of(k, there, pixel);
            off[k] = luminance(colour) - pivot[k];
            sums[k] += weights[k] * colour;
        }
    }
    second += weights * off * off;
    total += weights;
    squares += weights * weights;
}

fn follow(pixel: vec2i, forward: bool, reflected: bool, mask: u32) {
    // A band counts rows as the whole picture does: sums of floats are the same.
    let extent = vec2f(f32(told.size.x), f32(told.picture_height));
    let sign = select(-1, 1, forward);
    let steps = min(select(told.centre, told.count - 1 - told.centre, forward), told.steps);
    let origin = vec2f(f32(pixel.x), f32(told.first_row + pixel.y));
    var at = origin;
    var nearest = pixel;
    var tracked = surface_at(members[told.centre], pixel);
    var power = vec4f(1.0);
    for (var k = 1; k <= steps; k++) {
        let before = members[told.centre + sign * (k - 1)];
        let there = members[told.centre + sign * k];
        power *= told.decay;
        if !has_motion(before, forward) {
            return;
        }
        let m = motion(before, forward, reflected, nearest);
        at += m;
        // Unknown motion ends the way.
        if !(all(at > vec2f(-0.5)) && all(at < extent - 0.5)) {
            return;
        }
        if abs(at.y - origin.y) > told.farthest {
            return;
        }
        let repeated = (has(before, REPEATS_NOISE) || has(there, REPEATS_NOISE))
            && all(abs(at - origin) < vec2f(SAME_NOISE));
        let has_back = has_motion(there, !forward);
        let corner = floor(at);
        let t = at - corner;
        var pixel_size = 0.0;
        if tracked.inverse_depth > 0.0 {
            pixel_size = there.pixel_angle / tracked.inverse_depth;
        }
        var best = 0.0;
        for (var tap = 0; tap < 4; tap++) {
            let d = vec2i(tap & 1, tap >> 1);
            let share = select(1.0 - t.x, t.x, d.x == 1) * select(1.0 - t.y, t.y, d.y == 1);
            var q = vec2i(corner) + d;
            q.y -= told.first_row;
            if share < LEAST_SHARE || any(q < vec2i(0)) || any(q >= vec2i(told.size)) {
                continue;
            }
            var miss = -1.0;
            if has_back {
                miss = length(m + motion(there, !forward, reflected, q));
            }
            let trust = same_surface(surface_at(there, q), tracked, pixel_size, length(m), miss);
            if trust == 0.0 {
                continue;
            }
            if share > best {
                best = share;
                nearest = q;
            }
            if !repeated {
                add(there, q, share * trust, power, mask);
            }
        }
        if best == 0.0 {
            return;
        }
        let s = surface_at(there, nearest);
        // A surface that moves carries its reference along; one that stands keeps the first, so that errors do not add.
        if !(pixel_size > 0.0 && off_plane(s, tracked) < told.plane_distance * pixel_size) {
            tracked = s;
        }
    }
}

// All taps of the pixel, itself first.
fn gather_along(pixel: vec2i, reflected: bool, mask: u32) {
    add(members[told.centre], pixel, 1.0, vec4f(1.0), mask);
    follow(pixel, false, reflected, mask);
    if told.future != 0u {
        follow(pixel, true, reflected, mask);
    }
}

@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if any(pixel >= vec2i(told.size)) {
        return;
    }
    let p = id.y * told.size.x + id.x;
    let here = members[told.centre];
    specular_here = specular(here, pixel);
    if has(here, SEEN) {
        seen_here[0] = textureLoad(seen_colours, pixel, here.layer, 0).xyz;
        seen_here[1] = textureLoad(seen_normals, pixel, here.layer, 0).xyz;
    }
    for (var k = 0u; k < told.planes; k++) {
        if here.places[k] == AT {
            pivot[k] = luminance(sample_of(k, here, pixel));
        }
    }
    let all_planes = (1u << told.planes) - 1u;
    var reflected = 0u;
    if specular_here {
        reflected = told.reflected;
    }
    if (all_planes & ~reflected) != 0u {
        gather_along(pixel, false, all_planes & ~reflected);
    }
    // Along the way of what a mirror shows.
    if reflected != 0u {
        gather_along(pixel, true, reflected);
    }
    var worth = vec4f(0.0);
    var largest = 1.0;
    if told.begins == 0u {
        largest = most[p];
    }
    for (var k = 0u; k < told.planes; k++) {
        let colour = sums[k] / total[k];
        let count = total[k] * total[k] / squares[k];
        let mean = luminance(colour) - pivot[k];
        let spread = max(second[k] / total[k] - mean * mean, 0.0);
        var moment = 0.0;
        if count > 1.01 {
            moment = spread * count / (count - 1.0);
        }
        worth[k] = count;
        largest = max(largest, count);
        let result = vec4f(colour, moment);
        switch k {
            case 0u: { mean_0[p] = result; }
            case 1u: { mean_1[p] = result; }
            case 2u: { mean_2[p] = result; }
            default: { mean_3[p] = result; }
        }
    }
    counts[p] = worth;
    most[p] = largest;
}
