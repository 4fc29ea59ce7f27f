// `Storage::Half`: colours in half precision, guides in 8, 4 and 8 bytes. storage.rs says what each holds.
//
// Rounding is done here, to nearest: what a device does when it stores is its own choice, and cutting off would darken
// the history a little at every frame.

// Under it halves are multiples of 2^-24.
const HALF_NORMAL: f32 = 6.103515625e-5;
const HALF_STEP: f32 = 5.9604645e-8;

// The nearest half of each value, ties to even, held to the finite ones.
fn to_half(c: vec3f) -> vec3f {
    let held = clamp(c, vec3f(-HALF_MAX), vec3f(HALF_MAX));
    let bits = bitcast<vec3u>(held);
    let rounded = bitcast<vec3f>((bits + 0xfffu + ((bits >> vec3u(13u)) & vec3u(1u))) & vec3u(0xffffe000u));
    return select(rounded, round(held / HALF_STEP) * HALF_STEP, abs(held) < vec3f(HALF_NORMAL));
}

// A colour as its plane will hold it.
fn stored_colour(c: vec3f) -> vec3f {
    return to_half(c);
}

// Normals that differ by less (length of the difference) are the same up to rounding.
const SAME_NORMAL: f32 = 1.5e-5;

fn fold(v: vec2f) -> vec2f {
    return (1.0 - abs(v.yx)) * select(vec2f(-1.0), vec2f(1.0), v >= vec2f(0.0));
}

// A unit vector on the octahedron that is unfolded to a square, -1..1.
fn octahedral(n: vec3f) -> vec2f {
    let size = abs(n.x) + abs(n.y) + abs(n.z);
    if !(size > 0.0) {
        return vec2f(0.0);
    }
    let flat = n.xy / size;
    return select(flat, fold(flat), n.z < 0.0);
}

fn normal_code(n: vec3f) -> vec2u {
    return vec2u(vec2i(round(octahedral(n) * NORMAL_STEPS)) + NORMAL_CENTRE);
}

fn normal_of_code(code: vec2u) -> vec3f {
    let flat = vec2f(vec2i(code) - NORMAL_CENTRE) / NORMAL_STEPS;
    let up = 1.0 - abs(flat.x) - abs(flat.y);
    return normalize(vec3f(select(flat, fold(flat), up < 0.0), up));
}

fn pack_geometry(normal: vec3f, depth: f32) -> vec4u {
    let high = normal_code(normal) >> vec2u(NORMAL_LOW_BITS);
    return vec4u(bitcast<u32>(depth), high.x | (high.y << 16u), 0u, 0u);
}

fn geometry_depth(shape: vec4u) -> f32 {
    return bitcast<f32>(shape.x);
}

fn geometry_normal(shape: vec4u, skin: vec4u) -> vec3f {
    let high = vec2u(shape.y & 0xffffu, shape.y >> 16u);
    let low = vec2u(skin.x >> 26u, skin.x >> 29u) & vec2u(7u);
    return normal_of_code((high << vec2u(NORMAL_LOW_BITS)) | low);
}

// Ids up to 65535 as they are, larger ones mixed to 16 bits: two that meet share a value once in 65536.
fn short_id(id: u32) -> u32 {
    if id < 65536u {
        return id;
    }
    let mixed = (id ^ (id >> 16u)) * 0x9e3779b1u;
    return mixed >> 16u;
}

fn pack_surface(id: u32, roughness: f32, normal: vec3f) -> vec4u {
    let low = normal_code(normal) & vec2u(7u);
    let step = u32(round(clamp(roughness, 0.0, 1.0) * ROUGHNESS_STEPS));
    return vec4u(short_id(id) | (step << 16u) | (low.x << 26u) | (low.y << 29u), 0u, 0u, 0u);
}

fn surface_id(skin: vec4u) -> u32 {
    return skin.x & 0xffffu;
}

fn surface_roughness(skin: vec4u) -> f32 {
    return f32((skin.x >> 16u) & 1023u) / ROUGHNESS_STEPS;
}

fn motion_code(v: f32) -> u32 {
    let size = min(abs(v), MOTION_MOST);
    if size < MOTION_LEAST {
        return 0u;
    }
    let bits = bitcast<u32>(size);
    let rounded = (bits + 0xffu + ((bits >> 9u) & 1u)) >> 9u;
    return (rounded - (113u << 14u)) | select(0u, 1u << 19u, v < 0.0);
}

fn motion_of_code(code: u32) -> f32 {
    let size = code & 0x7ffffu;
    if size == 0u {
        return 0.0;
    }
    let value = bitcast<f32>((size + (113u << 14u)) << 9u);
    return select(value, -value, (code >> 19u) != 0u);
}

// The hit distance as a half, relative to the depth; `HALF_MAX`: infinite.
fn pack_moving(moves: Moving, depth: f32) -> vec4u {
    let x = motion_code(moves.motion.x);
    let y = motion_code(moves.motion.y);
    var ratio = 0.0;
    if depth > 0.0 {
        ratio = select(min(moves.glossy_hit / depth, HALF_MAX), HALF_MAX, moves.glossy_hit >= FAR);
    }
    let hit = pack2x16float(vec2f(to_half(vec3f(ratio)).x, 0.0));
    let confidence = u32(round(clamp(moves.confidence_in, 0.0, 1.0) * CONFIDENCE_STEPS));
    return vec4u(x | (y << 20u), (y >> 12u) | (hit << 8u) | (confidence << 24u), 0u, 0u);
}

fn moving_of(bits: vec4u, depth: f32) -> Moving {
    let x = bits.x & 0xfffffu;
    let y = (bits.x >> 20u) | ((bits.y & 0xffu) << 12u);
    let ratio = unpack2x16float((bits.y >> 8u) & 0xffffu).x;
    return Moving(
        vec2f(motion_of_code(x), motion_of_code(y)),
        select(ratio * depth, FAR, ratio >= HALF_MAX),
        f32(bits.y >> 24u) / CONFIDENCE_STEPS,
    );
}
