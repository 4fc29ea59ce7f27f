// Twin of reference.rs, the net's form: every pixel averaged with those of its own frame and of others whose signatures are near.
//
// The pass supplies `signature_at` (as it was kept), `net` (weights) and what statistics.wgsl asks for.

// By what squared differences are multiplied: of the four parts of a signature, for taps of the frame itself, then for others.
struct Bandwidths {
    own_parts: vec4f,
    other_parts: vec4f,
    offset: vec2f,
    away: f32,
    // Share of the input in the colours that are averaged, 0..1.
    raw: f32,
}

// A signature: four parts of three numbers, and the brightness.
struct Signature {
    near: vec3f,
    wide: vec3f,
    albedo: vec3f,
    normal: vec3f,
    brightness: f32,
}

fn restored(v: vec3f) -> vec3f {
    return v * abs(v);
}

fn signature_of(kept: array<vec4f, 4>) -> Signature {
    return Signature(
        restored(kept[0].xyz),
        restored(vec3f(kept[0].w, kept[1].xy)),
        vec3f(kept[1].zw, kept[2].x),
        kept[2].yzw,
        kept[3].x,
    );
}

// A net with two hidden layers of eight units and three times four outputs, whose weights begin at `first`.
fn run_net(values_read: array<f32, 11>, first: u32) -> array<vec4f, 3> {
    var values = values_read;
    var at = first;
    var a = net[at];
    var b = net[at + 1u];
    at += 2u;
    for (var i = 0u; i < 11u; i++) {
        a += net[at] * values[i];
        b += net[at + 1u] * values[i];
        at += 2u;
    }
    var hidden = array<vec4f, 2>(max(a, vec4f(0.0)), max(b, vec4f(0.0)));
    a = net[at];
    b = net[at + 1u];
    at += 2u;
    for (var i = 0u; i < 8u; i++) {
        let v = hidden[i / 4u][i % 4u];
        a += net[at] * v;
        b += net[at + 1u] * v;
        at += 2u;
    }
    hidden = array<vec4f, 2>(max(a, vec4f(0.0)), max(b, vec4f(0.0)));
    var said = array<vec4f, 3>(net[at], net[at + 1u], net[at + 2u]);
    at += 3u;
    for (var i = 0u; i < 8u; i++) {
        let v = hidden[i / 4u][i % 4u];
        said[0] += net[at] * v;
        said[1] += net[at + 1u] * v;
        said[2] += net[at + 2u] * v;
        at += 3u;
    }
    return said;
}

fn limited_exp2(v: f32) -> f32 {
    return exp2_of(clamp(v, -MOST_BANDWIDTH, MOST_BANDWIDTH));
}

fn bandwidths(p: Pooled, inverse: f32) -> Bandwidths {
    let all = inputs_of(p);
    let read = array<f32, 11>(all[0], all[1], all[2], all[3], all[4], all[7], all[11], all[12], all[14], all[15], all[16]);
    let said = run_net(read, 0u);
    let share = limited_exp2(run_net(read, SHARE_NET)[0].x);
    let squared_inverse = inverse * inverse;
    let noise = noise_of(p, 1u);
    let fine = squared_inverse / (p.detail.y + LEAST_DEVIATION);
    let wide = squared_inverse / (noise + LEAST_DEVIATION);
    var least = settings.albedo / (noise + LEAST_NOISE_OF_ALBEDO);
    if settings.camera_motion != 0u {
        least = max(least, settings.camera_albedo);
    }
    return Bandwidths(
        vec4f(limited_exp2(said[0].x) * fine, limited_exp2(said[0].y) * wide, limited_exp2(said[0].z), limited_exp2(said[0].w)),
        vec4f(
            limited_exp2(said[1].y) * fine,
            limited_exp2(said[1].z) * wide,
            max(limited_exp2(said[1].w), least),
            limited_exp2(said[2].x),
        ),
        vec2f(limited_exp2(said[1].x), limited_exp2(said[2].y)),
        limited_exp2(said[2].z),
        share / (1.0 + share),
    );
}

