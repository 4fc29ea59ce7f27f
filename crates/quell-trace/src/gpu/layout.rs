//! What the buffers hold, as WGSL lays it out (`scene.wgsl`, `primary.wgsl`).

use bytemuck::{Pod, Zeroable};
use glam::{Mat3A, Vec3};

/// No offset, no emitter, no texture.
pub(super) const NONE: u32 = u32::MAX;

/// A column of a matrix, or a row of `lights`.
pub(super) type Row = [f32; 4];

pub(super) fn row(v: Vec3, w: f32) -> Row {
    [v.x, v.y, v.z, w]
}

/// A bit pattern in the place of a number.
pub(super) fn bits(value: u32) -> f32 {
    f32::from_bits(value)
}

pub(super) fn columns(m: Mat3A) -> [Row; 3] {
    [m.x_axis, m.y_axis, m.z_axis].map(|c| row(c.into(), 0.0))
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Node {
    pub(super) planes: [[f32; 8]; 6],
    pub(super) links: [u32; 8],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Triangle {
    pub(super) a: [f32; 3],
    pub(super) instance: u32,
    pub(super) b: [f32; 3],
    pub(super) number: u32,
    pub(super) c: [f32; 3],
    pub(super) emitter: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Instance {
    pub(super) normal_matrix: [Row; 3],
    pub(super) world_from_mesh: [Row; 3],
    pub(super) previous: [Row; 4],
    pub(super) surface: u32,
    pub(super) flags: u32,
    pub(super) emission_scale: f32,
    pub(super) cutoff: f32,
    pub(super) corners: u32,
    pub(super) rest_positions: u32,
    pub(super) previous_positions: u32,
    pub(super) normals: u32,
    pub(super) uvs: u32,
    pub(super) uvs1: u32,
    pub(super) colors: u32,
    pub(super) tangents: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct TextureRef {
    pub(super) levels: u32,
    pub(super) level_count: u32,
    pub(super) lookup: u32,
    pub(super) uv_set: u32,
    pub(super) matrix: Row,
    pub(super) offset: [f32; 2],
    pub(super) extent: [f32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Pattern {
    pub(super) colors: [Row; 3],
    pub(super) numbers: [f32; 3],
    pub(super) kind: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Surface {
    pub(super) base_color: [f32; 3],
    pub(super) metallic: f32,
    pub(super) emission: [f32; 3],
    pub(super) roughness: f32,
    pub(super) attenuation_color: [f32; 3],
    pub(super) attenuation_distance: f32,
    pub(super) specular_color: [f32; 3],
    pub(super) specular: f32,
    pub(super) transmission: f32,
    pub(super) ior: f32,
    pub(super) alpha_factor: f32,
    pub(super) flags: u32,
    pub(super) normal_scale: f32,
    pub(super) pad: [f32; 3],
    pub(super) pattern: Pattern,
    pub(super) textures: [TextureRef; TEXTURES as usize],
}

/// Textures of a surface, in this order.
pub(super) const BASE_COLOR_TEXTURE: u32 = 0;
pub(super) const METALLIC_ROUGHNESS_TEXTURE: u32 = 1;
pub(super) const TRANSMISSION_TEXTURE: u32 = 2;
pub(super) const SPECULAR_TEXTURE: u32 = 3;
pub(super) const SPECULAR_COLOR_TEXTURE: u32 = 4;
pub(super) const EMISSIVE_TEXTURE: u32 = 5;
pub(super) const NORMAL_TEXTURE: u32 = 6;
pub(super) const TEXTURES: u32 = 7;

/// What lies beyond an image's edges.
pub(super) const WRAP_REPEAT: u32 = 0;
pub(super) const WRAP_MIRROR: u32 = 1;
pub(super) const WRAP_CLAMP: u32 = 2;

/// Flags of instances.
pub(super) const MIRRORED: u32 = 1;
pub(super) const STILL: u32 = 2;
pub(super) const IS_PAINTED: u32 = 4;
pub(super) const MASKED: u32 = 8;
pub(super) const BLENDED: u32 = 16;

/// Flags of surfaces.
pub(super) const TWO_SIDED_EMISSION: u32 = 1;
pub(super) const THIN_WALLED: u32 = 2;
pub(super) const UNLIT: u32 = 4;

/// Kinds of patterns.
pub(super) const PLAIN: u32 = 0;
pub(super) const CHECKER: u32 = 1;
pub(super) const TILES: u32 = 2;
pub(super) const STRIPES: u32 = 3;
pub(super) const WOOD: u32 = 4;
pub(super) const MARBLE: u32 = 5;
pub(super) const MOTTLED: u32 = 6;
pub(super) const PLANKS: u32 = 7;
pub(super) const PICTURE: u32 = 8;

/// Kinds of emitters.
pub(super) const TRIANGLE: u32 = 0;
pub(super) const PATCH: u32 = 1;
pub(super) const POINT: u32 = 2;
pub(super) const SPOT: u32 = 3;
pub(super) const DIRECTIONAL: u32 = 4;
pub(super) const ENVIRONMENT: u32 = 5;

/// How what is infinitely far away moves.
pub(super) const FAR_TURNS: u32 = 0;
pub(super) const FAR_IS_STILL: u32 = 1;
pub(super) const FAR_IS_UNKNOWN: u32 = 2;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Frame {
    pub(super) eye: [f32; 3],
    pub(super) width: u32,
    pub(super) forward: [f32; 3],
    pub(super) height: u32,
    pub(super) previous_eye: [f32; 3],
    pub(super) eye_moved: u32,
    pub(super) origin: [Row; 3],
    pub(super) direction: [Row; 3],
    /// Rows for u, v and w.
    pub(super) now: [Row; 3],
    pub(super) before: [Row; 3],
    pub(super) jitter: [f32; 2],
    pub(super) number: [u32; 2],
    pub(super) first_row: u32,
    pub(super) rows: u32,
    pub(super) pixels: u32,
    pub(super) far_motion: u32,
    pub(super) bounces: u32,
    pub(super) exact: u32,
    pub(super) fresnel_rough_damping: u32,
    pub(super) fresnel_strength: f32,
    pub(super) indirect_clamp: f32,
    pub(super) inner_from_world: f32,
    pub(super) world_from_inner: f32,
    pub(super) triangle_count: u32,
    pub(super) lights: Lights,
}

/// Where the parts of `lights` begin, and what of the lights is no list.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Lights {
    pub(super) emitters: u32,
    pub(super) infinite: u32,
    pub(super) infinite_count: u32,
    pub(super) tree_nodes: u32,
    pub(super) environment: u32,
    pub(super) row_cdf: u32,
    pub(super) column_cdf: u32,
    pub(super) environment_emitter: u32,
    pub(super) has_area: u32,
    pub(super) map_rotation: f32,
    pub(super) map_extent: [u32; 2],
    pub(super) environment_color: [f32; 3],
    pub(super) sun_probability: f32,
    pub(super) sun_direction: [f32; 3],
    pub(super) sun_one_minus_cos: f32,
    pub(super) sun_radiance: [f32; 3],
    /// Which of the differences that a test has planted shows; read by planted text only.
    pub(super) planted: u32,
}

/// One dispatch over one slot of each pixel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Job {
    pub(super) slot: u32,
    pub(super) only: u32,
    pub(super) kind: u32,
    pub(super) domain: u32,
    pub(super) first: u32,
    pub(super) count: u32,
    pub(super) sample: u32,
    pub(super) flags: u32,
    pub(super) seed: [u32; 2],
    pub(super) second_seed: [u32; 2],
    pub(super) pass: u32,
    pub(super) direct_samples: u32,
    pub(super) pad: [u32; 2],
}

/// Kinds of paths.
pub(super) const MATTE_PATH: u32 = 0;
pub(super) const GLOSSY_PATH: u32 = 1;
pub(super) const TRANSMISSION_PATH: u32 = 2;
pub(super) const FULL_PATH: u32 = 3;
pub(super) const EYE_PATH: u32 = 4;

/// Flags of jobs.
pub(super) const IS_SIGNAL: u32 = 1;
pub(super) const IN_HALVES: u32 = 2;
pub(super) const IS_FIRST: u32 = 4;
/// The eye's ray goes through any place of the pixel, by the job's sample and seed; rays of samples before it were counted.
pub(super) const IN_AREA: u32 = 8;

/// Bytes of a slot.
pub(super) const SLOT_BYTES: u64 = 64;

/// Flags of slots.
pub(super) const OCCUPIED: u32 = 1;
pub(super) const ESCAPED: u32 = 2;
pub(super) const BEHIND_GLASS: u32 = 4;

/// Planes of the results, by the place of their first channel.
pub(super) const DIRECT: u32 = 0;
pub(super) const MATTE: u32 = 3;
pub(super) const GLOSSY: u32 = 6;
pub(super) const MATTE_WEIGHT: u32 = 9;
pub(super) const GLOSSY_WEIGHT: u32 = 12;
pub(super) const NORMAL: u32 = 15;
pub(super) const VIEW_DEPTH: u32 = 18;
pub(super) const ROUGHNESS: u32 = 19;
pub(super) const MOTION: u32 = 20;
pub(super) const SURFACE_ID: u32 = 22;
pub(super) const MATTE_DISTANCE: u32 = 23;
pub(super) const GLOSSY_DISTANCE: u32 = 24;
pub(super) const MATTE_VARIANCE: u32 = 25;
pub(super) const GLOSSY_VARIANCE: u32 = 26;
pub(super) const CLOSEST_RAYS: u32 = 27;
pub(super) const SHADOW_RAYS: u32 = 28;
/// So many planes has every band. Those that follow are of frames in halves, or of references.
pub(super) const FRAME_PLANES: u32 = 29;
pub(super) const MATTE_HALF_A: u32 = 29;
pub(super) const MATTE_HALF_B: u32 = 32;
pub(super) const GLOSSY_HALF_A: u32 = 35;
pub(super) const GLOSSY_HALF_B: u32 = 38;
pub(super) const HALVES_PLANES: u32 = 41;
pub(super) const BEAUTY_MEAN: u32 = 29;
pub(super) const BEAUTY_SQUARES: u32 = 32;
pub(super) const DIRECT_MEAN: u32 = 35;
pub(super) const MATTE_MEAN: u32 = 38;
pub(super) const GLOSSY_MEAN: u32 = 41;
pub(super) const REFERENCE_PLANES: u32 = 44;

/// In the place of infinity in the results; larger than every distance.
pub(super) const INFINITE: f32 = 3e38;
/// Motion that nobody knows.
pub(super) const UNKNOWN_MOTION: f32 = 1e30;

const _: () = {
    assert!(size_of::<Node>() == 224);
    assert!(size_of::<Triangle>() == 48);
    assert!(size_of::<Instance>() == 208);
    assert!(size_of::<Surface>() == 496);
    assert!(size_of::<Frame>() == 400);
    assert!(size_of::<Job>() == 64);
};
