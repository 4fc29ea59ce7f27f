// The border on the GPU: what the host's textures hold becomes what every stage may trust. Twin of border.rs and of
// convention.rs. Whatever is repaired is counted.
//
// The pass is put together for the textures that there are: it supplies `repairs` and an `*_at` for every plane.

// Twin of convention.rs (`PrepareUniforms`).
struct Prepare {
    // Row z of clip_from_world for points relative to the eye.
    device_z: vec4f,
    // The camera's axes, for normals in its space.
    right: vec3f,
    // The device depth of what is farthest away.
    device_far: f32,
    up: vec3f,
    // Squared lengths of normals may differ from 1 by so much.
    unit_tolerance: f32,
    // To pixels; and what is added then.
    motion_scale: vec2f,
    motion_shift: vec2f,
    // `DepthKind`, `NormalEncoding`
    depth: u32,
    normal: u32,
    normal_in_view: u32,
    roughness_is_alpha: u32,
    roughness_channel: u32,
    glossy_hit_channel: u32,
    confidence_channel: u32,
    // `HAS_*`
    there: u32,
}

// Which planes are there.
const HAS_DEPTH_FORMAT: u32 = 1u;
const HAS_VIEW_DEPTH: u32 = 2u;
const HAS_NORMAL: u32 = 4u;
const HAS_MOTION: u32 = 8u;
const HAS_ROUGHNESS: u32 = 16u;
const HAS_GLOSSY_HIT_DISTANCE: u32 = 32u;
const HAS_SURFACE_ID: u32 = 64u;
const HAS_CONFIDENCE_IN: u32 = 128u;

// `Repair`
const NOT_FINITE: u32 = 0u;
const NEGATIVE: u32 = 1u;
const NOT_UNIT: u32 = 2u;
const OUT_OF_RANGE: u32 = 3u;
const REPAIRS: u32 = 4u;
// `PlaneName`
const PLANES: u32 = 14u;
const PLANE_DIRECT: u32 = 0u;
const PLANE_MATTE: u32 = 1u;
const PLANE_GLOSSY: u32 = 2u;
const PLANE_DIRECT_MATTE: u32 = 3u;
const PLANE_DIRECT_GLOSSY: u32 = 4u;
const PLANE_MATTE_WEIGHT: u32 = 5u;
const PLANE_GLOSSY_WEIGHT: u32 = 6u;
const PLANE_VIEW_DEPTH: u32 = 8u;
const PLANE_NORMAL: u32 = 9u;
const PLANE_ROUGHNESS: u32 = 10u;
const PLANE_MOTION: u32 = 11u;
const PLANE_GLOSSY_HIT: u32 = 12u;
const PLANE_CONFIDENCE_IN: u32 = 13u;

// Counts of this workgroup.
var<workgroup> found: array<atomic<u32>, 56>;

fn note(plane: u32, repair: u32) {
    atomicAdd(&found[plane * REPAIRS + repair], 1u);
}

// Adds this workgroup's counts to the frame's; every invocation comes here.
fn flush_counts(local: u32) {
    workgroupBarrier();
    if local < PLANES * REPAIRS {
        let count = atomicLoad(&found[local]);
        if count > 0u {
            atomicAdd(&repairs[local], count);
        }
    }
}

fn is_nan(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7fffffffu) > 0x7f800000u;
}

fn is_infinite(v: f32) -> bool {
    return !is_finite(v) && !is_nan(v);
}

// Counts what `input_colour` changes.
fn count_colour(plane: u32, texel: vec4f) {
    let given = texel.xyz;
    if !(is_finite(given.x) && is_finite(given.y) && is_finite(given.z)) {
        note(plane, NOT_FINITE);
    }
    var large = false;
    for (var c = 0; c < 3; c++) {
        large = large || (is_finite(given[c]) && abs(given[c]) > COLOUR_LIMIT);
    }
    if large {
        note(plane, OUT_OF_RANGE);
    }
    if any(input_colour(texel) < vec3f(0.0)) {
        note(plane, NEGATIVE);
    }
}
