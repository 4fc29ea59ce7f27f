//! The specification of the filter of young history.

use super::{
    LEAST_NEIGHBOURS, Lobe, OF_A_FRAME, counted, ends, fade, most_noise, prior, squared_contrast, step_px, stop,
};
use crate::border::Guides;
use crate::frame::{Rgb, Signal};
use crate::kernels::edge::{EdgeStops, closeness, contact_stop};
use crate::kernels::math::luminance;
use crate::par;
use crate::plane::Plane;
use crate::settings::Settings;
use glam::Vec3;

/// What a level reads.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The signal, then its passes.
    pub planes: &'a [Plane<Rgb>],
    /// Frames, at least 1.
    pub length: &'a Plane<f32>,
    /// The variance of the signal's luminance, as the level before left it; read from level 1 on.
    pub noise: Option<&'a Plane<f32>>,
}

/// What a level writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Filtered {
    /// The signal, then its passes.
    pub planes: Vec<Plane<Rgb>>,
    /// The variance of the signal's luminance; `None` where `deviations` is 0.
    pub noise: Option<Plane<f32>>,
}

/// A pixel of the 3x3 whose distance is the level's step.
#[derive(Clone, Copy, Debug)]
struct Tap {
    at: (usize, usize),
    /// By geometry alone; the centre's is 1.
    edge: f64,
    /// Its weight in the mean.
    weight: f64,
    /// What the first luminance stop took from its weight: the centre's own light stands in for it.
    refused: f64,
}

