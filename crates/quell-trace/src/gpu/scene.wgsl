// The scene and the frame as the tracer's buffers hold them: written by gpu/pack.

struct Node {
    // Low and high planes of x, y and z, of eight children each.
    planes: array<vec4f, 12>,
    links: array<vec4u, 2>,
}

// Corners in the BVH's unit.
struct Triangle {
    a: vec3f,
    instance: u32,
    b: vec3f,
    // Its number in the instance's mesh.
    number: u32,
    c: vec3f,
    emitter: u32,
}

struct Instance {
    normal_matrix: mat3x3f,
    world_from_mesh: mat3x3f,
    // The whole transform of the frame before.
    previous: mat4x3f,
    surface: u32,
    flags: u32,
    emission_scale: f32,
    // Least opacity where the surface is there.
    cutoff: f32,
    // Where in `attributes` they begin; NONE: there are none.
    corners: u32,
    rest_positions: u32,
    previous_positions: u32,
    normals: u32,
    uvs: u32,
    uvs1: u32,
    colors: u32,
    tangents: u32,
}

struct TextureRef {
    // Where in `attributes` its levels are listed; NONE: there is no texture.
    levels: u32,
    level_count: u32,
    // Bits: nearest texel if magnified, if minified; two bits each for what lies beyond the edges along u and v.
    lookup: u32,
    uv_set: u32,
    // Columns of the linear part.
    matrix: vec4f,
    offset: vec2f,
    extent: vec2f,
}

struct Pattern {
    colors: array<vec4f, 3>,
    numbers: vec3f,
    kind: u32,
}

struct Surface {
    base_color: vec3f,
    metallic: f32,
    emission: vec3f,
    roughness: f32,
    attenuation_color: vec3f,
    attenuation_distance: f32,
    specular_color: vec3f,
    specular: f32,
    transmission: f32,
    ior: f32,
    alpha_factor: f32,
    flags: u32,
    normal_scale: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
    pattern: Pattern,
    textures: array<TextureRef, TEXTURES>,
}

// A homogeneous pixel coordinate of a point relative to this frame's eye: a row each for u, v and w.
struct Projection {
    u: vec4f,
    v: vec4f,
    w: vec4f,
}

struct Frame {
    eye: vec3f,
    width: u32,
    forward: vec3f,
    height: u32,
    previous_eye: vec3f,
    // Whether it is another than `eye`.
    eye_moved: u32,
    // World position of view depth 0, affine in the pixel coordinate; and world displacement of one unit of view depth.
    origin: mat3x3f,
    direction: mat3x3f,
    now: Projection,
    before: Projection,
    jitter: vec2f,
    number: vec2u,
    // First row and number of rows of the band that is traced, and its number of pixels.
    first_row: u32,
    rows: u32,
    pixels: u32,
    // How what is infinitely far away moves: by both projections, not at all, or unknown.
    far_motion: u32,
    bounces: u32,
    exact: u32,
    fresnel_rough_damping: u32,
    fresnel_strength: f32,
    indirect_clamp: f32,
    inner_from_world: f32,
    world_from_inner: f32,
    triangle_count: u32,
    // Where in `lights` its parts begin, in rows.
    emitters: u32,
    infinite: u32,
    infinite_count: u32,
    tree_nodes: u32,
    environment: u32,
    row_cdf: u32,
    column_cdf: u32,
    environment_emitter: u32,
    has_area: u32,
    map_rotation: f32,
    map_extent: vec2u,
    environment_color: vec3f,
    // 0: there is no sun.
    sun_probability: f32,
    sun_direction: vec3f,
    sun_one_minus_cos: f32,
    sun_radiance: vec3f,
    // Which of the differences that a test has planted shows.
    planted: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(3) var<storage, read> attributes: array<u32>;
@group(0) @binding(4) var<storage, read> instances: array<Instance>;
@group(0) @binding(5) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(6) var<storage, read> lights: array<vec4f>;
@group(0) @binding(7) var texels: texture_2d_array<u32>;

fn has_flag(flags: u32, flag: u32) -> bool {
    return (flags & flag) != 0u;
}

fn attribute2(first: u32, index: u32) -> vec2f {
    let at = first + 2u * index;
    return bitcast<vec2f>(vec2u(attributes[at], attributes[at + 1u]));
}

fn attribute3(first: u32, index: u32) -> vec3f {
    let at = first + 3u * index;
    return bitcast<vec3f>(vec3u(attributes[at], attributes[at + 1u], attributes[at + 2u]));
}

fn attribute4(first: u32, index: u32) -> vec4f {
    let at = first + 4u * index;
    return bitcast<vec4f>(vec4u(attributes[at], attributes[at + 1u], attributes[at + 2u], attributes[at + 3u]));
}
