// Twin of `signature` of reference.rs and of `kept` of mod.rs: what pixels are compared by, in half precision; of light the square
// root. Rounding is done here, to nearest: what a device does when it stores is its own choice.

const HALF_NORMAL: f32 = 6.103515625e-5;
const HALF_STEP: f32 = 5.9604645e-8;

// The nearest half of each value, ties to even, held to the finite ones.
fn to_half(v: vec4f) -> vec4f {
    let held = clamp(v, vec4f(-HALF_MAX), vec4f(HALF_MAX));
    let bits = bitcast<vec4u>(held);
    let nearest = bitcast<vec4f>((bits + 0xfffu + ((bits >> vec4u(13u)) & vec4u(1u))) & vec4u(0xffffe000u));
    return select(nearest, round(held / HALF_STEP) * HALF_STEP, abs(held) < vec4f(HALF_NORMAL));
}

fn root(v: vec3f) -> vec3f {
    return sign(v) * sqrt(abs(v));
}

// The median of nine.
fn median_of(given: array<f32, 9>) -> f32 {
    var v = given;
    for (var i = 0; i <= 4; i++) {
        for (var j = i + 1; j < 9; j++) {
            let low = min(v[i], v[j]);
            v[j] = max(v[i], v[j]);
            v[i] = low;
        }
    }
    return v[4];
}

// Four times four numbers: the picture smoothed, its mean over 5x5, means over 3x3 of albedo and normal, and the brightness.
fn signature(here: WindowFrame, pixel: vec2i) -> array<vec4f, 4> {
    var near = vec3f(0.0);
    var albedo = vec3f(0.0);
    var normal = vec3f(0.0);
    var inside = 0.0;
    var sums: array<f32, 9>;
    for (var dy = -1; dy <= 1; dy++) {
        for (var dx = -1; dx <= 1; dx++) {
            let q = pixel + vec2i(dx, dy);
            let colour = picture_of(here, clamped(q)).xyz;
            near += 0.0625 * f32((2 - abs(dx)) * (2 - abs(dy))) * colour;
            sums[3 * dy + dx + 4] = sum_of(colour);
            if contains(q) {
                albedo += guide_albedo(here, q);
                normal += guide_normal(here, q);
                inside += 1.0;
            }
        }
    }
    var wide = vec3f(0.0);
    var pixels = 0.0;
    for (var dy = -SIGNATURE_WIDE; dy <= SIGNATURE_WIDE; dy++) {
        for (var dx = -SIGNATURE_WIDE; dx <= SIGNATURE_WIDE; dx++) {
            let q = pixel + vec2i(dx, dy);
            if contains(q) {
                wide += picture_of(here, q).xyz;
                pixels += 1.0;
            }
        }
    }
    let a = root(near);
    let b = root(wide / pixels);
    let c = albedo / inside;
    let d = normal / inside;
    let bright = log2_of(max(median_of(sums), DARK));
    return array<vec4f, 4>(
        to_half(vec4f(a, b.x)),
        to_half(vec4f(b.yz, c.xy)),
        to_half(vec4f(c.z, d)),
        to_half(vec4f(bright, 0.0, 0.0, 0.0)),
    );
}
