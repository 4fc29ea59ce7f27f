//! Guides and tap patterns as storage buffers hold them.

use super::uniform::{Value, uniforms};
use crate::border::Guides;
use crate::kernels::spiral::{PHASES, Spiral};
use glam::{Vec2, Vec3};

uniforms! {
    /// The guides of one pixel: twin of `Guide` in `guides.wgsl`.
    pub(super) Guide as "Guide" {
        normal: Vec3,
        depth: f32,
        motion: Vec2,
        roughness: f32,
        glossy_hit: f32,
        id: u32,
        confidence_in: f32,
    }

    /// A tap: twin of `SpiralTap` in `passes/sparse_bilateral.wgsl`.
    pub(super) SpiralTap as "SpiralTap" {
        dx: i32,
        dy: i32,
        weight: f32,
    }
}

/// Depth of background: WGSL promises nothing of infinities and NaN.
const BACKGROUND: f32 = 0.0;
/// Distances from here on count as infinite.
const FAR: f32 = 1e30;
/// Motion that is not known points so far off screen, in pixels.
const UNKNOWN_MOTION: f32 = 1e9;

/// The guides of a frame for a storage buffer: 48 bytes a pixel, row by row.
pub fn pack_guides(guides: &Guides) -> Vec<u8> {
    let mut out = Vec::with_capacity(guides.size.pixels() * Guide::SIZE);
    for y in 0..guides.size.height {
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
            guide.write(&mut out);
        }
    }
    out
}

/// A tap pattern for a storage buffer: the 16 phases one after another, 16 bytes a tap.
pub fn pack_spiral(spiral: &Spiral) -> Vec<u8> {
    let mut out = Vec::new();
    for tap in (0..PHASES).flat_map(|phase| spiral.phase(phase)) {
        SpiralTap { dx: tap.dx, dy: tap.dy, weight: tap.weight }.write(&mut out);
    }
    out
}
