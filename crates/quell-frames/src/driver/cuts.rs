//! Cuts, found where the guides of a frame do not fit those of the frame before.

use quell::Plane;
use quell::sequence::SequenceFrame;
use rayon::prelude::*;

/// Every so many pixels along each axis one is compared.
const STRIDE: usize = 3;
/// Depths may differ by this share: what moves towards the camera, and slopes within a pixel.
const DEPTH_SHARE: f32 = 0.1;
/// Cosine between normals (of unit length; noisy ones are shorter and let through more).
const NORMAL_COSINE: f32 = 0.75;
/// Mean difference of the colours' components.
const ALBEDO_DIFFERENCE: f32 = 0.15;
/// With fewer of its pixels found again, a frame begins another shot. A whip pan keeps more, since what leaves the picture
/// on one side is still found on the other until half of it is gone; two shots of the same room by chance less.
const FOUND_SHARE: f32 = 0.25;
/// Fewer pixels than this say nothing.
const LEAST_PIXELS: usize = 32;

/// What is kept of a frame to compare the next with.
#[derive(Clone, Debug)]
pub struct CutGuides {
    depth: Option<Plane<f32>>,
    normal: Option<Plane<[f32; 3]>>,
    albedo: Option<Plane<[f32; 3]>>,
}

impl CutGuides {
    /// The guides of a frame.
    pub fn of(frame: &SequenceFrame) -> Self {
        /// On all threads: a frame's planes are large.
        fn copied<T: Copy + Send + Sync>(plane: &Plane<T>) -> Option<Plane<T>> {
            Plane::from_vec(plane.size(), plane.data().par_iter().copied().collect()).ok()
        }
        Self {
            depth: frame.depth.as_ref().and_then(copied),
            normal: frame.normal.as_ref().and_then(copied),
            albedo: frame.albedo.as_ref().and_then(copied),
        }
    }

