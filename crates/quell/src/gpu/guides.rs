//! Guides and tap patterns as textures and storage buffers hold them: twin of `guides/store.wgsl` and `storage/*.wgsl`.

use super::storage::{Storage, Texel};
use super::uniform::{Value, uniforms};
use crate::border::Guides;
use crate::kernels::spiral::{PHASES, Spiral};
use crate::par;
use glam::{Vec2, Vec3};

uniforms! {
    /// A tap: twin of `SpiralTap` in `passes/sparse_bilateral.wgsl`.
    pub(super) SpiralTap as "SpiralTap" {
        dx: i32,
        dy: i32,
        weight: f32,
    }
}

/// Depth of background: WGSL promises nothing of infinities and NaN.
pub(super) const BACKGROUND: f32 = 0.0;
/// Distances from here on count as infinite.
pub(super) const FAR: f32 = 1e30;
/// Motion that is not known points so far off screen, in pixels.
pub(super) const UNKNOWN_MOTION: f32 = 1e9;

/// Twin of `Guide`.
struct Guide {
    normal: Vec3,
    depth: f32,
    motion: Vec2,
    roughness: f32,
    glossy_hit: f32,
    id: u32,
    confidence_in: f32,
}

/// The texels of the three planes of guides, row by row without padding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GuideTexels {
    /// View depth and normal.
    pub geometry: Vec<u8>,
    /// Id and roughness.
    pub surface: Vec<u8>,
    /// Motion, hit distance, confidence of the host.
    pub moving: Vec<u8>,
}

/// The guides of a frame as textures of this storage hold them.
pub fn pack_guides(guides: &Guides, storage: Storage) -> GuideTexels {
    let mut rows = vec![GuideTexels::default(); guides.size.height];
    par::rows(&mut rows, 1, |y, row| row.iter_mut().for_each(|row| *row = pack_row(guides, y, storage)));
    let all = |of: fn(&GuideTexels) -> &[u8]| rows.iter().map(of).collect::<Vec<_>>().concat();
    GuideTexels { geometry: all(|row| &row.geometry), surface: all(|row| &row.surface), moving: all(|row| &row.moving) }
}

fn pack_row(guides: &Guides, y: usize, storage: Storage) -> GuideTexels {
    let bytes = |texel: Texel| Vec::with_capacity(guides.size.width * texel.bytes(storage) as usize);
    let mut out =
        GuideTexels { geometry: bytes(Texel::Geometry), surface: bytes(Texel::Surface), moving: bytes(Texel::Moving) };
    for x in 0..guides.size.width {
        let depth = guides.depth.at(x, y);
        let motion = Vec2::from(guides.motion.at(x, y));
        let far = Vec2::splat(UNKNOWN_MOTION);
        let guide = Guide {
            normal: Vec3::from(guides.normal.at(x, y)),
            depth: if depth < FAR { depth } else { BACKGROUND },
            motion: if motion.is_nan() { far } else { motion.clamp(-far, far) },
            roughness: guides.roughness.at(x, y),
            glossy_hit: guides.glossy_hit.at(x, y).min(FAR),
            id: guides.id.at(x, y),
            confidence_in: guides.confidence_in.at(x, y),
        };
        match storage {
            Storage::Float => float::store(&guide, &mut out),
            Storage::Half => half::store(&guide, &mut out),
        }
    }
    out
}

fn put(words: &[u32], out: &mut Vec<u8>) {
    words.iter().for_each(|word| out.extend(word.to_le_bytes()));
}

/// Twin of `storage/float.wgsl`.
mod float {
    use super::{Guide, GuideTexels, put};

    pub(super) fn store(guide: &Guide, out: &mut GuideTexels) {
        put(&guide.normal.extend(guide.depth).to_array().map(f32::to_bits), &mut out.geometry);
        put(&[guide.id, guide.roughness.to_bits()], &mut out.surface);
        let moving = [guide.motion.x, guide.motion.y, guide.glossy_hit, guide.confidence_in];
        put(&moving.map(f32::to_bits), &mut out.moving);
    }
}

/// Twin of `storage/half.wgsl`, step by step.
pub(super) mod half {
    use super::{FAR, Guide, GuideTexels, put};
    use glam::{IVec2, Vec2, Vec3};

