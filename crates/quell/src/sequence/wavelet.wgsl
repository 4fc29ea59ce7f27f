// Stage 3, one level for one light: twin of wavelet.rs. Every image holds a light's colour and, as the fourth number, the
// variance of its luminance.

struct Level {
    size: vec2u,
    // Pixels between taps.
    step: i32,
    // Guides stop the light.
    guided: u32,
    depth: f32,
    guide_noise: f32,
    normal: f32,
    // What multiplies squared differences of colours; 0: they do not count. Likewise normals that are seen.
    colour: f32,
    seen_normal: f32,
    // Squared, of the luminance stop.
    tolerance: f32,
    mirror_tolerance: f32,
}

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> geometry: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> guide_colours: array<vec4f>;
@group(0) @binding(4) var<storage, read> seen_normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> light: array<vec4f>;
// Mean luminance over 3x3 of the same surface, and its variance.
@group(0) @binding(6) var<storage, read_write> compared: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> filtered: array<vec4f>;

// Half of the B3 spline's kernel, from the centre outwards.
const SPLINE = vec3f(0.375, 0.25, 0.0625);
// Luminances of one pixel that differ by less than this share do not differ.
const LEAST_CONTRAST = 1e-3;

fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(level.size));
}

fn index_of(pixel: vec2i) -> u32 {
    return u32(pixel.y) * level.size.x + u32(pixel.x);
}

fn guides_at(i: u32) -> Guides {
    var guides: Guides;
    guides.geometry = geometry[i];
    guides.normal = normals[i];
    if level.colour > 0.0 || level.mirror_tolerance != level.tolerance {
        guides.colour = guide_colours[i];
    }
    if level.seen_normal > 0.0 {
        guides.seen_normal = seen_normals[i];
    }
    return guides;
}

fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = guides_at(p);
    var total = 0.0;
    var mean = 0.0;
    var spread = 0.0;
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let offset = vec2i(dx, dy);
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var e = 0.0;
            if q != p {
                e = energy(here, guides_at(q), vec2f(offset), level);
            }
            let share = f32((2 - abs(dx)) * (2 - abs(dy)));
            let g = share * weight(e);
            let colour = light[q];
            total += g;
            mean += g * luminance(colour.xyz);
            spread += g * g * colour.w;
        }
    }
    compared[p] = vec2f(mean / total, spread / (total * total));
}

@compute @workgroup_size(8, 8)
fn filter_level(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = index_of(pixel);
    let here = guides_at(p);
    let mean = compared[p];
    let squared = select(level.tolerance, level.mirror_tolerance, here.colour.w > 0.0);
    let contrast = LEAST_CONTRAST * mean.x;
    var total = 0.0;
    var sum = vec4f(0.0);
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let offset = vec2i(dx, dy) * level.step;
            if !contains(pixel + offset) {
                continue;
            }
            let q = index_of(pixel + offset);
            var w = SPLINE[abs(dx)] * SPLINE[abs(dy)];
            if q != p {
                let there = compared[q];
                let d = mean.x - there.x;
                let v = mean.y + there.y;
                // As energies go, 1e24 over 1e-12 is far enough and finite.
                let beyond = clamp(d * d - v, 0.0, 1e24);
                let stop = beyond / (squared * v + contrast * contrast + 1e-12);
                w *= weight(energy(here, guides_at(q), vec2f(offset), level) + stop);
            }
            let colour = light[q];
            total += w;
            sum += vec4f(w * colour.xyz, w * w * colour.w);
        }
    }
    let scale = 1.0 / total;
    filtered[p] = vec4f(scale * sum.xyz, scale * scale * sum.w);
}
