// What is shown: the noisy sum, the mean of such sums, and the panes beside each other.

struct Display {
    size: vec2u,
    // Frames in the mean, this one included.
    frames: u32,
    panes: u32,
    // Of up to 8 panes, four a vector.
    kinds: array<vec4u, 2>,
    // Columns where a pane ends.
    edges: array<vec4f, 2>,
    exposure: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

const NOISY: u32 = 0u;
const QUELL: u32 = 1u;
const CONVERGED: u32 = 2u;
const ATROUS: u32 = 4u;
const SVGF: u32 = 5u;

// Twins of quell_lab::tone.
const SHOULDER_START: f32 = 0.3;
const DESATURATION: f32 = 0.4;

@group(0) @binding(0) var<uniform> display: Display;
@group(0) @binding(1) var direct: texture_2d<f32>;
@group(0) @binding(2) var matte: texture_2d<f32>;
@group(0) @binding(3) var glossy: texture_2d<f32>;
@group(0) @binding(4) var matte_weight: texture_2d<f32>;
@group(0) @binding(5) var glossy_weight: texture_2d<f32>;
@group(0) @binding(6) var mean_before: texture_2d<f32>;
@group(0) @binding(7) var mean_after: texture_storage_2d<rgba32float, write>;
@group(0) @binding(8) var mean: texture_2d<f32>;
@group(0) @binding(9) var denoised: texture_2d<f32>;
@group(0) @binding(10) var debug: texture_2d<f32>;
@group(0) @binding(11) var picture: texture_storage_2d<rgba8unorm, write>;
// Direct light as the denoiser's last stage leaves it: of all that is denoised.
@group(0) @binding(12) var smooth_direct: texture_2d<f32>;
@group(0) @binding(13) var atrous_matte: texture_2d<f32>;
@group(0) @binding(14) var atrous_glossy: texture_2d<f32>;
@group(0) @binding(15) var svgf_matte: texture_2d<f32>;
@group(0) @binding(16) var svgf_glossy: texture_2d<f32>;

// WGSL promises nothing of infinities and NaN: what is not held by the bounds counts as 0.
fn held(c: vec3f) -> vec3f {
    return select(vec3f(), c, abs(c) <= vec3f(1e30));
}

fn sum_at(at: vec2u, direct_light: vec3f, matte_light: vec3f, glossy_light: vec3f) -> vec3f {
    let m = matte_light * textureLoad(matte_weight, at, 0).xyz;
    let g = glossy_light * textureLoad(glossy_weight, at, 0).xyz;
    return held(direct_light + m + g);
}

fn noisy_at(at: vec2u) -> vec3f {
    return sum_at(at, textureLoad(direct, at, 0).xyz, textureLoad(matte, at, 0).xyz, textureLoad(glossy, at, 0).xyz);
}

@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= display.size) {
        return;
    }
    let before = textureLoad(mean_before, id.xy, 0).xyz;
    let first = display.frames <= 1u;
    let share = 1.0 / f32(max(display.frames, 1u));
    let now = noisy_at(id.xy);
    let after = select(before + (now - before) * share, now, first);
    textureStore(mean_after, id.xy, vec4f(after, 1.0));
}

fn display_linear(light: vec3f) -> vec3f {
    let c = max(light * display.exposure, vec3f());
    let peak = max(c.x, max(c.y, c.z));
    if peak < SHOULDER_START {
        return c;
    }
    let room = 1.0 - SHOULDER_START;
    let new_peak = 1.0 - room * room / (peak + room - SHOULDER_START);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    let scaled = c * (new_peak / peak);
    return min(scaled + (vec3f(new_peak) - scaled) * white, vec3f(1.0));
}

fn srgb(v: vec3f) -> vec3f {
    let curve = 1.055 * pow(max(v, vec3f(0.0031308)), vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * v, v <= vec3f(0.0031308));
}

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= display.size) {
        return;
    }
    var pane = 0u;
    for (var i = 0u; i + 1u < display.panes; i++) {
        pane += select(0u, 1u, f32(id.x) + 0.5 >= display.edges[i / 4u][i % 4u]);
    }
    var shown: vec3f;
    let smooth_light = textureLoad(smooth_direct, id.xy, 0).xyz;
    switch display.kinds[pane / 4u][pane % 4u] {
        case NOISY: {
            shown = srgb(display_linear(noisy_at(id.xy)));
        }
        case QUELL: {
            shown = srgb(display_linear(held(textureLoad(denoised, id.xy, 0).xyz)));
        }
        case CONVERGED: {
            shown = srgb(display_linear(textureLoad(mean, id.xy, 0).xyz));
        }
        case ATROUS: {
            let matte_light = textureLoad(atrous_matte, id.xy, 0).xyz;
            let light = sum_at(id.xy, smooth_light, matte_light, textureLoad(atrous_glossy, id.xy, 0).xyz);
            shown = srgb(display_linear(light));
        }
        case SVGF: {
            let matte_light = textureLoad(svgf_matte, id.xy, 0).xyz;
            let light = sum_at(id.xy, smooth_light, matte_light, textureLoad(svgf_glossy, id.xy, 0).xyz);
            shown = srgb(display_linear(light));
        }
        default: {
            shown = textureLoad(debug, id.xy, 0).xyz;
        }
    }
    textureStore(picture, id.xy, vec4f(shown, 1.0));
}
