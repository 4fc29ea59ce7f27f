//! Planes of a frame as a device takes them: bytes, row by row.

use super::accelerator::MOST_COLOUR;
use crate::par;
use crate::plane::Size;
use crate::window::{Features, Motion, Packed};

/// A plane of a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FramePlane {
    /// 1/depth (0: background) and the position: four f32.
    Surface,
    /// Unit normal, or zeros, and 1 in a mirror or glass, else 0: four f32.
    Normal,
    /// Motion to the frame before, in pixels: two f32. Unknown motion leads [`FramePlane::FAR`] away.
    ToPrevious,
    /// Motion to the next frame. Not of the window's last: it may not be known yet.
    ToNext,
    /// Motion of what mirrors and glass show; at other pixels the surface's.
    ReflectionToPrevious,
    /// The same to the next frame.
    ReflectionToNext,
    /// Colour that mirrors and glass show, tone-mapped: four halves, the last 0.
    SeenColour,
    /// Unit normal seen there, or zeros: four halves, the last 0.
    SeenNormal,
    /// Samples of a colour plane: four halves, the last 0. Its number among all of a frame's, the same in every frame.
    Samples(usize),
    /// Mean of a light around the pixel and its deviation, below 0 where it has no noise: two halves. The number of the
    /// light's first plane.
    Light(usize),
    /// Tone-mapped colour of the surface, where none seen in mirrors is known: four halves, the last 0.
    SurfaceColour,
    /// The filtered picture, and the coverage (1 where it has none): four f32.
    Picture,
    /// The same picture of the light as it came: four f32, the last 0.
    Input,
}

impl FramePlane {
    /// Pixels to where no picture reaches.
    pub const FAR: f32 = 1e9;

    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Surface | Self::Normal | Self::Picture | Self::Input => 16,
            Self::Light(_) => 4,
            _ => 8,
        }
    }
}

/// A plane of [`Features`]; zeros where they have none, or for a plane that is not theirs.
pub(super) fn of_features(features: &Features, plane: FramePlane, align: usize) -> Vec<u8> {
    let size = features.size;
    let moved = |forward: bool, reflected: bool| motion(size, align, features.motion.get(forward, reflected));
    match plane {
        FramePlane::Surface => texels(size, align, plane.bytes(), |i, texel| {
            let s = &features.surface[i];
            // Squares of distances stay finite.
            let [x, y, z] = s.position.map(|v| v.clamp(-MOST_COLOUR, MOST_COLOUR));
            numbers(texel, [s.inverse_depth, x, y, z]);
        }),
        FramePlane::Normal => texels(size, align, plane.bytes(), |i, texel| {
            let [x, y, z] = features.surface[i].normal;
            numbers(texel, [x, y, z, if features.is_mirror(i) { 1.0 } else { 0.0 }]);
        }),
        FramePlane::ToPrevious => moved(false, false),
        FramePlane::ToNext => moved(true, false),
        FramePlane::ReflectionToPrevious => moved(false, true),
        FramePlane::ReflectionToNext => moved(true, true),
        FramePlane::SeenColour => packed(size, align, features.seen.as_ref().map(|seen| (seen, 0))),
        FramePlane::SeenNormal => packed(size, align, features.seen.as_ref().map(|seen| (seen, 1))),
        FramePlane::SurfaceColour => packed(size, align, features.surface_albedo.as_ref().map(|own| (own, 0))),
        FramePlane::Samples(_) | FramePlane::Light(_) | FramePlane::Picture | FramePlane::Input => {
            texels(size, align, plane.bytes(), |_, _| ())
        }
    }
}

fn motion(size: Size, align: usize, motion: Option<Motion<'_>>) -> Vec<u8> {
    let known = |m: [f32; 2]| m.iter().all(|c| c.abs() <= FramePlane::FAR);
    texels(size, align, 8, |i, texel| {
        let m = motion.map_or([0.0; 2], |motion| motion.at(i));
        numbers(texel, if known(m) { m } else { [FramePlane::FAR; 2] });
    })
}

/// Three halves of a plane of packed colours and a 0.
pub(super) fn packed(size: Size, align: usize, plane: Option<(&Packed, usize)>) -> Vec<u8> {
    texels(size, align, 8, |i, texel| {
        let [r, g, b] = plane.map_or([half::f16::ZERO; 3], |(packed, k)| packed.halves(k, i));
        for (bytes, value) in texel.as_chunks_mut::<2>().0.iter_mut().zip([r, g, b]) {
            *bytes = value.to_le_bytes();
        }
    })
}

/// `bytes` for each pixel, which `fill` writes over zeros; each row filled up to a multiple of `align`.
pub(super) fn texels(size: Size, align: usize, bytes: usize, fill: impl Fn(usize, &mut [u8]) + Sync) -> Vec<u8> {
    let stride = (size.width * bytes).next_multiple_of(align.max(1));
    let mut out = par::zeros(stride * size.height);
    par::rows(&mut out, stride.max(1), |y, row| {
        for (x, texel) in row.chunks_exact_mut(bytes).take(size.width).enumerate() {
            fill(y * size.width + x, texel);
        }
    });
    out
}

/// 32-bit floats, little-endian.
pub(super) fn numbers<const N: usize>(texel: &mut [u8], values: [f32; N]) {
    for (number, value) in texel.as_chunks_mut::<4>().0.iter_mut().zip(values) {
        *number = value.to_le_bytes();
    }
}