    /// Half the number of steps along each axis of the octahedron, 19 bits: 16 lie in `geometry`, 3 in `surface`.
    pub(in crate::gpu) const NORMAL_STEPS: f32 = 262_143.0;
    pub(in crate::gpu) const NORMAL_CENTRE: i32 = 262_144;
    pub(in crate::gpu) const NORMAL_LOW_BITS: u32 = 3;
    pub(in crate::gpu) const ROUGHNESS_STEPS: f32 = 1023.0;
    /// Motion: sign, 5 bits of exponent, 14 of mantissa. Under `MOTION_LEAST` pixels it is 0; none is longer than
    /// `MOTION_MOST`.
    pub(in crate::gpu) const MOTION_LEAST: f32 = 1.220_703_1e-4;
    pub(in crate::gpu) const MOTION_MOST: f32 = 131_072.0;
    /// Of eight bits: so that halves, thirds, quarters, fifths and tenths come back as they were.
    pub(in crate::gpu) const CONFIDENCE_STEPS: f32 = 240.0;
    /// Largest finite half.
    pub(in crate::gpu) const HALF_MAX: f32 = 65504.0;

    fn fold(v: Vec2) -> Vec2 {
        (1.0 - Vec2::new(v.y, v.x).abs()) * Vec2::select(v.cmpge(Vec2::ZERO), Vec2::ONE, -Vec2::ONE)
    }

    fn octahedral(n: Vec3) -> Vec2 {
        let size = n.x.abs() + n.y.abs() + n.z.abs();
        if size > 0.0 {
            let flat = Vec2::new(n.x, n.y) / size;
            if n.z < 0.0 { fold(flat) } else { flat }
        } else {
            Vec2::ZERO
        }
    }

    fn normal_code(n: Vec3) -> [u32; 2] {
        let steps = octahedral(n) * NORMAL_STEPS;
        let code = IVec2::new(steps.x.round_ties_even() as i32, steps.y.round_ties_even() as i32);
        [code.x + NORMAL_CENTRE, code.y + NORMAL_CENTRE].map(|v| v as u32)
    }

    const fn short_id(id: u32) -> u32 {
        if id < 65536 { id } else { (id ^ (id >> 16)).wrapping_mul(0x9e37_79b1) >> 16 }
    }

    fn motion_code(v: f32) -> u32 {
        let size = v.abs().min(MOTION_MOST);
        if size < MOTION_LEAST {
            return 0;
        }
        let bits = size.to_bits();
        let rounded = (bits + 0xff + ((bits >> 9) & 1)) >> 9;
        (rounded - (113 << 14)) | if v < 0.0 { 1 << 19 } else { 0 }
    }

    pub(super) fn store(guide: &Guide, out: &mut GuideTexels) {
        let code = normal_code(guide.normal);
        let high = code.map(|c| c >> NORMAL_LOW_BITS);
        put(&[guide.depth.to_bits(), high[0] | (high[1] << 16)], &mut out.geometry);
        let low = code.map(|c| c & 7);
        let roughness = (guide.roughness.clamp(0.0, 1.0) * ROUGHNESS_STEPS).round_ties_even() as u32;
        put(&[short_id(guide.id) | (roughness << 16) | (low[0] << 26) | (low[1] << 29)], &mut out.surface);
        let [x, y] = guide.motion.to_array().map(motion_code);
        let ratio = if guide.depth <= 0.0 {
            0.0
        } else if guide.glossy_hit >= FAR {
            HALF_MAX
        } else {
            (guide.glossy_hit / guide.depth).min(HALF_MAX)
        };
        let confidence = (guide.confidence_in.clamp(0.0, 1.0) * CONFIDENCE_STEPS).round_ties_even() as u32;
        put(
            &[x | (y << 20), (y >> 12) | (u32::from(::half::f16::from_f32(ratio).to_bits()) << 8) | (confidence << 24)],
            &mut out.moving,
        );
    }
}

/// A tap pattern for a storage buffer: the 16 phases one after another, 16 bytes a tap.
pub fn pack_spiral(spiral: &Spiral) -> Vec<u8> {
    let mut out = Vec::new();
    for tap in (0..PHASES).flat_map(|phase| spiral.phase(phase)) {
        SpiralTap { dx: tap.dx, dy: tap.dy, weight: tap.weight }.write(&mut out);
    }
    out
}