// The pixel of a 3x3 neighbourhood whose surface is nearest to the eye; the centre, if the others are hardly nearer.
fn in_front(there: WindowFrame, pixel: vec2i) -> vec2i {
    var best = pixel;
    var nearest = inverse_depth_of(there, pixel);
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                let other = inverse_depth_of(there, q);
                if other > settings.nearer * nearest {
                    best = q;
                    nearest = other;
                }
            }
        }
    }
    return best;
}

// A place in a frame, and the pixel in front there.
struct Step {
    found: bool,
    at: vec2f,
    pixel: vec2i,
}

// Where motion leads from `at` in the neighbouring frame. Not found: off the picture, another depth, or the motion there does not
// lead back.
fn next_place(before: WindowFrame, there: WindowFrame, forward: bool, reflected: bool, from_at: vec2f, pixel: vec2i, may_miss: f32) -> Step {
    let lost = Step(false, from_at, pixel);
    if !has_motion(before, forward) {
        return lost;
    }
    let m = motion_at(before, forward, reflected, pixel);
    let at = from_at + m;
    let last = vec2f(f32(settings.size.x), f32(settings.picture_height)) - 1.0;
    if !(all(at >= vec2f(0.0)) && all(at <= last)) {
        return lost;
    }
    let nearest = rounded(at) - vec2i(0, settings.first_row);
    if !contains(nearest) {
        return lost;
    }
    let found = in_front(there, nearest);
    let depth = inverse_depth_of(before, pixel);
    if abs(inverse_depth_of(there, found) - depth) > settings.depth_change * depth {
        return lost;
    }
    if has_motion(there, !forward) {
        let miss = length(m + motion_at(there, !forward, reflected, found));
        if miss > may_miss + settings.round_trip_share * length(m) {
            return lost;
        }
    }
    return Step(true, at, found);
}

// Pixels between the motion of what is seen at a pixel and that of its surface.
fn departure(before: WindowFrame, forward: bool, pixel: vec2i) -> f32 {
    if !has_motion(before, forward) {
        return 0.0;
    }
    return length(motion_at(before, forward, true, pixel) - motion_at(before, forward, false, pixel));
}

// A place where the pixel is shown: place of the frame in the window, and where in it.
struct Visit {
    frame: i32,
    at: vec2f,
}

var<private> visits: array<Visit, MOST_VISITS>;
var<private> visit_count: u32;

// `noise`: squared, relative to the brightness, summed over the channels.
fn find_visits(pixel: vec2i, noise: f32) {
    let noisy = noise * settings.round_trip_noise;
    let may_miss = settings.round_trip + noisy * noisy;
    let here = frame_at(settings.centre);
    let mirror = is_mirror(here, pixel);
    let origin = vec2f(f32(pixel.x), f32(settings.first_row + pixel.y));
    let first = in_front(here, pixel);
    visit_count = 0u;
    for (var direction = 0u; direction <= settings.future; direction++) {
        let forward = direction == 1u;
        var at = origin;
        var front = first;
        var frame = settings.centre;
        for (var step = 0; step < settings.steps; step++) {
            let next = frame + select(-1, 1, forward);
            if next < 0 || next >= settings.count {
                break;
            }
            let before = frame_at(frame);
            let there = frame_at(next);
            var found = next_place(before, there, forward, mirror, at, front, may_miss);
            found.found = found.found && abs(found.at.y - origin.y) <= settings.farthest;
            if !found.found && mirror && departure(before, forward, front) <= settings.departure {
                found = next_place(before, there, forward, false, at, front, may_miss);
                found.found = found.found && abs(found.at.y - origin.y) <= settings.farthest;
            }
            if !found.found {
                break;
            }
            at = found.at;
            front = found.pixel;
            frame = next;
            visits[visit_count] = Visit(frame, at);
            visit_count += 1u;
        }
    }
}

// Range of brightness that a pixel showed.
struct Shown {
    low: f32,
    second: f32,
    high: f32,
}

fn add_shown(before: Shown, input: vec3f) -> Shown {
    let shown = log2_of(max(sum_of(input), DARK));
    let next = min(shown, before.high);
    return Shown(min(before.low, shown), max(before.second, next), max(before.high, shown));
}

