//! Single pixels of rare paths: brighter than all around them in space and time.

use super::{BlendFrame, FRAMES, follow};
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::sequence::settings::{Gather, Stabilise};

/// What counts as an outlier.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    /// How many times brighter than all around it.
    times: f32,
    /// How far that is noise, 0..1: where noise is weak, what is brighter is a detail.
    share: f32,
}

impl Limits {
    /// `noise`: squared, relative to the brightness, summed over the channels.
    #[inline(always)]
    pub(crate) fn new(s: &Stabilise, noise: f32) -> Self {
        let half = 3.0 * s.outlier_noise * s.outlier_noise;
        Self { times: s.outlier, share: if noise > 0.0 { noise / (noise + half) } else { 0.0 } }
    }
}

/// How far a pixel is believed, 0..1: 1 up to [`Limits::times`] the brightest of the eight around it and of 3x3 pixels where motion
/// leads in other frames; least, 1 - [`Limits::share`], from twice that. Where no other frame shows it, 1: a glint is not known from
/// an outlier.
///
/// `of`: which picture of a frame is looked at.
#[inline(always)]
pub(crate) fn believed<'a>(
    (window, centre): (&'a [BlendFrame<'a>], usize),
    of: fn(&'a BlendFrame<'a>) -> &'a Plane<Rgb>,
    (x, y): (usize, usize),
    gather: &Gather,
    limits: Limits,
) -> f32 {
    let plane = of(&window[centre]);
    let (w, own) = (plane.size().width, sum(plane.at(x, y)));
    // Most pixels are not much brighter than those beside them.
    let left = if x > 0 { x - 1 } else { 1.min(w - 1) };
    let right = if x + 1 < w { x + 1 } else { left };
    let beside = sum(plane.at(left, y)).max(sum(plane.at(right, y)));
    if own > limits.times * beside { compared((window, centre), of, (x, y), gather, limits) } else { 1.0 }
}

// Not inlined: it is rare, and would keep the loops around it from wide vectors.
#[inline(never)]
fn compared<'a>(
    (window, centre): (&'a [BlendFrame<'a>], usize),
    of: fn(&'a BlendFrame<'a>) -> &'a Plane<Rgb>,
    (x, y): (usize, usize),
    gather: &Gather,
    limits: Limits,
) -> f32 {
    let Limits { times, share } = limits;
    let here = &window[centre];
    let w = here.features.size.width;
    let p = y * w + x;
    let own = sum(of(here).at(x, y));
    let mut most = brightest(of(here), (x, y), false);
    let reflected = here.features.is_mirror(p);
    let origin = [x as f32, (here.features.first_row + y) as f32];
    let farthest = gather.travel * here.features.picture_height as f32;
    let mut seen = false;
    for forward in [false, true].into_iter().filter(|forward| !forward || gather.future) {
        let (mut at, mut q, mut frame) = (origin, p, centre);
        for _ in 0..FRAMES {
            if own <= times * most {
                return 1.0;
            }
            let next = if forward { frame + 1 } else { frame.wrapping_sub(1) };
            let Some(there) = window.get(next) else { break };
            let found = follow(window[frame].features, there.features, forward, reflected, (&mut at, q));
            let Some(found) = found.filter(|_| (at[1] - origin[1]).abs() <= farthest) else { break };
            (q, frame, seen) = (found, next, true);
            most = most.max(brightest(of(there), (q % w, q / w), true));
        }
    }
    if !seen || own <= times * most {
        return 1.0;
    }
    // Where all around is black the quotient is infinite, and the least comes out.
    1.0 - share * (own / (times * most) - 1.0).min(1.0)
}

fn sum(colour: Rgb) -> f32 {
    colour[0] + colour[1] + colour[2]
}

/// The largest sum in 3x3, with the pixel or without; at least 0.
fn brightest(plane: &Plane<Rgb>, (x, y): (usize, usize), itself: bool) -> f32 {
    let (w, h) = (plane.size().width, plane.size().height);
    let mut most = 0.0f32;
    for v in y.saturating_sub(1)..(y + 2).min(h) {
        for u in x.saturating_sub(1)..(x + 2).min(w) {
            if itself || (u, v) != (x, y) {
                most = most.max(sum(plane.at(u, v)));
            }
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Size;
    use crate::sequence::{SequenceFrame, SequenceSettings};
    use crate::window::Features;

    const SIZE: Size = Size::new(7, 5);
    const LIMITS: Limits = Limits { times: 1.5, share: 0.8 };

    /// What is believed of the pixel at `at`, of 3 frames of grey with `bright` pixels: frame, place, value.
    fn of(at: (usize, usize), bright: &[(usize, (usize, usize), f32)], moves: Option<[f32; 2]>) -> f32 {
        let mut planes = vec![Plane::filled(SIZE, [0.1; 3]); 3];
        for (frame, (x, y), value) in bright {
            planes[*frame].data_mut()[y * SIZE.width + x] = [*value; 3];
        }
        let mut frame = SequenceFrame::new(0, SIZE);
        frame.motion_to_previous = moves.map(|m| Plane::filled(SIZE, m));
        frame.motion_to_next = moves.map(|m| Plane::filled(SIZE, m.map(|v| -v)));
        let settings = SequenceSettings::default();
        let features = Features::new(&frame, &settings);
        let frames: Vec<_> = planes
            .iter()
            .map(|plane| BlendFrame { features: &features, input: plane, picture: plane, alpha: None, along: None })
            .collect();
        believed((&frames, 1), |frame| frame.input, at, &settings.gather, LIMITS)
    }

    #[test]
    fn a_pixel_that_is_bright_alone_is_not_believed() {
        let still = Some([0.0; 2]);
        for at in [(3, 2), (0, 0), (6, 4)] {
            assert_eq!(of(at, &[(1, at, 0.1)], still), 1.0);
            assert_eq!(of(at, &[(1, at, 0.14)], still), 1.0);
            assert!((of(at, &[(1, at, 0.225)], still) - 0.6).abs() < 1e-3, "half way");
            assert!((of(at, &[(1, at, 50.0)], still) - 0.2).abs() < 1e-6);
        }
    }

    #[test]
    fn what_is_bright_beside_it_or_in_another_frame_is_a_detail() {
        let (at, still) = ((3, 2), Some([0.0; 2]));
        assert_eq!(of(at, &[(1, at, 50.0), (1, (4, 3), 40.0)], still), 1.0);
        assert_eq!(of(at, &[(1, at, 50.0), (2, at, 40.0)], still), 1.0);
        // What moves by two pixels is found there, but not without motion.
        let moved = [(1, at, 50.0), (0, (1, 2), 40.0)];
        assert_eq!(of(at, &moved, Some([-2.0, 0.0])), 1.0);
        assert!(of(at, &moved, still) < 0.5);
        // Nothing is known of a pixel that no other frame shows.
        assert_eq!(of(at, &[(1, at, 50.0)], None), 1.0);
        assert_eq!(of(at, &[(1, at, 50.0)], Some([30.0, 0.0])), 1.0);
    }

    #[test]
    fn weak_noise_makes_no_outlier() {
        let settings = Stabilise::default();
        let share = |deviation: f32| Limits::new(&settings, 3.0 * deviation * deviation).share;
        assert_eq!(share(0.0), 0.0);
        assert!((share(settings.outlier_noise) - 0.5).abs() < 1e-6);
        assert!(share(0.01) < 0.001 && share(4.0) > 0.98);
    }
}
