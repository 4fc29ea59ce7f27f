//! Which pixels are mirrors or clear glass, and the colour of what they show.

use super::background;
use super::local::Class;
use super::packed::half_or_full;
use super::sparse::Sparse;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::sequence::settings::Mirrors;
use crate::sequence::{Light, LightKind, SequenceFrame};

/// Colour of what is no mirror.
pub(super) const WHITE: Rgb = [1.0; 3];
/// Stands for the colour of a lamp that a mirror shows until [`colour_lamps`] finds one; no colour that is kept is NaN.
const LAMP: Rgb = [f32::NAN; 3];
/// Pixels from the edge of a lamp seen in a mirror to its middle, at most.
const LARGEST_LAMP: usize = 64;

/// The colour of what is seen in mirrors and through glass; 1 at other pixels. Divided by it, a reflection is as smooth as the
/// light on the things reflected. Where a surface has a diffuse colour of its own (what multiplies matte light, or else the
/// albedo), the renderer's `seen` albedo is that colour, which the reflection does not carry. Where the background is seen, it is
/// smoothed within its noise (`background.rs`).
pub(super) fn mirror_colour(frame: &SequenceFrame, s: &Mirrors) -> Option<Sparse<Rgb>> {
    let matte = |l: &&Light| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect);
    let diffuse = frame.lights.iter().filter(matte).find_map(|l| l.weight.as_deref());
    let (seen, diffuse) = (frame.seen_albedo.as_ref()?, diffuse.or(frame.albedo.as_ref())?);
    let mirrors: Vec<_> = frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen).collect();
    let specular = |p: usize| {
        mirrors.iter().fold(0.0f32, |most, light| match &light.weight {
            Some(weight) => weight.data()[p].iter().copied().fold(most, f32::max),
            None => most.max(s.unknown_colour),
        })
    };
    let w = frame.size.width;
    let colour = |x: usize, y: usize| {
        let (specular, seen) = (specular(y * w + x), seen.at(x, y));
        let is_specular = diffuse.at(x, y).iter().all(|&c| c < s.specular_share * specular);
        let lit = seen.iter().any(|&c| c != 0.0);
        if !(is_specular && lit) {
            return WHITE;
        }
        if !seen.iter().all(|&c| (0.0..=s.brightest_colour).contains(&c)) {
            return LAMP;
        }
        seen.map(|c| c.max(s.least_colour))
    };
    let mut colours = par::plane(frame.size, colour).into_vec();
    let mut lamps = Vec::new();
    for (p, colour) in colours.iter_mut().enumerate().filter(|(_, colour)| colour[0].is_nan()) {
        lamps.push(p);
        *colour = WHITE;
    }
    colour_lamps(frame.size, &mut colours, lamps);
    if let Some(normal) = &frame.seen_normal {
        background::smooth(frame.size, &mut colours, normal, s);
    }
    divide_edges(frame, &mut colours, s);
    let kept = |i: usize| if colours[i] == WHITE { WHITE } else { half_or_full(colours[i]) };
    Some(Sparse::new(colours.len(), kept, |_| WHITE))
}

/// Where a mirror shows the sun, `seen` is its radiance, thousands or infinity. It takes the colour of what is beside it
/// in the mirror: light divided by a radiance would be next to nothing, and what it is mixed with would come back thousands of times brighter.
fn colour_lamps(size: Size, colours: &mut [Rgb], mut lamps: Vec<usize>) {
    for _ in 0..LARGEST_LAMP {
        let found: Vec<(usize, Option<Rgb>)> =
            lamps.iter().map(|&p| (p, mean_around(size, colours, p % size.width, p / size.width))).collect();
        lamps = found.iter().filter(|(_, colour)| colour.is_none()).map(|(p, _)| *p).collect();
        let mut changed = false;
        for (p, colour) in found {
            if let Some(colour) = colour {
                (colours[p], changed) = (colour, true);
            }
        }
        if !changed {
            break;
        }
    }
}

/// The mean colour of the mirrors within 3x3.
fn mean_around(size: Size, colours: &[Rgb], x: usize, y: usize) -> Option<Rgb> {
    let (w, h) = (size.width, size.height);
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for v in y.saturating_sub(1)..(y + 2).min(h) {
        for near in &colours[v * w + x.saturating_sub(1)..v * w + (x + 2).min(w)] {
            if *near != WHITE {
                count += 1.0;
                for c in 0..3 {
                    sum[c] += near[c];
                }
            }
        }
    }
    (count > 0.0).then(|| sum.map(|c| c / count))
}

/// A pixel at the edge of a mirror shows mirror and frame, so it has a diffuse colour; its reflection is the mirror's
/// all the same, and is divided by what its neighbours in the mirror were: else light that was divided would be mixed with
/// light that was not (a dotted white line around mirrors).
fn divide_edges(frame: &SequenceFrame, colours: &mut [Rgb], s: &Mirrors) {
    let w = frame.size.width;
    let inner = par::map(colours, |colour| *colour);
    let weights: Vec<&Plane<Rgb>> =
        frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen).filter_map(|l| l.weight.as_deref()).collect();
    par::rows(colours, w, |y, row| {
        for (x, colour) in row.iter_mut().enumerate() {
            let reflects = || weights.iter().any(|plane| plane.at(x, y).iter().any(|&c| c > s.edge_colour));
            if inner[y * w + x] != WHITE || !reflects() {
                continue;
            }
            if let Some(mean) = mean_around(frame.size, &inner, x, y) {
                *colour = mean;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_in_a_mirror_has_the_colour_of_what_is_beside_it() {
        let size = Size::new(9, 7);
        let mut frame = SequenceFrame::new(0, size);
        let sun = |x: usize, y: usize| (3..6).contains(&x) && (2..5).contains(&y);
        frame.seen_albedo = Some(Plane::from_fn(size, |x, y| match (x, y) {
            (4, 3) => [f32::INFINITY; 3],
            _ if sun(x, y) => [9000.0, 20.0, 0.5],
            _ => [0.05, 0.1, 0.2],
        }));
        frame.albedo = Some(Plane::filled(size, [0.0; 3]));
        frame.lights.push(Light::new("glossy", LightKind::GlossyDirect, Plane::filled(size, [1.0; 3])));
        let found = mirror_colour(&frame, &Mirrors::default()).unwrap();
        for i in 0..size.pixels() {
            let colour = found.get(i).unwrap();
            assert!((0..3).all(|c| (colour[c] - [0.05, 0.1, 0.2][c]).abs() < 1e-3), "{i}: {colour:?}");
        }
        // A mirror that shows nothing but a lamp is divided by nothing.
        frame.seen_albedo = Some(Plane::filled(size, [300.0; 3]));
        assert_eq!(mirror_colour(&frame, &Mirrors::default()).unwrap().get(20), None);
    }
}
