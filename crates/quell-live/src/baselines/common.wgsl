// What both baselines share: the frame, the pattern of taps, and the surface of each pixel.

struct Frame {
    size: vec2u,
    // Pixels between taps.
    step: i32,
    // 1: the frame before is history.
    follows: u32,
    // World position at view depth 0, relative to this frame's eye, affine in the pixel coordinate; and the change of it for one
    // unit of view depth.
    origin: array<vec4f, 3>,
    direction: array<vec4f, 3>,
    // Of the camera before: its viewing direction, and this frame's eye relative to its own.
    forward_before: vec4f,
    eye_moved: vec4f,
    // Sigmas of a-trous: of colour in mean luminances, of normals, of positions as a part of the view depth.
    atrous: vec4f,
    // Of SVGF: alpha of colour and of moments, sigma_z, sigma_l.
    svgf: vec4f,
}

@group(0) @binding(0) var<uniform> frame: Frame;

const CENTRE: f32 = 9.0 / 64.0;

// The kernel of the a-trous wavelet: the B3 spline along both axes, by the distance from its centre in steps.
fn kernel(x: i32, y: i32) -> f32 {
    let at = abs(vec2i(x, y));
    let weights = select(select(vec2f(1.0 / 16.0), vec2f(1.0 / 4.0), at == vec2i(1)), vec2f(3.0 / 8.0), at == vec2i());
    return weights.x * weights.y;
}

fn is_inside(at: vec2i) -> bool {
    return all(at >= vec2i()) && all(at < vec2i(frame.size));
}

fn affine(base: array<vec4f, 3>, at: vec2f) -> vec3f {
    return base[0].xyz + base[1].xyz * at.x + base[2].xyz * at.y;
}

// Relative to this frame's eye.
fn world(at: vec2i, depth: f32) -> vec3f {
    let pixel = vec2f(at) + 0.5;
    return affine(frame.origin, pixel) + affine(frame.direction, pixel) * depth;
}
