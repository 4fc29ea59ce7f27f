//! What a host's guides mean: units, signs, encodings. The prepare pass turns them into those of the frame contract.

use super::inputs::{GuidePlane, GuideTextures, Scalar, unit_tolerance};
use super::uniform::{Value, uniforms};
use crate::camera::{Camera, Projection};
use crate::plane::Size;
use glam::{DVec3, Vec2, Vec3, Vec4};

/// What the values of the depth plane are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthKind {
    /// Distance along the camera's axis, in the scene's unit, > 0; +inf: background.
    #[default]
    View,
    /// What the depth test wrote, 0..1: clip z / clip w of [`Camera::clip_from_world`], whose row z counts here.
    /// Forward, reversed, infinite and oblique projections all work; the value of the far end is background.
    Device,
    /// Length of the ray from the eye (parallel rays: from the camera's plane), the scene's unit; +inf: background.
    Distance,
}

/// How the normal plane holds a unit vector. Where all of a texel's channels are 0 it is background, but not in the two
/// octahedral kinds, which have no such value: there depth alone says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalEncoding {
    /// x, y, z as they are, -1..1.
    #[default]
    Xyz,
    /// (x, y, z) / 2 + 1/2, 0..1.
    UnormXyz,
    /// The octahedral map of Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (JCGT
    /// 2014), z outward, in the first two channels, -1..1.
    Octahedral,
    /// The same, halved and shifted to 0..1.
    UnormOctahedral,
}

/// The space of the normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalSpace {
    /// World space.
    #[default]
    World,
    /// The camera's: x right, y up, z towards the viewer. The axes are found from `clip_from_world`.
    View,
}

/// What the values of the roughness plane are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RoughnessKind {
    /// glTF's perceptual roughness.
    #[default]
    Perceptual,
    /// GGX's alpha, its square.
    Alpha,
}

/// The unit of motion vectors before [`Convention::motion_scale`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MotionUnit {
    /// Pixels of the frame.
    #[default]
    Pixels,
    /// Shares of the frame's extent: 1 is its whole width, or height.
    Extents,
}

/// What a host's textures of guides mean. Told with every frame: changing it builds no pipeline anew.
///
/// A wrong convention does not fail, it blurs: [`super::DebugView`] shows what each usual mistake looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// Multiplies the vectors; then **previous = current + motion**, x to the right, y **down**. Vectors that point from
    /// the previous place to the current one take minus signs, y upwards a minus for y.
    pub motion_scale: [f32; 2],
    /// What the vectors are counted in.
    pub motion_unit: MotionUnit,
    /// The vectors are differences of jittered positions, so that a still scene under a still camera has motion. It is
    /// taken out with the jitters of both cameras.
    pub motion_has_jitter: bool,
    /// What depths are.
    pub depth: DepthKind,
    /// How normals are held.
    pub normal: NormalEncoding,
    /// The space of the normals.
    pub normal_space: NormalSpace,
    /// What roughness is.
    pub roughness: RoughnessKind,
}

impl Convention {
    /// The frame contract of [`crate::Frame`]: view depth, world normals, pixels, perceptual roughness.
    pub const QUELL: Self = Self {
        motion_scale: [1.0; 2],
        motion_unit: MotionUnit::Pixels,
        motion_has_jitter: false,
        depth: DepthKind::View,
        normal: NormalEncoding::Xyz,
        normal_space: NormalSpace::World,
        roughness: RoughnessKind::Perceptual,
    };

    /// Bevy's prepass textures, as `bevy_pbr`'s shaders write and read them (0.19): normals as (n + 1) / 2; vectors as
    /// current minus previous clip position times (0.5, -0.5), which is UV, from matrices without TAA's jitter; device
    /// depth, reversed and infinite. The camera's `clip_from_world` is Bevy's `unjittered_clip_from_world`.
    pub const BEVY: Self = Self {
        motion_scale: [-1.0; 2],
        motion_unit: MotionUnit::Extents,
        depth: DepthKind::Device,
        normal: NormalEncoding::UnormXyz,
        ..Self::QUELL
    };

