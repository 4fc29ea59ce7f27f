// Planes of a band as the textures that a denoiser reads: three entry points, since WebGPU promises four storage textures a
// stage. Constants come from shader.rs.

struct Band {
    width: u32,
    rows: u32,
    first_row: u32,
    pixels: u32,
}

@group(0) @binding(0) var<uniform> band: Band;
@group(0) @binding(1) var<storage, read> planes: array<u32>;
@group(0) @binding(2) var direct_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(3) var matte_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(4) var glossy_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(5) var normal_roughness_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(6) var matte_weight_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(7) var glossy_weight_out: texture_storage_2d<rgba16float, write>;
@group(0) @binding(8) var depth_hit_out: texture_storage_2d<rg32float, write>;
@group(0) @binding(9) var motion_out: texture_storage_2d<rg32float, write>;
@group(0) @binding(10) var surface_id_out: texture_storage_2d<r32uint, write>;

// Largest number of half precision.
const HALF_LIMIT: f32 = 65504.0;

fn is_inside(id: vec3u) -> bool {
    return id.x < band.width && id.y < band.rows;
}

fn at(id: vec3u) -> vec2u {
    return vec2u(id.x, band.first_row + id.y);
}

fn word(plane: u32, id: vec3u) -> u32 {
    return planes[plane * band.pixels + id.y * band.width + id.x];
}

fn number(plane: u32, id: vec3u) -> f32 {
    return bitcast<f32>(word(plane, id));
}

fn triple(plane: u32, id: vec3u) -> vec3f {
    return vec3f(number(plane, id), number(plane + 1u, id), number(plane + 2u, id));
}

fn colour(plane: u32, id: vec3u) -> vec4f {
    return vec4f(clamp(triple(plane, id), vec3f(-HALF_LIMIT), vec3f(HALF_LIMIT)), 1.0);
}

@compute @workgroup_size(8, 8)
fn light(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) {
        return;
    }
    textureStore(direct_out, at(id), colour(DIRECT, id));
    textureStore(matte_out, at(id), colour(MATTE, id));
    textureStore(glossy_out, at(id), colour(GLOSSY, id));
    textureStore(normal_roughness_out, at(id), vec4f(triple(NORMAL, id), number(ROUGHNESS, id)));
}

@compute @workgroup_size(8, 8)
fn weights(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) {
        return;
    }
    textureStore(matte_weight_out, at(id), colour(MATTE_WEIGHT, id));
    textureStore(glossy_weight_out, at(id), colour(GLOSSY_WEIGHT, id));
    textureStore(depth_hit_out, at(id), vec4f(number(VIEW_DEPTH, id), number(GLOSSY_DISTANCE, id), 0.0, 0.0));
    textureStore(motion_out, at(id), vec4f(number(MOTION, id), number(MOTION + 1u, id), 0.0, 0.0));
}

@compute @workgroup_size(8, 8)
fn ids(@builtin(global_invocation_id) id: vec3u) {
    if !is_inside(id) {
        return;
    }
    textureStore(surface_id_out, at(id), vec4u(word(SURFACE_ID, id), 0u, 0u, 0u));
}