// Sum of squared differences times the bandwidth of their part.
fn distance_of(a: Signature, b: Signature, parts: vec4f) -> f32 {
    return dot(parts, vec4f(squared(a.near - b.near), squared(a.wide - b.wide), squared(a.albedo - b.albedo), squared(a.normal - b.normal)));
}

// The averaged colour, and coverage.
fn stabilised(pixel: vec2i, p: Pooled, inverse: f32) -> vec4f {
    let here = frame_at(settings.centre);
    var b = bandwidths(p, inverse);
    // How far the pixel's own light is believed.
    let noise = noise_of(p, 1u);
    let share = select(0.0, noise / (noise + settings.outlier_noise), noise > 0.0);
    let outlier = share * known_at(pixel).yz;
    let believed = min(1.0 - outlier.x, 1.0 - b.raw * outlier.y);
    b.own_parts *= vec4f(believed, believed, 1.0, 1.0);
    b.other_parts *= vec4f(believed, believed, 1.0, 1.0);
    var own = signature_of(signature_at(here, pixel));
    var judge = vec3f(0.0);
    var pixels = 0.0;
    for (var dy = -SIGNATURE_WIDE; dy <= SIGNATURE_WIDE; dy++) {
        for (var dx = -SIGNATURE_WIDE; dx <= SIGNATURE_WIDE; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                judge += input_of(here, q);
                pixels += 1.0;
            }
        }
    }
    own.wide = judge / pixels;
    find_visits(pixel, noise);
    var shown = add_shown(Shown(own.brightness, own.brightness, own.brightness), input_of(here, pixel));
    for (var k = 0u; k < visit_count; k++) {
        let q = rounded(visits[k].at) - vec2i(0, settings.first_row);
        if contains(q) {
            shown = add_shown(shown, input_of(frame_at(visits[k].frame), q));
        }
    }
    var high = shown.high;
    var fall = 1.0;
    if settings.camera_motion != 0u {
        high = shown.second;
        fall = settings.camera_fall;
    }
    high += settings.contrast;
    let low = shown.low - settings.contrast;
    var total = 0.0;
    var sum = vec4f(0.0);
    for (var dy = -TAP_RADIUS; dy <= TAP_RADIUS; dy++) {
        for (var dx = -TAP_RADIUS; dx <= TAP_RADIUS; dx++) {
            let q = pixel + vec2i(dx, dy);
            if !contains(q) {
                continue;
            }
            var w = max(believed, LEAST_OWN);
            if dx != 0 || dy != 0 {
                let there = signature_of(signature_at(here, q));
                w = exp2_of(-(distance_of(own, there, b.own_parts) + b.offset.x * f32(dx * dx + dy * dy)));
            }
            let colour = picture_of(here, q);
            total += w;
            sum += w * vec4f(colour.xyz + b.raw * (input_of(here, q) - colour.xyz), colour.w);
        }
    }
    for (var k = 0u; k < visit_count; k++) {
        let visit = visits[k];
        let there = frame_at(visit.frame);
        let away = b.away * f32(abs(visit.frame - settings.centre) - 1);
        let middle = rounded(visit.at);
        for (var dy = -TAP_RADIUS; dy <= TAP_RADIUS; dy++) {
            for (var dx = -TAP_RADIUS; dx <= TAP_RADIUS; dx++) {
                let place = middle + vec2i(dx, dy);
                let q = place - vec2i(0, settings.first_row);
                if !contains(q) {
                    continue;
                }
                let other = signature_of(signature_at(there, q));
                let offset = vec2f(place) - visit.at;
                let beyond = max(max((other.brightness - high) * fall, low - other.brightness), 0.0);
                let w = exp2_of(-(distance_of(own, other, b.other_parts) + b.offset.y * dot(offset, offset) + away + beyond));
                let colour = picture_of(there, q);
                total += w;
                sum += w * vec4f(colour.xyz + b.raw * (input_of(there, q) - colour.xyz), colour.w);
            }
        }
    }
    let mean = sum / total;
    return vec4f(mean.xyz, select(picture_of(here, pixel).w, mean.w, settings.every_alpha != 0u));
}
