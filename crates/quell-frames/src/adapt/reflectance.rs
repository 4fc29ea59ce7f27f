//! What of an albedo is the colour of surfaces.

use quell::{Plane, Rgb, Size};
use rayon::prelude::*;

/// Filters of half-float files round a little above 1.
pub(super) const ROUNDED_ONE: f32 = 1.02;
/// Share of a surface above 1 from which its albedo is a sampled weight everywhere: Mitsuba's on rough metals is 16 in the
/// middle of a ball and falls to 1e-6 at its rim. Lamps set in a ceiling are less of it.
const WEIGHTS: f32 = 0.1;
/// Or so much above 1 and so much that reflects next to nothing: such a ball with its middle half hidden.
const HIDDEN: [f32; 2] = [0.01, 0.2];
const NOTHING: f32 = 0.02;
/// Neighbours of one surface: normals differ by less, depths by this part.
const BEND: f32 = 0.25;
const STEP: f32 = 0.05;
/// From pixel to pixel a sampled weight falls at least by this factor where it is below 1.
const FALL: f32 = 0.99;
/// Pixels of such a surface that so many of their eight neighbours are part of are, too.
const ENCLOSED: usize = 5;

/// An albedo scaled to 1 at most: what lies above is noise (a sampled weight), or emission, and would come back as such.
/// Where much of a surface lies above, its albedo is 1 all over: divided by something that falls to nothing, its
/// light would come back as a blot.
pub(super) fn reflectance(
    mut albedo: Plane<Rgb>,
    normal: Option<&Plane<[f32; 3]>>,
    depth: Option<&Plane<f32>>,
) -> Plane<Rgb> {
    whiten(&mut albedo, normal, depth);
    albedo.data_mut().par_iter_mut().for_each(|value| {
        let most = value.iter().copied().fold(1.0, f32::max);
        *value = value.map(|c| c / most);
    });
    albedo
}

/// Where a surface's albedo is a sampled weight it becomes 1.
pub(super) fn whiten(albedo: &mut Plane<Rgb>, normal: Option<&Plane<[f32; 3]>>, depth: Option<&Plane<f32>>) {
    for i in weights(albedo, normal, depth) {
        if let Some(value) = albedo.data_mut().get_mut(i) {
            *value = [1.0; 3];
        }
    }
}

fn above(value: &Rgb) -> bool {
    value.iter().any(|&c| c > ROUNDED_ONE)
}

/// Pixels of surfaces whose albedo is a sampled weight; none where nothing says what one surface is.
fn weights(albedo: &Plane<Rgb>, normal: Option<&Plane<[f32; 3]>>, depth: Option<&Plane<f32>>) -> Vec<usize> {
    let Size { width, height } = albedo.size();
    let Some(normal) = normal else { return Vec::new() };
    let joined = |p: usize, q: usize| {
        let flat = match (normal.data().get(p), normal.data().get(q)) {
            (Some(a), Some(b)) => a != &[0.0; 3] && (0..3).all(|c| (a[c] - b[c]).abs() < BEND),
            _ => false,
        };
        let near = depth.is_none_or(|depth| match (depth.data().get(p), depth.data().get(q)) {
            (Some(a), Some(b)) => (a - b).abs() <= STEP * a,
            _ => false,
        });
        flat && near
    };
    let mut seen = vec![false; albedo.size().pixels()];
    let mut found = Vec::new();
    for (start, value) in albedo.data().iter().enumerate() {
        if !above(value) || seen.get(start).copied().unwrap_or(true) {
            continue;
        }
        if let Some(seen) = seen.get_mut(start) {
            *seen = true;
        }
        // The list grows while it is walked.
        let (mut surface, mut next) = (vec![start], 0);
        let (mut beyond, mut black) = (0usize, 0usize);
        while let Some(&p) = surface.get(next) {
            next += 1;
            beyond += usize::from(albedo.data().get(p).is_some_and(above));
            black += usize::from(albedo.data().get(p).is_some_and(|value| value.iter().all(|&c| c < NOTHING)));
            let (x, y) = (p % width, p / width);
            let around = [
                (x > 0).then(|| p - 1),
                (x + 1 < width).then_some(p + 1),
                (y > 0).then(|| p - width),
                (y + 1 < height).then_some(p + width),
            ];
            for q in around.into_iter().flatten().filter(|q| joined(p, *q)) {
                if let Some(seen) = seen.get_mut(q).filter(|seen| !**seen) {
                    *seen = true;
                    surface.push(q);
                }
            }
        }
        let share = |count: usize| count as f32 / surface.len() as f32;
        if share(beyond) >= WEIGHTS || (share(beyond) >= HIDDEN[0] && share(black) >= HIDDEN[1]) {
            found.extend(falling(albedo, &surface));
        }
    }
    found
}

