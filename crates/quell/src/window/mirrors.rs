//! Which pixels are mirrors or clear glass, and the colour of what they show.

use super::local::Class;
use super::packed::Packed;
use crate::frame::Rgb;
use crate::plane::Plane;
use crate::sequence::settings::Mirrors;
use crate::sequence::{Light, LightKind, SequenceFrame};

/// The colour of what is seen in mirrors and through glass; 1 at other pixels. Divided by it, a reflection is as smooth as the
/// light on the things reflected. Where a surface has a diffuse colour of its own (what multiplies matte light, or else the
/// albedo), the renderer's `seen` albedo is that colour, which the reflection does not carry.
pub(super) fn mirror_colour(frame: &SequenceFrame, s: &Mirrors) -> Option<Packed> {
    let matte = |l: &&Light| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect);
    let diffuse = frame.lights.iter().filter(matte).find_map(|l| l.weight.as_deref());
    let (seen, diffuse) = (frame.seen_albedo.as_ref()?, diffuse.or(frame.albedo.as_ref())?);
    let mut specular = vec![0.0f32; frame.size.pixels()];
    for light in frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen) {
        match &light.weight {
            Some(weight) => {
                for (specular, w) in specular.iter_mut().zip(weight.data()) {
                    *specular = w.iter().copied().fold(*specular, f32::max);
                }
            }
            None => specular.iter_mut().for_each(|colour| *colour = colour.max(s.unknown_colour)),
        }
    }
    let pixel = |((seen, diffuse), specular): ((&Rgb, &Rgb), &f32)| {
        let specular = diffuse.iter().all(|&c| c < s.specular_share * specular);
        let lit = seen.iter().all(|c| c.is_finite()) && seen.iter().any(|&c| c > 0.0);
        if specular && lit { seen.map(|c| c.max(s.least_colour)) } else { [1.0; 3] }
    };
    let mut colours: Vec<Rgb> = seen.data().iter().zip(diffuse.data()).zip(&specular).map(pixel).collect();
    divide_edges(frame, &mut colours, s);
    Some(Packed::new(frame.size, 1, |_, i| colours[i]))
}

/// A pixel at the edge of a mirror shows mirror and frame, so it has a diffuse colour; its reflection is the mirror's
/// all the same, and is divided by what its neighbours in the mirror were: else light that was divided would be mixed with
/// light that was not (a dotted white line around mirrors).
fn divide_edges(frame: &SequenceFrame, colours: &mut [Rgb], s: &Mirrors) {
    let (w, h) = (frame.size.width, frame.size.height);
    let inner = colours.to_vec();
    let weights: Vec<&Plane<Rgb>> =
        frame.lights.iter().filter(|l| Class::of(l.kind) == Class::Seen).filter_map(|l| l.weight.as_deref()).collect();
    for y in 0..h {
        for x in 0..w {
            let reflects = || weights.iter().any(|plane| plane.at(x, y).iter().any(|&c| c > s.edge_colour));
            if inner[y * w + x] != [1.0; 3] || !reflects() {
                continue;
            }
            let (mut sum, mut count) = ([0.0; 3], 0.0);
            for v in y.saturating_sub(1)..(y + 2).min(h) {
                for near in &inner[v * w + x.saturating_sub(1)..v * w + (x + 2).min(w)] {
                    if *near != [1.0; 3] {
                        count += 1.0;
                        for c in 0..3 {
                            sum[c] += near[c];
                        }
                    }
                }
            }
            if count > 0.0 {
                colours[y * w + x] = sum.map(|c| c / count);
            }
        }
    }
}
