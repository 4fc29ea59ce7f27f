// Twin of warp.rs: maps from the unit square to directions; and vector functions as glam has them.

const PI = 3.14159265358979;
const TAU = 6.28318530717959;
// 1 - f32::EPSILON / 2.
const ONE_MINUS_EPSILON = 0.99999994;
const MIN_POSITIVE = 1.17549435e-38;
const NONE = 0xffffffffu;

fn max_element(v: vec3f) -> f32 {
    return max(max(v.x, v.y), v.z);
}

fn channel_mean(c: vec3f) -> f32 {
    return (c.x + c.y + c.z) * (1.0 / 3.0);
}

fn luminance(c: vec3f) -> f32 {
    return dot(c, LUMINANCE);
}

fn length_squared(v: vec3f) -> f32 {
    return dot(v, v);
}

// The unit vector, or `otherwise` where there is none.
fn normalize_or(v: vec3f, otherwise: vec3f) -> vec3f {
    let l = length(v);
    return select(otherwise, v / l, l > 0.0 && l < INFINITE);
}

// -1 for negative numbers and negative zero.
fn signum(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) >> 31u) == 1u);
}

// Two unit vectors orthogonal to the unit vector `n` and to each other, as columns (Duff et al. 2017).
fn orthonormal_pair(n: vec3f) -> mat2x3f {
    let s = signum(n.z);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat2x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y));
}

// A local direction turned so that its pole is `axis`.
fn about(axis: vec3f, local: vec3f) -> vec3f {
    let pair = orthonormal_pair(axis);
    return normalize(local.x * pair[0] + local.y * pair[1] + local.z * axis);
}

// Devices may be off by 4096 units in the last place in `atan2`: densities would be, too. This one is good to 2e-7
// (the coefficients are those of Cephes).
fn atan2_precise(y: f32, x: f32) -> f32 {
    let a = abs(y);
    let b = abs(x);
    if max(a, b) == 0.0 {
        return 0.0;
    }
    var t = min(a, b) / max(a, b);
    var base = 0.0;
    if t > 0.41421356 {
        t = (t - 1.0) / (t + 1.0);
        base = 0.78539816;
    }
    let z = t * t;
    let p = ((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1;
    var angle = base + (p * z * t + t);
    angle = select(angle, 1.57079633 - angle, a > b);
    angle = select(angle, PI - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}

fn acos_precise(x: f32) -> f32 {
    return atan2_precise(sqrt(max((1.0 - x) * (1.0 + x), 0.0)), x);
}

fn concentric_disc(u: vec2f) -> vec2f {
    let p = 2.0 * u - 1.0;
    if p.x == 0.0 && p.y == 0.0 {
        return vec2f();
    }
    var radius = p.y;
    var angle = PI / 2.0 - PI / 4.0 * (p.x / p.y);
    if abs(p.x) > abs(p.y) {
        radius = p.x;
        angle = PI / 4.0 * (p.y / p.x);
    }
    return radius * vec2f(cos(angle), sin(angle));
}

fn cosine_hemisphere(u: vec2f) -> vec3f {
    let d = concentric_disc(u);
    return vec3f(d, sqrt(max(1.0 - dot(d, d), 0.0)));
}

fn cosine_hemisphere_pdf(cosine: f32) -> f32 {
    return max(cosine, 0.0) * (1.0 / PI);
}

// Uniform in the cone of cosines from 1 - `one_minus_cos` to 1.
fn uniform_cone(u: vec2f, one_minus_cos: f32) -> vec3f {
    let drawn = u.x * one_minus_cos;
    let sine = sqrt(max(drawn * (2.0 - drawn), 0.0));
    let phi = TAU * u.y;
    return vec3f(sine * cos(phi), sine * sin(phi), 1.0 - drawn);
}

fn uniform_triangle(u: vec2f) -> vec3f {
    var b0 = u.x - u.y / 2.0;
    var b1 = u.y / 2.0;
    if u.x < u.y {
        b0 = u.x / 2.0;
        b1 = u.y - b0;
    }
    return vec3f(b0, b1, max(1.0 - b0 - b1, 0.0));
}
