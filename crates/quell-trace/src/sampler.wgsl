// Twin of sampler.rs: Owen-scrambled Sobol' points. Its hashes have 64 bits, which WGSL has not: a number of 64 bits is a
// vec2u, low half first.

struct Sampler {
    key: vec2u,
    index: u32,
    dimension: u32,
}

fn add64(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// The upper half of a product of two numbers of 32 bits, from those of their halves.
fn upper_product(a: u32, b: u32) -> u32 {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let first = a1 * b0 + ((a0 * b0) >> 16u);
    let second = a0 * b1 + (first & 0xffffu);
    return a1 * b1 + (first >> 16u) + (second >> 16u);
}

fn multiply64(a: vec2u, b: vec2u) -> vec2u {
    return vec2u(a.x * b.x, upper_product(a.x, b.x) + a.x * b.y + a.y * b.x);
}

// By 1 to 31 bits.
fn shift_right64(a: vec2u, bits: u32) -> vec2u {
    return vec2u((a.x >> bits) | (a.y << (32u - bits)), a.y >> bits);
}

const GOLDEN = vec2u(0x7f4a7c15u, 0x9e3779b9u);

fn mix64(x: vec2u) -> vec2u {
    var z = add64(x, GOLDEN);
    z = multiply64(z ^ shift_right64(z, 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    z = multiply64(z ^ shift_right64(z, 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return z ^ shift_right64(z, 31u);
}

fn sampler_new(pixel: vec2u, index: u32, seed: vec2u) -> Sampler {
    let position = vec2u(pixel.y, pixel.x);
    return Sampler(mix64(add64(mix64(add64(mix64(seed), position)), frame.number)), index, 0u);
}

fn sampler_fork(s: Sampler, domain: u32) -> Sampler {
    return Sampler(mix64(s.key ^ mix64(vec2u(domain ^ 0x4c957f2du, 0x5851f42du))), s.index, 0u);
}

fn sampler_with_index(s: Sampler, index: u32) -> Sampler {
    return Sampler(s.key, index, s.dimension);
}

fn ray_seed(s: Sampler, direction: vec3f) -> vec2u {
    let bits = bitcast<vec3u>(direction);
    let state = s.key ^ mix64(vec2u(s.dimension, s.index));
    return mix64(add64(mix64(state), bits.xy) ^ multiply64(vec2u(bits.z, 0u), GOLDEN));
}

fn sobol_1(index: u32) -> u32 {
    var x = reverseBits(index);
    x ^= x << 16u;
    x ^= (x & 0x00ff00ffu) << 8u;
    x ^= (x & 0x0f0f0f0fu) << 4u;
    x ^= (x & 0x33333333u) << 2u;
    x ^= (x & 0x55555555u) << 1u;
    return x;
}

fn laine_karras(value: u32, seed: u32) -> u32 {
    var x = value;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

fn owen_scramble(x: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(reverseBits(x), seed));
}

fn unit_float(x: u32) -> f32 {
    return f32(x >> 8u) * (1.0 / 16777216.0);
}

// Two numbers of one draw; a draw of one number takes the first.
fn next_2d(s: ptr<function, Sampler>) -> vec2f {
    let h = mix64(add64((*s).key, multiply64(vec2u((*s).dimension, 0u), GOLDEN)));
    (*s).dimension += 1u;
    let scramble = mix64(h);
    let index = owen_scramble((*s).index, h.x);
    return vec2f(
        unit_float(owen_scramble(reverseBits(index), scramble.x)),
        unit_float(owen_scramble(sobol_1(index), scramble.y)),
    );
}

fn next_1d(s: ptr<function, Sampler>) -> f32 {
    return next_2d(s).x;
}

fn next_3d(s: ptr<function, Sampler>) -> vec3f {
    let choice = next_1d(s);
    return vec3f(choice, next_2d(s));
}
