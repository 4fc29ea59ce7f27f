//! Frames that look like traced ones to the filters, made in no time: a camera glides along a floor and a wall, with noise
//! where indirect light would be. Guides, motion and cameras agree, so that history is found as in a real sequence.

use quell::{Camera, FrameBuf, Plane, Size};
use rayon::prelude::*;

/// Share of pixels whose path found light, as in a dim room.
const LIT: u32 = u32::MAX / 4;
/// Vertical opening angle, radians.
const FOV: f32 = 0.9;
/// Eye above the floor, wall before the eye, in scene units.
const EYE_HEIGHT: f32 = 1.5;
const WALL_DISTANCE: f32 = 8.0;
/// The camera's way to the right in one frame.
const STEP: f32 = 0.02;
/// Widths of the materials' stripes on floor and wall, as a share of the distance.
const STRIPES: f32 = 3.0;

/// A frame with every plane that the pipeline reads. Floor and wall go on for ever, and the camera glides along them: so the
/// planes stay as they are from frame to frame, and only cameras and noise change ([`renew`]).
pub fn frame(size: Size) -> FrameBuf {
    let (w, h) = (size.width as f32, size.height as f32);
    let tan = (FOV * 0.5).tan();
    let focal_px = h * 0.5 / tan;
    // View depth of what the pixel sees, and whether it is the floor.
    let depth = |y: usize| {
        let slope = (1.0 - 2.0 * (y as f32 + 0.5) / h) * tan;
        let floor = if slope < 0.0 { EYE_HEIGHT / -slope } else { f32::INFINITY };
        if floor < WALL_DISTANCE { (floor, true) } else { (WALL_DISTANCE, false) }
    };
    let stripe = |x: usize| ((x as f32 / w) * STRIPES) as u32;
    let mut frame = FrameBuf::new(size, camera(size, 0));
    frame.view_depth = Some(Plane::from_fn(size, |_, y| depth(y).0));
    frame.normal = Some(Plane::from_fn(size, |_, y| if depth(y).1 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }));
    frame.roughness = Some(Plane::from_fn(size, |x, y| if depth(y).1 { 0.25 } else { 0.4 + 0.4 * x as f32 / w }));
    frame.glossy_hit_distance = Some(Plane::from_fn(size, |x, y| 1.0 + x as f32 / w + 2.0 * y as f32 / h));
    frame.matte_hit_distance = Some(Plane::from_fn(size, |x, y| 1.5 + y as f32 / h - 0.5 * x as f32 / w));
    frame.surface_id = Some(Plane::from_fn(size, |_, y| 1 + u32::from(depth(y).1)));
    frame.motion = Some(Plane::from_fn(size, |_, y| [focal_px * STEP / depth(y).0, 0.0]));
    frame.direct = Some(Plane::from_fn(size, |x, y| [0.2 + 0.1 * x as f32 / w, 0.2, 0.2 + 0.1 * y as f32 / h]));
    frame.matte_weight = Some(Plane::from_fn(size, |x, _| [[0.6, 0.5, 0.4], [0.2, 0.3, 0.7]][stripe(x) as usize % 2]));
    frame.glossy_weight = Some(Plane::from_fn(size, |_, y| [0.04 + 0.2 * y as f32 / h; 3]));
    frame.matte = Some(Plane::filled(size, [0.0; 3]));
    frame.glossy = Some(Plane::filled(size, [0.0; 3]));
    frame
}

/// The camera at a frame.
fn camera(size: Size, index: i64) -> Camera {
    let eye = [index as f32 * STEP, 0.0, 0.0];
    Camera::perspective(eye, [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], FOV, size.width as f32 / size.height as f32)
}

/// The cameras for the frame's number; with `noise` new light, too.
pub fn renew(frame: &mut FrameBuf, noise: bool) {
    frame.camera = camera(frame.size, frame.index);
    frame.previous_camera = camera(frame.size, frame.index - 1);
    if !noise {
        return;
    }
    let number = frame.index as u32;
    for (salt, signal) in [(1u32, &mut frame.matte), (2, &mut frame.glossy)] {
        let Some(signal) = signal else { continue };
        let width = signal.size().width;
        signal.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let random = hash(x as u32 ^ hash(y as u32 ^ hash(number ^ hash(salt))));
                let light = if random < LIT { 4.0 * (hash(random) as f32 / u32::MAX as f32) } else { 0.0 };
                *pixel = [light, 0.9 * light, 0.8 * light];
            }
        });
    }
}

/// Mixes the bits of a number: xor, shift and odd multiplication, twice (lowbias32, Wellons 2018).
fn hash(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::{Denoiser, Preset, Settings};

    /// Else the bench would time disocclusion, not the steady state.
    #[test]
    fn history_is_found_nearly_everywhere() {
        let mut frame = frame(Size::new(64, 36));
        let mut denoiser = Denoiser::new(frame.size, &Settings::preset(Preset::Paper)).unwrap();
        let mut reset = 0;
        for index in 0..4 {
            frame.index = index;
            renew(&mut frame, true);
            let report = denoiser.denoise(&frame.frame(&[])).unwrap().report;
            assert!(report.sanitised.is_empty());
            reset = report.reset_pixels;
        }
        // What came in at the right edge, two pixels wide at the most.
        assert!(reset <= 2 * 36, "{reset} pixels without history");
    }
}