/// Runs a level on the whole image.
pub fn run(input: Input<'_>, guides: &Guides, settings: &Settings, signal: Signal, level: u32) -> Filtered {
    let size = guides.size;
    let young = &settings.young_filter;
    let end = ends(young, signal)[level as usize];
    let lobe = Lobe::new(young, guides.view.focal_px, level);
    let (stops, has_lobe) = match signal {
        Signal::Matte => (EdgeStops::matte(&settings.edge), false),
        Signal::Glossy => (EdgeStops::glossy(&settings.edge), guides.has_roughness),
    };
    let step = step_px(level) as isize;
    let frames = |(x, y): (usize, usize)| f64::from(counted(input.length.at(x, y), young.frames));
    let light = |(x, y): (usize, usize)| luminance(input.planes[0].at(x, y));
    let squared = young.deviations * young.deviations;
    let noise = input.noise.filter(|_| level > 0 && squared > 0.0);
    let contrast = squared_contrast(young, signal, level);
    let first = (level == 0 && contrast > 0.0).then_some(contrast);
    let length = |(x, y): (usize, usize)| counted(input.length.at(x, y), young.frames);
    let contact = stops.contact;
    // How close what lies (dx, dy) from a pixel is to it.
    let close = |(x, y): (usize, usize), (dx, dy): (isize, isize), normal: Vec3| {
        let (rx, ry) = (x as isize + dx, y as isize + dy);
        if !size.contains(rx, ry) {
            return 0.0;
        }
        let (centre, there) = (guides.surface(x, y), guides.surface(rx as usize, ry as usize));
        if !(centre.view_depth.is_finite() && there.view_depth.is_finite()) {
            return 0.0;
        }
        let offset = there.position - centre.position;
        closeness(offset.dot(normal), offset.length_squared())
    };
    // The contact stop along an axis.
    let along_axis = |(x, y): (usize, usize), (dx, dy): (isize, isize)| {
        let (qx, qy) = (x as isize + dx, y as isize + dy);
        if contact <= 0.0 || (dx, dy) == (0, 0) || !size.contains(qx, qy) {
            return 1.0;
        }
        let (p, q) = (guides.surface(x, y), guides.surface(qx as usize, qy as usize));
        if !q.view_depth.is_finite() {
            return 1.0;
        }
        let beyond = close((qx as usize, qy as usize), (dx, dy), p.normal);
        let nearest = close((x, y), (-dx, -dy), p.normal).max(beyond);
        contact_stop((q.position - p.position).length_squared(), nearest, 1.0 / (contact * contact))
    };
    // The taps, the centre first; none: background.
    let taps = |x: usize, y: usize| -> (f32, Vec<Tap>) {
        let p = guides.surface(x, y);
        let mut taps = vec![Tap { at: (x, y), edge: 1.0, weight: frames((x, y)), refused: 0.0 }];
        if !p.view_depth.is_finite() {
            return (0.0, taps);
        }
        let room = if has_lobe { lobe.room(p.roughness) } else { 1.0 };
        let share = fade(input.length.at(x, y), end) * room;
        let pixel_size = guides.view.pixel_size(p.view_depth);
        for (dx, dy) in (0..9).map(|k| ((k % 3 - 1) * step, (k / 3 - 1) * step)) {
            let (qx, qy) = (x as isize + dx, y as isize + dy);
            if (dx, dy) == (0, 0) || !size.contains(qx, qy) {
                continue;
            }
            let (qx, qy) = (qx as usize, qy as usize);
            let (origin, direction) = guides.ray(qx, qy);
            let q = guides.surface(qx, qy);
            let edge = stops.weight(&p, &q, origin, direction, pixel_size);
            let (own, there) = (light((x, y)), light((qx, qy)));
            let unknown = prior((own, length((x, y))), (there, length((qx, qy))));
            let known = noise.map(|noise| noise.at(x, y) + noise.at(qx, qy));
            let stopped = along_axis((x, y), (dx, 0)) * along_axis((x, y), (0, dy));
            let edge = edge
                * if young.contact_noise > 0.0 {
                    let part = 1.0 / young.contact_noise;
                    super::contact(stopped, own, there, known.unwrap_or(OF_A_FRAME * unknown), part)
                } else {
                    stopped
                };
            let like = match (known, first) {
                (Some(variance), _) if contrast > 0.0 => {
                    let of = |(x, y), light| (light, noise.map_or(0.0, |noise| noise.at(x, y)), length((x, y)));
                    let most = most_noise(of((x, y), own), of((qx, qy), there), squared, contrast);
                    stop(own, there, (squared * variance).min(most), 1.0)
                }
                (Some(variance), _) => stop(own, there, variance, squared),
                (None, Some(first)) => stop(own, there, unknown, first),
                (None, None) => 1.0,
            };
            let whole = f64::from(share * edge) * frames((qx, qy));
            let weight = whole * f64::from(like);
            let refused = if first.is_some() { whole - weight } else { 0.0 };
            taps.push(Tap { at: (qx, qy), edge: f64::from(edge), weight, refused });
        }
        if level == 0 {
            let lack = (1.0 - taps[1..].iter().map(|tap| tap.edge).sum::<f64>()).max(0.0);
            let most = (f64::from(young.isolated) - frames((x, y))).max(0.0);
            for tap in taps.iter_mut().skip(1) {
                if guides.surface(tap.at.0, tap.at.1).view_depth.is_finite() {
                    tap.weight += f64::from(share) * lack * frames(tap.at).min(most);
                }
            }
        }
        taps[0].weight += taps.iter().map(|tap| tap.refused).sum::<f64>();
        (share, taps)
    };
    let mean = |plane: &Plane<Rgb>, x: usize, y: usize| {
        let (share, taps) = taps(x, y);
        if share <= 0.0 {
            return plane.at(x, y);
        }
        let (mut total, mut sum) = (0.0, [0.0; 3]);
        for tap in taps.iter().filter(|tap| tap.weight > 0.0) {
            let q = plane.at(tap.at.0, tap.at.1);
            for c in 0..3 {
                sum[c] += tap.weight * f64::from(q[c]);
            }
            total += tap.weight;
        }
        sum.map(|s| (s / total) as f32)
    };
    let variance = |x: usize, y: usize| {
        let (_, taps) = taps(x, y);
        let own: Vec<f64> = match noise {
            Some(noise) => taps.iter().map(|tap| f64::from(noise.at(tap.at.0, tap.at.1))).collect(),
            None => {
                let lights: Vec<(f64, f64)> =
                    taps.iter().map(|tap| (tap.edge * frames(tap.at), f64::from(light(tap.at)))).collect();
                let total: f64 = lights.iter().map(|(w, _)| w).sum();
                let mean = lights.iter().map(|(w, l)| w * l).sum::<f64>() / total;
                let spread: f64 = lights.iter().map(|(w, l)| w * (l - mean).powi(2)).sum();
                let edges: f64 = taps.iter().map(|tap| tap.edge).sum();
                let n = edges * edges / taps.iter().map(|tap| tap.edge * tap.edge).sum::<f64>();
                let of_a_frame = if n >= f64::from(LEAST_NEIGHBOURS) {
                    spread / edges * n / (n - 1.0)
                } else {
                    frames((x, y)) * f64::from(light((x, y))).powi(2)
                };
                taps.iter().map(|tap| of_a_frame / frames(tap.at)).collect()
            }
        };
        let total: f64 = taps.iter().map(|tap| tap.weight).sum();
        let sum: f64 = taps.iter().zip(own).map(|(tap, v)| tap.weight * tap.weight * v).sum();
        (sum / (total * total)) as f32
    };
    Filtered {
        planes: input.planes.iter().map(|plane| par::plane(size, |x, y| mean(plane, x, y))).collect(),
        noise: (squared > 0.0).then(|| par::plane(size, variance)),
    }
}