/// The part of a surface that falls from what is above 1: a box that stands before such a ball, as far and facing the same way, is joined
/// with it, and has textures to keep.
fn falling(albedo: &Plane<Rgb>, surface: &[usize]) -> Vec<usize> {
    let Size { width, height } = albedo.size();
    let value = |p: usize| albedo.data().get(p).map_or(0.0, |value| value.iter().copied().fold(0.0, f32::max));
    let around = |p: usize| {
        let (x, y) = (p % width, p / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| v * width + u))
    };
    let mut outside = vec![true; albedo.size().pixels()];
    for &p in surface {
        if let Some(outside) = outside.get_mut(p) {
            *outside = false;
        }
    }
    // What is left of the surface is true; what is found is false.
    let mut left: Vec<bool> = outside.iter().map(|outside| !outside).collect();
    let mut take = |p: usize| left.get_mut(p).is_some_and(std::mem::take);
    let mut found: Vec<usize> = surface.iter().copied().filter(|&p| value(p) > ROUNDED_ONE && take(p)).collect();
    let mut next = 0;
    while let Some(&p) = found.get(next) {
        next += 1;
        let falls = |q: usize| value(q) <= FALL * value(p) || value(p).max(value(q)) < NOTHING;
        let further: Vec<usize> = around(p).filter(|&q| falls(q)).filter(|&q| take(q)).collect();
        found.extend(further);
    }
    let is_left = left.clone();
    let taken = |q: usize| !outside.get(q).copied().unwrap_or(true) && !is_left.get(q).copied().unwrap_or(true);
    let enclosed =
        |p: &&usize| is_left.get(**p) == Some(&true) && around(**p).filter(|&q| taken(q)).count() >= ENCLOSED;
    found.extend(surface.iter().filter(enclosed));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metal_whose_albedo_is_a_sampled_weight_is_white_and_a_ceiling_with_a_lamp_is_not() {
        let size = Size::new(64, 32);
        let ball = |x: usize, y: usize| (x as f32 - 16.0).hypot(y as f32 - 16.0);
        let albedo = Plane::from_fn(size, |x, y| match (ball(x, y), x) {
            (r, 0..32) if r < 10.0 => [16.0 * (-0.12 * r * r).exp(); 3],
            (_, 48..51) if y > 20 && y < 24 => [12.0, 9.0, 6.0],
            _ => [0.3, 0.2, 0.1],
        });
        let normal = Plane::from_fn(size, |x, y| {
            let r = ball(x, y);
            if x < 32 && r < 10.0 {
                let (a, b) = ((x as f32 - 16.0) / 12.0, (y as f32 - 16.0) / 12.0);
                [a, b, (1.0 - a * a - b * b).sqrt()]
            } else {
                [0.0, -1.0, 0.0]
            }
        });
        let depth = Plane::from_fn(size, |x, y| if x < 32 && ball(x, y) < 10.0 { 2.0 } else { 4.0 });
        let clean = reflectance(albedo.clone(), Some(&normal), Some(&depth));
        assert!(albedo.at(24, 16)[0] < 0.01);
        assert_eq!([clean.at(16, 16), clean.at(24, 16), clean.at(16, 8)], [[1.0; 3]; 3]);
        assert_eq!(clean.at(40, 10), [0.3, 0.2, 0.1]);
        assert_eq!(clean.at(49, 22), [1.0, 0.75, 0.5]);
        // With its bright middle hidden it still is one.
        let mut hidden = albedo.clone();
        for (x, y) in (0..18).flat_map(|y| (0..32).map(move |x| (x, y))) {
            if ball(x, y) < 5.0 {
                hidden.data_mut()[y * 64 + x] = [0.5; 3];
            }
        }
        let share = hidden.data().iter().filter(|v| v[0] > 1.02 && v[0] != 12.0).count() as f32 / 305.0;
        assert!(share < 0.1, "{share}");
        assert_eq!(reflectance(hidden, Some(&normal), Some(&depth)).at(24, 16), [1.0; 3]);
        // A box in front that is as far and faces the same way keeps its checks.
        let checks = |x: usize, y: usize| [if (x / 3 + y / 3).is_multiple_of(2) { 0.7 } else { 0.2 }, 0.3, 0.1];
        let mut boxed = albedo.clone();
        let mut around = normal.clone();
        for (x, y) in (14..32).flat_map(|y| (10..22).map(move |x| (x, y))) {
            boxed.data_mut()[y * 64 + x] = checks(x, y);
            around.data_mut()[y * 64 + x] = normal.at(10, 16);
        }
        let near = Plane::filled(size, 2.0);
        let kept = reflectance(boxed, Some(&around), Some(&near));
        assert_eq!([kept.at(16, 8), kept.at(16, 11)], [[1.0; 3]; 2]);
        for (x, y) in (18..30).flat_map(|y| (12..20).map(move |x| (x, y))) {
            assert_eq!(kept.at(x, y), checks(x, y), "{x} {y}");
        }
        // Without normals nothing says where the ball ends.
        assert_eq!(reflectance(albedo.clone(), None, Some(&depth)).at(24, 16), albedo.at(24, 16));
    }
}
