// Schied et al. 2017, twin of quell-lab's `methods/svgf` and of what that takes from `methods/surface.rs`.

@group(0) @binding(1) var surface: texture_2d<f32>;
@group(0) @binding(2) var slope: texture_2d<f32>;
// Light, and the variance of its luminance; where it comes from the tracer, light alone.
@group(0) @binding(3) var matte_in: texture_2d<f32>;
@group(0) @binding(4) var glossy_in: texture_2d<f32>;
// First and second moments of the luminance of matte, then of glossy light; the object, and the frames in the history.
@group(0) @binding(5) var moments: texture_2d<f32>;
@group(0) @binding(6) var marks: texture_2d<u32>;
// Of the frame before, and what leads there.
@group(0) @binding(7) var surface_before: texture_2d<f32>;
@group(0) @binding(8) var matte_before: texture_2d<f32>;
@group(0) @binding(9) var glossy_before: texture_2d<f32>;
@group(0) @binding(10) var motion: texture_2d<f32>;
@group(0) @binding(11) var surface_id: texture_2d<u32>;
@group(0) @binding(12) var matte_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(13) var glossy_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(14) var moments_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(15) var marks_out: texture_storage_2d<rg32uint, write>;

fn to_the_128th(cosine: f32) -> f32 {
    var power = max(cosine, 0.0);
    for (var i = 0; i < 7; i++) {
        power *= power;
    }
    return power;
}

// The weighted sum of what the frame before knows of a surface.
struct History {
    weight: f32,
    matte: vec3f,
    glossy: vec3f,
    moments: vec4f,
    length: f32,
}

// What a pixel of the frame before must show: the object, one of two depths (the surface rested, or moved with the camera),
// and a normal, each within a slack.
struct Wanted {
    id: u32,
    depths: vec2f,
    depth_slack: f32,
    normal: vec3f,
    normal_slack: f32,
}

fn take(history: ptr<function, History>, wanted: Wanted, q: vec2i, weight: f32) {
    if weight <= 0.0 || !is_inside(q) {
        return;
    }
    let other = textureLoad(surface_before, q, 0);
    let mark = textureLoad(marks, q, 0);
    if other.w >= BACKGROUND || mark.x != wanted.id {
        return;
    }
    let off = min(abs(other.w - wanted.depths.x), abs(other.w - wanted.depths.y));
    if off > wanted.depth_slack || length(other.xyz - wanted.normal) > wanted.normal_slack {
        return;
    }
    (*history).weight += weight;
    (*history).matte += weight * textureLoad(matte_before, q, 0).xyz;
    (*history).glossy += weight * textureLoad(glossy_before, q, 0).xyz;
    (*history).moments += weight * textureLoad(moments, q, 0);
    (*history).length += weight * bitcast<f32>(mark.y);
}

// Section 4.1: the 2x2 pixels about the old place, each tested for the same surface, bilinear weights; where none holds, 3x3,
// which finds thin things; else nothing.
fn history_of(at: vec2i, id: u32) -> History {
    var history: History;
    let own = textureLoad(surface, at, 0);
    if frame.follows == 0u || own.w >= BACKGROUND {
        return history;
    }
    // The index coordinate (centres at integers) where it was.
    let place = vec2f(at) + textureLoad(motion, at, 0).xy;
    if !(all(place > vec2f(-2.0)) && all(place < vec2f(frame.size) + 1.0)) {
        return history;
    }
    let change = textureLoad(slope, at, 0);
    let depths = vec2f(dot(world(at, own.w) + frame.eye_moved.xyz, frame.forward_before.xyz), own.w);
    let depth_slack = DEPTH_WIDTHS * (abs(change.x) + abs(change.y) + DEPTH_SLACK * own.w);
    let normal_slack = NORMAL_WIDTHS * (change.z + NORMAL_SLACK);
    let wanted = Wanted(id, depths, depth_slack, own.xyz, normal_slack);
    let base = floor(place);
    let t = place - base;
    for (var k = 0; k < 4; k++) {
        let corner = vec2i(k % 2, k / 2);
        let shares = select(1.0 - t, t, corner == vec2i(1));
        take(&history, wanted, vec2i(base) + corner, shares.x * shares.y);
    }
    if history.weight >= LEAST_WEIGHT {
        return history;
    }
    history = History();
    let nearest = vec2i(sign(place) * floor(abs(place) + 0.5));
    for (var k = 0; k < 9; k++) {
        take(&history, wanted, nearest + vec2i(k % 3, k / 3) - 1, 1.0);
    }
    return history;
}

fn variances(m: vec4f) -> vec2f {
    return max(m.yw - m.xz * m.xz, vec2f());
}

// Section 4.1, temporal filtering, and 4.2, the variance where history is long.
@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if !is_inside(at) {
        return;
    }
    let object = textureLoad(surface_id, at, 0).x;
    let history = history_of(at, object);
    var matte = max(textureLoad(matte_in, at, 0).xyz, vec3f());
    var glossy = max(textureLoad(glossy_in, at, 0).xyz, vec3f());
    let luminances = vec2f(dot(matte, LUMINANCE), dot(glossy, LUMINANCE));
    var mu = vec4f(luminances.x, luminances.x * luminances.x, luminances.y, luminances.y * luminances.y);
    var frames = 1.0;
    if history.weight > 0.0 {
        let share = 1.0 / history.weight;
        frames = min(history.length * share + 1.0, LONGEST);
        let alpha = max(frame.svgf.x, 1.0 / frames);
        let moments_alpha = max(frame.svgf.y, 1.0 / frames);
        matte = mix(history.matte * share, matte, alpha);
        glossy = mix(history.glossy * share, glossy, alpha);
        mu = mix(history.moments * share, mu, moments_alpha);
    }
    let variance = variances(mu);
    textureStore(matte_out, at, vec4f(matte, variance.x));
    textureStore(glossy_out, at, vec4f(glossy, variance.y));
    textureStore(moments_out, at, mu);
    textureStore(marks_out, at, vec4u(object, bitcast<u32>(frames), 0u, 0u));
}

