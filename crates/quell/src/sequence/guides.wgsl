// A frame's guides made ready for the filters within it: twin of guides.rs (`Local`).

struct Local {
    size: vec2u,
    // Of the frame in the textures.
    layer: i32,
    // Bit 0: there are the colours that mirrors and glass show; bit 1: the normals.
    seen: u32,
}

@group(0) @binding(0) var<uniform> local: Local;
// 1/depth (0: background) and the position.
@group(0) @binding(1) var surfaces: texture_2d_array<f32>;
// Unit normal, or zeros; the fourth is 1 in a mirror or glass.
@group(0) @binding(2) var surface_normals: texture_2d_array<f32>;
// What mirrors and glass show: colours, tone-mapped, and unit normals.
@group(0) @binding(3) var seen_colours: texture_2d_array<f32>;
@group(0) @binding(4) var seen_normals: texture_2d_array<f32>;
@group(0) @binding(5) var<storage, read_write> local_geometry: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> local_normals: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> local_colours: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> local_seen_normals: array<vec4f>;

// Added to the colour seen in mirrors and glass: a difference that no tolerance bridges. Light that was divided by what
// it shows never mixes with light that was not.
const DIVIDED = 8.0;
// More than any roughness.
const LARGE = 1e30;

fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(local.size));
}

fn inverse_depth(pixel: vec2i) -> f32 {
    return textureLoad(surfaces, pixel, local.layer, 0).x;
}

fn normal(pixel: vec2i) -> vec4f {
    return textureLoad(surface_normals, pixel, local.layer, 0);
}

// Of the two one-sided differences the smaller: the other may cross an edge.
fn slope(pixel: vec2i, along: vec2i, here: f32) -> f32 {
    if here <= 0.0 {
        return 0.0;
    }
    var back = 0.0;
    if contains(pixel - along) {
        back = inverse_depth(pixel - along);
    }
    var forward = 0.0;
    if contains(pixel + along) {
        forward = inverse_depth(pixel + along);
    }
    let a = here - back;
    let b = forward - here;
    if back > 0.0 && forward > 0.0 {
        return select(b, a, abs(a) < abs(b));
    }
    if back > 0.0 {
        return a;
    }
    return select(0.0, b, forward > 0.0);
}

// Along an edge a clean guide is smooth; where it is smooth in no direction the guide is noisy. Of the depth, and of
// the normal.
fn calmest(pixel: vec2i, here: f32, facing: vec3f) -> vec2f {
    if !contains(pixel - vec2i(1)) || !contains(pixel + vec2i(1)) {
        return vec2f(0.0);
    }
    var least = vec2f(LARGE);
    for (var k = 0; k < 4; k++) {
        var way = vec2i(1, 0);
        switch k {
            case 1: { way = vec2i(0, 1); }
            case 2: { way = vec2i(1, 1); }
            case 3: { way = vec2i(1, -1); }
            default: {}
        }
        var rough = 0.0;
        if here > 0.0 {
            rough = abs(inverse_depth(pixel - way) + inverse_depth(pixel + way) - 2.0 * here) / (2.0 * here);
        }
        let d = 0.5 * (normal(pixel - way).xyz + normal(pixel + way).xyz) - facing;
        least = min(least, vec2f(rough, 0.5 * dot(d, d)));
    }
    return least;
}

@compute @workgroup_size(8, 8)
fn make_local(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let p = id.y * local.size.x + id.x;
    let here = inverse_depth(pixel);
    let facing = normal(pixel);
    let noise = calmest(pixel, here, facing.xyz);
    let slopes = vec2f(slope(pixel, vec2i(1, 0), here), slope(pixel, vec2i(0, 1), here));
    local_geometry[p] = vec4f(slopes, here, noise.x);
    local_normals[p] = vec4f(facing.xyz, noise.y);
    var colour = vec3f(0.0);
    if (local.seen & 1u) != 0u {
        colour = textureLoad(seen_colours, pixel, local.layer, 0).xyz;
    }
    local_colours[p] = vec4f(colour + vec3f(DIVIDED * facing.w, 0.0, 0.0), facing.w);
    var seen = vec3f(0.0);
    if (local.seen & 2u) != 0u {
        seen = textureLoad(seen_normals, pixel, local.layer, 0).xyz;
    }
    local_seen_normals[p] = vec4f(seen, 0.0);
}
