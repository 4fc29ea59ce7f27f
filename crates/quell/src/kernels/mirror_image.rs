//! Where the mirror image of a glossy surface was in the previous frame, and which of the four pixels there still show
//! the same reflector.

use super::math::smoothstep;
use super::reproject::{Expected, Lookup, bilinear_taps, distance_trust, lookup, on_screen};
use crate::border::Guides;
use crate::settings::{GlossyTemporal, HitFilter, REFERENCE_ROWS, Rejection, Settings, SurfaceSettings};
use glam::{Vec2, Vec3};

/// What a pixel reflects, and its distance.
#[derive(Clone, Copy, Debug)]
pub struct Reflected {
    /// The reflected point, world space; of no meaning where `distance` is not finite.
    pub point: Vec3,
    /// As filtered by [`filtered_hit`]; +inf: nothing.
    pub distance: f32,
}

impl Reflected {
    /// At pixel (x, y).
    pub fn new(now: &Guides, distance: f32, x: usize, y: usize) -> Self {
        let eye_ray = now.view.ray_direction(now.sample_position(x, y)).normalize();
        let normal = Vec3::from(now.normal.at(x, y));
        let reflected = eye_ray - 2.0 * eye_ray.dot(normal) * normal;
        Self { point: now.world(x, y) + reflected * distance, distance }
    }
}

/// How far a mirror's previous pixel is to be trusted: its reflected ray ended as far from it as the point that is reflected
/// now lies, but for `least`, the size of a pixel: neighbours see a contact that far apart. 1 where the frame before had no hit
/// distance (0).
fn same_hit(before: &Guides, settings: &Settings, hit: &Reflected, least: f32, tx: usize, ty: usize) -> f32 {
    let then = before.glossy_hit.at(tx, ty);
    if then <= 0.0 {
        return 1.0;
    }
    if !(hit.distance.is_finite() && then.is_finite()) {
        return if hit.distance.is_finite() == then.is_finite() { 1.0 } else { 0.0 };
    }
    let wanted = (hit.point - before.world(tx, ty)).length();
    let begin = (settings.glossy_temporal.hit_tolerance * wanted).max(least);
    1.0 - smoothstep(begin, settings.surface.falloff * begin, (wanted - then).abs())
}

/// Glossy light: the footprint at a virtual coordinate, each pixel tested for the same reflector, and in mirrors for the same
/// reflected point. Never by point distance: there the previous surface is another point of the mirror.
#[expect(clippy::too_many_arguments, reason = "a pixel, what it shows and what it reflects")]
pub fn reflector_lookup(
    now: &Guides,
    before: &Guides,
    settings: &Settings,
    expected: &Expected,
    coordinate: Vec2,
    hit: &Reflected,
    x: usize,
    y: usize,
) -> Lookup {
    let (surface, glossy) = (&settings.surface, &settings.glossy_temporal);
    if !on_screen(now, surface, coordinate) {
        return Lookup::default();
    }
    let (id, roughness) = (now.id.at(x, y), now.roughness.at(x, y));
    let is_mirror = roughness < glossy.mirror_roughness;
    let least = surface.pixel_distance * now.view.pixel_size(expected.view_depth);
    let plane = SurfaceSettings {
        rejection: if surface.rejection == Rejection::Off { Rejection::Off } else { Rejection::Plane },
        ..surface.clone()
    };
    let found = lookup(now, coordinate, |tx, ty| {
        if !before.is_surface(tx, ty)
            || before.id.at(tx, ty) != id
            || (before.roughness.at(tx, ty) - roughness).abs() > glossy.reflector_roughness
            || Vec3::from(before.normal.at(tx, ty)).dot(expected.normal) < glossy.reflector_normal_min
        {
            return 0.0;
        }
        let trust = distance_trust(now, before, &plane, expected, tx, ty);
        if is_mirror { trust * same_hit(before, settings, hit, least, tx, ty) } else { trust }
    });
    Lookup { spline: found.spline && roughness < glossy.spline_below(), ..found }
}

/// Normals that differ by less (length of the difference) are the same up to rounding.
pub(crate) const SAME_NORMAL: f32 = 1e-5;
/// Planes apart by less, in sizes of a pixel, are the same up to rounding.
pub(crate) const SAME_PLANE_PX: f32 = 0.01;
/// Where the jitter changed: a normal turned with the mirror where it differs by more than this many times what it varies between the four
/// pixels. Samples of both frames lie up to a pixel apart along each axis, the mean of the four up to half of one.
pub(crate) const JITTERED_TURN: f32 = 2.0;