// Section 4.2, where history is short: colour and moments by a 7x7 bilateral filter driven by depth and normal; the variance is
// raised by 4/N.
@compute @workgroup_size(8, 8)
fn estimate(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if !is_inside(at) {
        return;
    }
    var matte = textureLoad(matte_in, at, 0);
    var glossy = textureLoad(glossy_in, at, 0);
    let own = textureLoad(surface, at, 0);
    let frames = bitcast<f32>(textureLoad(marks, at, 0).y);
    if frames < SHORT && own.w < BACKGROUND {
        let gradient = textureLoad(slope, at, 0).xy;
        var weights = 0.0;
        var sums = array<vec3f, 2>();
        var mu = vec4f();
        for (var y = -SHORT_RADIUS; y <= SHORT_RADIUS; y++) {
            for (var x = -SHORT_RADIUS; x <= SHORT_RADIUS; x++) {
                let q = at + vec2i(x, y);
                if !is_inside(q) {
                    continue;
                }
                let other = textureLoad(surface, q, 0);
                let explained = abs(dot(gradient, vec2f(f32(x), f32(y))));
                let off = abs(other.w - own.w) / (frame.svgf.z * explained + DEPTH_EPSILON * own.w);
                let apart = exp(-min(off, MOST)) * to_the_128th(dot(own.xyz, other.xyz));
                let w = select(apart, 1.0, x == 0 && y == 0);
                weights += w;
                sums[0] += w * textureLoad(matte_in, q, 0).xyz;
                sums[1] += w * textureLoad(glossy_in, q, 0).xyz;
                mu += w * textureLoad(moments, q, 0);
            }
        }
        let variance = variances(mu / weights) * SHORT / max(frames, 1.0);
        matte = vec4f(sums[0] / weights, variance.x);
        glossy = vec4f(sums[1] / weights, variance.y);
    }
    textureStore(matte_out, at, matte);
    textureStore(glossy_out, at, glossy);
}

// 1 / (sigma_l sqrt(g3x3(Var)) + eps) of both signals; pixels outside the image do not count.
fn luminance_scale(at: vec2i) -> vec2f {
    var sum = vec2f();
    var weights = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let q = at + vec2i(x, y);
            if is_inside(q) {
                let w = 0.25 / f32((1 + abs(x)) * (1 + abs(y)));
                sum += w * vec2f(textureLoad(matte_in, q, 0).w, textureLoad(glossy_in, q, 0).w);
                weights += w;
            }
        }
    }
    return 1.0 / (frame.svgf.w * sqrt(sum / weights) + LUMINANCE_EPSILON);
}

// Sections 4.3 and 4.4: one level of the edge-stopping wavelet, of colour and of variance.
@compute @workgroup_size(8, 8)
fn level(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if !is_inside(at) {
        return;
    }
    let own = textureLoad(surface, at, 0);
    let gradient = textureLoad(slope, at, 0).xy;
    let matte = textureLoad(matte_in, at, 0);
    let glossy = textureLoad(glossy_in, at, 0);
    let luminances = vec2f(dot(matte.xyz, LUMINANCE), dot(glossy.xyz, LUMINANCE));
    let scale = luminance_scale(at);
    let squared = vec4f(vec3f(CENTRE), CENTRE * CENTRE);
    var matte_sum = squared * matte;
    var glossy_sum = squared * glossy;
    var weights = vec2f(CENTRE);
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let q = at + frame.step * vec2i(x, y);
            if (x == 0 && y == 0) || !is_inside(q) {
                continue;
            }
            let other = textureLoad(surface, q, 0);
            let offset = frame.svgf.z * f32(frame.step) * vec2f(f32(x), f32(y));
            let off = abs(own.w - other.w) / (abs(dot(gradient, offset)) + DEPTH_EPSILON * own.w);
            let share = kernel(x, y) * to_the_128th(dot(own.xyz, other.xyz));
            let m = textureLoad(matte_in, q, 0);
            let g = textureLoad(glossy_in, q, 0);
            let l = vec2f(dot(m.xyz, LUMINANCE), dot(g.xyz, LUMINANCE));
            let w = share * exp(-min(vec2f(off) + abs(luminances - l) * scale, vec2f(MOST)));
            weights += w;
            matte_sum += vec4f(vec3f(w.x), w.x * w.x) * m;
            glossy_sum += vec4f(vec3f(w.y), w.y * w.y) * g;
        }
    }
    let norm = 1.0 / weights;
    textureStore(matte_out, at, matte_sum * vec4f(vec3f(norm.x), norm.x * norm.x));
    textureStore(glossy_out, at, glossy_sum * vec4f(vec3f(norm.y), norm.y * norm.y));
}