    /// Vectors as temporal upscalers take them: from this frame's place to the previous frame's, in UV; device depth;
    /// the rest as [`Convention::QUELL`]. (Unity's `UpscalingIO.MotionVectorDomain` documents the direction.)
    pub const UPSCALER: Self = Self { motion_unit: MotionUnit::Extents, depth: DepthKind::Device, ..Self::QUELL };

    /// Vectors in clip space (-1..1, y up), current minus previous; device depth; the rest as [`Convention::QUELL`].
    pub const NDC: Self = Self { motion_scale: [-0.5, 0.5], ..Self::UPSCALER };
}

impl Default for Convention {
    fn default() -> Self {
        Self::QUELL
    }
}

uniforms! {
    /// What the prepare pass reads of a frame besides planes: twin of `Prepare` in `passes/prepare.wgsl`.
    pub PrepareUniforms as "Prepare" {
        device_z: Vec4,
        right: Vec3,
        device_far: f32,
        up: Vec3,
        unit_tolerance: f32,
        motion_scale: Vec2,
        motion_shift: Vec2,
        depth: u32,
        normal: u32,
        normal_in_view: u32,
        roughness_is_alpha: u32,
        roughness_channel: u32,
        glossy_hit_channel: u32,
        confidence_channel: u32,
        there: u32,
    }
}

impl PrepareUniforms {
    /// Members that cameras and textures tell, anew for every frame; the others follow from the convention, or have a
    /// default.
    pub const PER_FRAME: [&'static str; 6] = ["device_z", "right", "device_far", "up", "motion_shift", "there"];

    /// What a convention says for frames of `size`. Those of [`PrepareUniforms::PER_FRAME`] are zero, scalars lie in their
    /// textures' first channels, and normals are unit vectors but for rounding to floats or halves.
    pub fn of_convention(convention: &Convention, size: Size) -> Self {
        let unit = match convention.motion_unit {
            MotionUnit::Pixels => Vec2::ONE,
            MotionUnit::Extents => Vec2::new(size.width as f32, size.height as f32),
        };
        Self {
            device_z: Vec4::ZERO,
            right: Vec3::ZERO,
            device_far: 0.0,
            up: Vec3::ZERO,
            unit_tolerance: crate::border::UNIT_TOLERANCE,
            motion_scale: Vec2::from(convention.motion_scale) * unit,
            motion_shift: Vec2::ZERO,
            depth: convention.depth as u32,
            normal: convention.normal as u32,
            normal_in_view: u32::from(convention.normal_space == NormalSpace::View),
            roughness_is_alpha: u32::from(convention.roughness == RoughnessKind::Alpha),
            roughness_channel: 0,
            glossy_hit_channel: 0,
            confidence_channel: 0,
            there: 0,
        }
    }

    /// For a frame of `size` with these guides; `cameras`: its own, whose row z counts with [`DepthKind::Device`], and the
    /// one of the frame before. `None`: its camera cannot be used.
    pub fn new(cameras: [&Camera; 2], size: Size, guides: &GuideTextures<'_>) -> Option<Self> {
        let [camera, previous] = cameras;
        let projection = camera.projection(size)?;
        let (right, up) = axes(camera, &projection);
        let (device_z, device_far) = device(camera, &projection);
        // A jittered frame shows a point at its place minus the jitter.
        let shift = Vec2::from(previous.jitter) - Vec2::from(camera.jitter);
        let channel = |s: Option<Scalar<'_>>| s.map_or(0, |s| s.channel as u32);
        let there = GuidePlane::ALL.into_iter().filter(|plane| guides.given(*plane).is_some());
        let convention = Self::of_convention(&guides.convention, size);
        Some(Self {
            device_z,
            right,
            device_far,
            up,
            unit_tolerance: guides.normal.map_or(convention.unit_tolerance, |v| unit_tolerance(v.texture().format())),
            motion_shift: if guides.convention.motion_has_jitter { shift } else { Vec2::ZERO },
            roughness_channel: channel(guides.roughness),
            glossy_hit_channel: channel(guides.glossy_hit_distance),
            confidence_channel: channel(guides.confidence_in),
            there: there.fold(0, |all, plane| all | plane.there()),
            ..convention
        })
    }

    /// What the uniform buffer holds.
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write(&mut out);
        out
    }
}