/// The reflector at pixel (x, y) as the four pixels at its old place show it: `visible` is their lookup.
///
/// A mirror that turns hardly moves its own points, but moves its image twice as fast: motion alone cannot tell that
/// it rests. It counts as resting where its normal changed by no more than it varies between the four pixels, and its
/// plane did not shift; then `expected` stays as it is. Else it becomes their mean position and normal.
///
/// Where the jitter changed, the samples of both frames lie up to a pixel apart on the same reflector: twice as much as the normal varies
/// between all four pixels, also those without weight, is then no turn, and what it bends over a pixel no shift.
pub fn previous_reflector(
    now: &Guides,
    before: &Guides,
    expected: &Expected,
    visible: &Lookup,
    x: usize,
    y: usize,
) -> Expected {
    let taps = || visible.index.iter().zip(visible.weight).filter(|(_, w)| *w > 0.0);
    let normal_at = |index: usize| Vec3::from(before.normal.data()[index]);
    let (mut position, mut normal) = (Vec3::ZERO, Vec3::ZERO);
    for (index, weight) in taps() {
        position += weight * before.world(index % now.size.width, index / now.size.width);
        normal += weight * normal_at(*index);
    }
    let normal = normal.normalize_or_zero();
    let (spread, slack) = if now.jitter == before.jitter {
        (taps().map(|(index, _)| (normal_at(*index) - normal).length()).fold(0.0, f32::max), 0.0)
    } else {
        let around = bilinear_taps(now, expected.coordinate).into_iter().flatten();
        let same = around.filter(|t| before.is_surface(t.x, t.y) && before.id.at(t.x, t.y) == now.id.at(x, y));
        let spread = same.map(|t| (Vec3::from(before.normal.at(t.x, t.y)) - normal).length()).fold(0.0, f32::max);
        (JITTERED_TURN * spread, spread)
    };
    let turned = (Vec3::from(now.normal.at(x, y)) - normal).length() > spread + SAME_NORMAL;
    let shift = (now.world(x, y) - position).dot(normal).abs();
    let shifted = shift > (SAME_PLANE_PX + slack) * now.view.pixel_size(expected.view_depth);
    if expected.moved || turned || shifted {
        Expected { position, normal, moved: true, ..*expected }
    } else {
        *expected
    }
}

/// Glossy light: where the mirror image at pixel (x, y) was. `hit_distance` as filtered by [`filtered_hit`].
///
/// A plane mirror's image lies behind the surface, on the eye ray, as far as the hit point lies before it. Where the
/// reflector moved by itself, the hit point is mirrored in the plane that it had before.
pub fn virtual_coordinate(
    now: &Guides,
    glossy: &GlossyTemporal,
    expected: &Expected,
    hit_distance: f32,
    x: usize,
    y: usize,
) -> Option<Vec2> {
    let position = now.world(x, y);
    let eye_ray = now.view.ray_direction(now.sample_position(x, y)).normalize();
    let limit = glossy.max_hit_distance * expected.view_depth;
    let distance = if hit_distance.is_finite() { hit_distance.min(limit) } else { hit_distance };
    // Unjittered previous pixel = projection; the footprint is addressed from pixel centres, as motion is.
    let from_sample_to_centre = -now.jitter;
    let before = if !expected.moved {
        if distance.is_finite() {
            now.previous_view.pixel(position + eye_ray * distance)
        } else {
            now.previous_view.pixel_of_direction(eye_ray)
        }
    } else {
        let normal = Vec3::from(now.normal.at(x, y));
        let reflected = eye_ray - 2.0 * eye_ray.dot(normal) * normal;
        if distance.is_finite() {
            let hit = position + reflected * distance;
            let mirrored = hit - 2.0 * (hit - expected.position).dot(expected.normal) * expected.normal;
            now.previous_view.pixel(mirrored)
        } else {
            let direction = reflected - 2.0 * reflected.dot(expected.normal) * expected.normal;
            now.previous_view.pixel_of_direction(direction)
        }
    };
    before.map(|p| p + from_sample_to_centre).filter(|p| p.is_finite())
}

/// A bent reflector's image is not looked for farther than this from the surface's own place, pixels at 720 rows: one
/// step of Newton's method does not reach farther, and bumps would send it anywhere.
pub(crate) const FARTHEST_BENT_PX: f32 = 32.0;
/// Least squared sine of the angle between the two directions in which the reflected ray turns.
pub(crate) const LEAST_BENT_DETERMINANT: f32 = 1e-4;

