//! Where a surface was in the previous frame, and which of the four pixels there still show it. Its mirror image:
//! `mirror_image.rs`.

use super::bilinear::footprint;
use super::math::smoothstep;
use crate::border::Guides;
use crate::settings::{Rejection, SurfaceSettings};
use glam::{Vec2, Vec3};

/// The surface that history must show: where it was, as far as motion shows.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Its place in the previous image, continuous pixel coordinate.
    pub(crate) coordinate: Vec2,
    /// A point of it, world space, at the previous frame's time.
    pub(crate) position: Vec3,
    /// Its normal at that time.
    pub(crate) normal: Vec3,
    /// View depth now: the scale of distances.
    pub view_depth: f32,
    /// It moved by itself.
    pub moved: bool,
}

impl Expected {
    /// Its place in the previous image: continuous pixel coordinate, x right, y down.
    pub fn coordinate(&self) -> [f32; 2] {
        self.coordinate.to_array()
    }
}

/// Up to four pixels of the previous image with weights that add up to 1, and how far they are to be trusted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lookup {
    /// Linear pixel indices, row-major.
    pub index: [usize; 4],
    /// Weights; 0 for pixels that show something else.
    pub weight: [f32; 4],
    /// rho, 0..1; 0: there is no history.
    pub trust: f32,
    /// Colours are fetched from 4x4 pixels by Catmull and Rom's spline: all four show what is looked for.
    pub spline: bool,
    /// The part of the bilinear footprint that shows what is looked for, 0..1.
    pub footprint: f32,
}

/// Weights under this share of the bilinear footprint are no evidence: rounding of a coordinate.
pub(crate) const LEAST_FOOTPRINT: f32 = 1e-3;

/// Matte light: the surface at pixel (x, y), where it was. `None`: background, unknown motion, off screen, or
/// a moving surface of which the previous image has no trace.
pub fn expected_surface(
    now: &Guides,
    before: &Guides,
    settings: &SurfaceSettings,
    x: usize,
    y: usize,
) -> Option<Expected> {
    let view_depth = now.depth.at(x, y);
    let motion = Vec2::from(now.motion.at(x, y));
    if !view_depth.is_finite() || motion.is_nan() {
        return None;
    }
    let coordinate = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + motion;
    if !on_screen(now, settings, coordinate) {
        return None;
    }
    let position = now.world(x, y);
    let by_camera = now.previous_view.pixel(position).map(|p| p - now.sample_position(x, y));
    let moved = by_camera.is_none_or(|m| (m - motion).length() > settings.static_motion);
    if !moved {
        return Some(Expected { coordinate, position, normal: Vec3::from(now.normal.at(x, y)), view_depth, moved });
    }
    // Motion gives the pixel but not the depth: the nearest previous pixel of the same object anchors the plane.
    let nearest = bilinear_taps(now, coordinate)
        .into_iter()
        .flatten()
        .filter(|t| before.is_surface(t.x, t.y) && before.id.at(t.x, t.y) == now.id.at(x, y))
        .max_by(|a, b| a.weight.total_cmp(&b.weight))?;
    let anchor = before.world(nearest.x, nearest.y);
    let travelled = (now.previous_view.view_depth(anchor) - now.previous_view.view_depth(position)).abs();
    if travelled > settings.moving_depth * view_depth {
        return None;
    }
    let normal = Vec3::from(before.normal.at(nearest.x, nearest.y));
    Some(Expected { coordinate, position: anchor, normal, view_depth, moved })
}

/// The bilinear footprint at the expected place, each of its four pixels tested singly.
pub fn surface_lookup(
    now: &Guides,
    before: &Guides,
    settings: &SurfaceSettings,
    expected: &Expected,
    x: usize,
    y: usize,
) -> Lookup {
    let id = now.id.at(x, y);
    let found = lookup(now, expected.coordinate, |tx, ty| {
        if !before.is_surface(tx, ty) || before.id.at(tx, ty) != id {
            return 0.0;
        }
        if Vec3::from(before.normal.at(tx, ty)).dot(expected.normal) < settings.normal_min {
            return 0.0;
        }
        distance_trust(now, before, settings, expected, tx, ty)
    });
    let kept = if found.trust > 0.0 { kept_trust(found.footprint, settings.lost_footprint) } else { 0.0 };
    Lookup { spline: false, trust: found.trust * kept, ..found }
}

/// What is left of trust where the part `footprint`, above 0, of the bilinear footprint shows the surface; `lost`: the parameter. The
/// mean over that part lies beside the place: where light falls off towards an edge, history would creep in from the side.
#[inline(always)]
pub(crate) fn kept_trust(footprint: f32, lost: f32) -> f32 {
    footprint / (footprint + lost * (1.0 - footprint))
}

#[derive(Clone, Copy)]
pub(super) struct BilinearTap {
    pub(super) x: usize,
    pub(super) y: usize,
    weight: f32,
}

/// The four pixels around a place of the previous image, of those that there are.
pub(super) fn bilinear_taps(now: &Guides, coordinate: Vec2) -> [Option<BilinearTap>; 4] {
    footprint(coordinate.x - 0.5, coordinate.y - 0.5)
        .map(|(x, y, weight)| now.size.contains(x, y).then_some(BilinearTap { x: x as usize, y: y as usize, weight }))
}

/// The footprint's pixels, trusted as `trust_of` says; [`Lookup::spline`] as far as the footprint allows it.
pub(super) fn lookup(now: &Guides, coordinate: Vec2, trust_of: impl Fn(usize, usize) -> f32) -> Lookup {
    let mut found = Lookup::default();
    let (mut total, mut trusted) = (0.0, 0.0);
    let mut whole = true;
    for (k, tap) in bilinear_taps(now, coordinate).into_iter().enumerate() {
        let Some(tap) = tap else {
            whole = false;
            continue;
        };
        let trust = trust_of(tap.x, tap.y);
        whole &= trust > 0.0 || tap.weight <= 0.0;
        if trust > 0.0 {
            found.index[k] = tap.y * now.size.width + tap.x;
            found.weight[k] = tap.weight;
            total += tap.weight;
            trusted += tap.weight * trust;
        }
    }
    if total < LEAST_FOOTPRINT {
        return Lookup::default();
    }
    for w in &mut found.weight {
        *w /= total;
    }
    found.trust = trusted / total;
    found.footprint = total;
    found.spline = whole;
    found
}

pub(super) fn distance_trust(
    now: &Guides,
    before: &Guides,
    settings: &SurfaceSettings,
    expected: &Expected,
    tx: usize,
    ty: usize,
) -> f32 {
    let offset = before.world(tx, ty) - expected.position;
    let (distance, begin) = match settings.rejection {
        Rejection::Off => return 1.0,
        Rejection::Plane => (
            offset.dot(expected.normal).abs(),
            (settings.plane_distance * expected.view_depth)
                .max(settings.pixel_distance * now.view.pixel_size(expected.view_depth)),
        ),
        Rejection::Point => (offset.length(), settings.point_distance * expected.view_depth),
    };
    1.0 - smoothstep(begin, settings.falloff * begin, distance)
}

pub(super) fn on_screen(now: &Guides, settings: &SurfaceSettings, coordinate: Vec2) -> bool {
    let guard = settings.guard_band;
    coordinate.x >= guard
        && coordinate.y >= guard
        && coordinate.x <= now.size.width as f32 - guard
        && coordinate.y <= now.size.height as f32 - guard
}