    /// True where `next` shows something else: its extent differs, or along its motion vectors too little of it is found
    /// again, by depth, normal and albedo as far as both frames have them. Depends on these two frames only. Without
    /// motion, or with fewer than two guides, nothing is found: then there is no history that could be wrong.
    pub fn cut_before(&self, next: &SequenceFrame) -> bool {
        let Some(motion) = &next.motion_to_previous else { return false };
        let size = next.size;
        let depths = self.depth.as_ref().zip(next.depth.as_ref());
        let normals = self.normal.as_ref().zip(next.normal.as_ref());
        let albedos = self.albedo.as_ref().zip(next.albedo.as_ref());
        let guides = [depths.is_some(), normals.is_some(), albedos.is_some()];
        if guides.iter().filter(|there| **there).count() < 2 {
            return false;
        }
        let extents = [depths.map(|d| d.0.size()), normals.map(|n| n.0.size()), albedos.map(|a| a.0.size())];
        if extents.into_iter().flatten().any(|extent| extent != size) {
            return true;
        }
        let fits = |p: usize, q: usize| {
            let depth = depths.is_none_or(|(a, b)| match (a.data().get(q), b.data().get(p)) {
                (Some(a), Some(b)) => a == b || (a - b).abs() <= DEPTH_SHARE * a.abs().max(b.abs()),
                _ => false,
            });
            let normal = normals.is_none_or(|(a, b)| match (a.data().get(q), b.data().get(p)) {
                (Some(a), Some(b)) => {
                    let dot = |x: &[f32; 3], y: &[f32; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
                    let lengths = (dot(a, a) * dot(b, b)).sqrt();
                    // Two backgrounds fit each other.
                    dot(a, b) >= NORMAL_COSINE * lengths && (lengths > 0.0 || a == b)
                }
                _ => false,
            });
            let albedo = albedos.is_none_or(|(a, b)| match (a.data().get(q), b.data().get(p)) {
                (Some(a), Some(b)) => (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f32>() <= 3.0 * ALBEDO_DIFFERENCE,
                _ => false,
            });
            depth && normal && albedo
        };
        let (width, height) = (size.width, size.height);
        // Of a row of pixels how many were compared, and found again.
        let row = |y: usize| {
            let (mut compared, mut found) = (0usize, 0usize);
            for x in (0..width).step_by(STRIDE) {
                let p = y * width + x;
                // Background has no motion of its own and looks alike in every shot.
                if depths.is_some_and(|(_, b)| b.data().get(p).is_none_or(|d| !d.is_finite())) {
                    continue;
                }
                let Some([dx, dy]) = motion.data().get(p).copied() else { continue };
                if !(dx.is_finite() && dy.is_finite()) {
                    continue;
                }
                compared += 1;
                let (u, v) = ((x as f32 + dx).round(), (y as f32 + dy).round());
                let inside = u >= 0.0 && v >= 0.0 && u < width as f32 && v < height as f32;
                if !inside {
                    continue;
                }
                let (u, v) = (u as usize, v as usize);
                // Guides are means over a pixel: the neighbours may fit where it does not.
                let rows = v.saturating_sub(1)..(v + 2).min(height);
                found += usize::from(
                    rows.clone().any(|v| (u.saturating_sub(1)..(u + 2).min(width)).any(|u| fits(p, v * width + u))),
                );
            }
            (compared, found)
        };
        let rows = (0..height).into_par_iter().step_by(STRIDE).map(row);
        let (compared, found) = rows.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        compared >= LEAST_PIXELS && (found as f32) < FOUND_SHARE * compared as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Size;

    /// A wall of stripes whose depth, normal and colour depend on `shot`, moved by `at` pixels.
    fn frame(shot: u32, at: i64) -> SequenceFrame {
        let size = Size::new(96, 54);
        let mut frame = SequenceFrame::new(at, size);
        let pick = |x: usize, y: usize| {
            let stripe = (x as i64 + 4 * at).div_euclid(7) as u32 ^ (y as u32 / 9);
            stripe.wrapping_mul(2_654_435_761).wrapping_add(shot.wrapping_mul(0x9e37_79b9)) >> 8
        };
        let plane = |f: &dyn Fn(u32) -> f32| {
            let mut plane = Plane::filled(size, 0.0);
            for (i, v) in plane.data_mut().iter_mut().enumerate() {
                *v = f(pick(i % 96, i / 96));
            }
            plane
        };
        frame.depth = Some(plane(&|r| 2.0 + (r % 16) as f32));
        let z = plane(&|r| f32::from(u8::from(r & 16 == 0)));
        let mut normal = Plane::filled(size, [0.0; 3]);
        for (n, z) in normal.data_mut().iter_mut().zip(z.data()) {
            *n = [0.0, 1.0 - z, *z];
        }
        frame.normal = Some(normal);
        frame.motion_to_previous = Some(Plane::filled(size, [4.0, 0.0]));
        frame
    }

    #[test]
    fn a_moving_picture_is_no_cut_and_another_one_is() {
        let before = CutGuides::of(&frame(1, 1));
        assert!(!before.cut_before(&frame(1, 2)));
        assert!(before.cut_before(&frame(2, 2)));
        // Wrong vectors look like a cut here: `quell doctor` warns of it, and history would be wrong anyway.
        let mut wrong = frame(1, 2);
        wrong.motion_to_previous = Some(Plane::filled(wrong.size, [-17.0, 5.0]));
        assert!(before.cut_before(&wrong));
    }

    #[test]
    fn without_guides_nothing_is_found() {
        let before = CutGuides::of(&frame(1, 1));
        let mut next = frame(2, 2);
        next.motion_to_previous = None;
        assert!(!before.cut_before(&next));
        let mut next = frame(2, 2);
        next.normal = None;
        assert!(!before.cut_before(&next));
        let mut background = frame(2, 2);
        background.depth = Some(Plane::filled(background.size, f32::INFINITY));
        assert!(!before.cut_before(&background));
    }

    #[test]
    fn another_extent_is_a_cut() {
        let before = CutGuides::of(&frame(1, 1));
        let mut next = SequenceFrame::new(2, Size::new(10, 10));
        next.depth = Some(Plane::filled(next.size, 1.0));
        next.normal = Some(Plane::filled(next.size, [0.0, 0.0, 1.0]));
        next.motion_to_previous = Some(Plane::filled(next.size, [0.0; 2]));
        assert!(before.cut_before(&next));
    }
}