/// A row of the matrix.
fn row(camera: &Camera, r: usize) -> (DVec3, f64) {
    let m = camera.clip_from_world.map(f64::from);
    (DVec3::new(m[r], m[4 + r], m[8 + r]), m[12 + r])
}

/// The camera's axes to the right and up: rows x and y without what they have along the viewing direction (off-centre
/// projections).
fn axes(camera: &Camera, projection: &Projection) -> (Vec3, Vec3) {
    let forward = projection.forward.as_dvec3();
    let axis = |r| {
        let a = row(camera, r).0;
        (a - forward * a.dot(forward)).normalize_or_zero().as_vec3()
    };
    (axis(0), axis(1))
}

/// Row z for points relative to the eye, and the device depth of what is farthest away.
fn device(camera: &Camera, projection: &Projection) -> (Vec4, f32) {
    let eye = projection.eye.as_dvec3();
    let (z, z_constant) = row(camera, 2);
    let (w, w_constant) = row(camera, 3);
    let (z_eye, w_eye) = (z.dot(eye) + z_constant, w.dot(eye) + w_constant);
    let forward = projection.forward.as_dvec3();
    let (z_step, w_step) = (z.dot(forward), w.dot(forward));
    // View depth on the axis where z / w is `d`.
    let depth = |d: f64| {
        let t = (d * w_eye - z_eye) / (z_step - d * w_step);
        // Nowhere, or behind the eye: beyond infinity.
        if t.is_finite() && (t > 0.0 || !projection.perspective) { t } else { f64::INFINITY }
    };
    (z.extend(z_eye).as_vec4(), if depth(0.0) > depth(1.0) { 0.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `near` and `far` as device depths 0 and 1, or the reverse.
    fn with_depth(near: f64, far: f64, reversed: bool, orthographic: bool) -> Camera {
        let mut camera = Camera::perspective([1.0, 2.0, 3.0], [0.3, -0.2, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
        let (forward, constant) = row(&camera, 3);
        let (a, b) = match (orthographic, far.is_infinite()) {
            (true, _) => (1.0 / (far - near), -near / (far - near)),
            (false, true) => (1.0, -near),
            (false, false) => (far / (far - near), -near * far / (far - near)),
        };
        // z = a t + b, w = t or 1; reversed: z = w - z.
        for c in 0..4 {
            let t = if c == 3 { constant } else { forward[c] };
            let one = if c == 3 { 1.0 } else { 0.0 };
            let w = if orthographic { one } else { t };
            let z = a * t + b * one;
            camera.clip_from_world[4 * c + 2] = (if reversed { w - z } else { z }) as f32;
            camera.clip_from_world[4 * c + 3] = w as f32;
        }
        camera
    }

    #[test]
    fn the_far_end_of_every_projection_is_found() {
        for orthographic in [false, true] {
            for far in [100.0, f64::INFINITY] {
                if orthographic && far.is_infinite() {
                    continue;
                }
                for reversed in [false, true] {
                    let camera = with_depth(0.5, far, reversed, orthographic);
                    let projection = camera.projection(Size::new(30, 20)).unwrap();
                    let (_, found) = device(&camera, &projection);
                    assert_eq!(found, if reversed { 0.0 } else { 1.0 }, "{far} {reversed} {orthographic}");
                }
            }
        }
    }

    #[test]
    fn axes_are_right_handed_even_off_centre() {
        let mut camera = with_depth(0.1, 10.0, true, false);
        for c in 0..4 {
            camera.clip_from_world[4 * c] += 0.3 * camera.clip_from_world[4 * c + 3];
        }
        let projection = camera.projection(Size::new(30, 20)).unwrap();
        let (right, up) = axes(&camera, &projection);
        assert!((right.cross(up) + projection.forward).length() < 1e-5);
    }
}