/// Glossy light: on a curved reflector: the place in the previous image whose surface reflected the same hit point
/// into the eye. `None` where the four pixels at the surface's old place (`visible`) have one normal: plane.
///
/// At each of the four the reflected previous eye ray misses the hit point by some angle; that miss is taken as linear
/// in the place, and its zero is the answer: one step of Newton's method, which knows both curvatures, and motion of
/// reflector and camera. Where it fails (silhouettes, focus, bumps) it is the surface's own place.
///
/// Where the jitter changed, the four samples lie farther from the answer, and their slopes, of normals that change from facet to facet,
/// would have to reach farther. On a reflector at rest the step begins at the surface's own place then, where the normal of now tells the
/// miss exactly: with camera and reflector at rest there is none.
pub fn bent_coordinate(
    now: &Guides,
    before: &Guides,
    expected: &Expected,
    visible: &Lookup,
    hit_distance: f32,
    x: usize,
    y: usize,
) -> Option<Vec2> {
    let seen = |k: usize| visible.weight[k] > 0.0;
    let pixel = |k: usize| (visible.index[k] % now.size.width, visible.index[k] / now.size.width);
    let normal = |k: usize| Vec3::from(before.normal.data()[visible.index[k]]);
    let first = (0..4).find(|k| seen(*k))?;
    if (0..4).all(|k| !seen(k) || (normal(k) - normal(first)).length() <= SAME_NORMAL) {
        return None;
    }
    let surface = expected.coordinate;
    if !(0..4).all(seen) {
        return Some(surface);
    }
    let eye_ray = now.view.ray_direction(now.sample_position(x, y)).normalize();
    let own_normal = Vec3::from(now.normal.at(x, y));
    let reflected = eye_ray - 2.0 * eye_ray.dot(own_normal) * own_normal;
    let hit = now.world(x, y) + reflected * hit_distance;
    let miss = |k: usize| {
        let (px, py) = pixel(k);
        let ray = before.view.ray_direction(before.sample_position(px, py)).normalize();
        let away = ray - 2.0 * ray.dot(normal(k)) * normal(k);
        let wanted = if hit_distance.is_finite() { (hit - before.world(px, py)).normalize() } else { reflected };
        wanted - away
    };
    let [f0, f1, f2, f3] = [miss(0), miss(1), miss(2), miss(3)];
    let middle = 0.25 * ((f0 + f1) + (f2 + f3));
    let du = 0.5 * ((f1 - f0) + (f3 - f2));
    let dv = 0.5 * ((f2 - f0) + (f3 - f1));
    let (a, b, c) = (du.dot(du), du.dot(dv), dv.dot(dv));
    let rests = now.jitter != before.jitter && !expected.moved;
    let (from, miss) = if rests {
        let ray = before.view.ray_direction(surface + now.jitter).normalize();
        (surface, reflected - (ray - 2.0 * ray.dot(own_normal) * own_normal))
    } else {
        ((surface - 0.5).floor() + 1.0 + before.jitter - now.jitter, middle)
    };
    let (p, q) = (du.dot(miss), dv.dot(miss));
    let determinant = a * c - b * b;
    let step = Vec2::new(b * q - c * p, b * p - a * q) / determinant;
    // As seen from pixel centres: history is addressed as motion is.
    let place = from + step;
    let farthest = FARTHEST_BENT_PX * now.size.height as f32 / REFERENCE_ROWS;
    let good = determinant > LEAST_BENT_DETERMINANT * a * c && (place - surface).length() <= farthest;
    Some(if good { place } else { surface })
}

/// The glossy hit distance of pixel (x, y) after the 3x3 filter over the same reflector; a mirror's as it is.
pub fn filtered_hit(now: &Guides, glossy: &GlossyTemporal, x: usize, y: usize) -> f32 {
    let centre = now.glossy_hit.at(x, y);
    let filter = glossy.hit_filter;
    if filter == HitFilter::Off || now.roughness.at(x, y) < glossy.mirror_roughness {
        return centre;
    }
    let (w, h) = (now.size.width, now.size.height);
    let mut values = [0.0f32; 9];
    let mut count = 0;
    for ty in y.saturating_sub(1)..(y + 2).min(h) {
        for tx in x.saturating_sub(1)..(x + 2).min(w) {
            if now.id.at(tx, ty) == now.id.at(x, y) && now.is_surface(tx, ty) {
                values[count] = now.glossy_hit.at(tx, ty);
                count += 1;
            }
        }
    }
    let values = &mut values[..count];
    match filter {
        HitFilter::Min => values.iter().copied().fold(centre, f32::min),
        _ => {
            values.sort_unstable_by(f32::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(centre)
        }
    }
}
