//! The specification of `gather`.

use super::{FREE_COUNT, Gathered, LEAST_COUNT, LEAST_NOISE, Place, decay, lit, seen_distance};
use crate::kernels::bilinear::footprint;
use crate::kernels::guide_distance::weight;
use crate::kernels::math::luminance;
use crate::sequence::settings::Gather;
use crate::window::{Class, LightSlot, PreparedFrame, Rows, Samples, SurfacePoint};

/// Means over the window for every light of `window[centre]`, on the whole image or band.
pub fn run(window: &[&PreparedFrame], centre: usize, s: &Gather) -> Gathered {
    let here = window[centre];
    let slots = lit(window, centre);
    let size = here.features.size;
    let mut colours = Rows::new(size, 3 * slots.iter().map(|slot| slot.planes).sum::<usize>());
    let mut moments = Rows::new(size, 2 * slots.len());
    for p in 0..size.pixels() {
        let (x, y) = (p % size.width, p / size.width);
        let [surface, reflection] = [false, true].map(|reflected| trajectory(window, centre, p, reflected, s));
        for (l, slot) in slots.iter().enumerate() {
            let met = if here.features.reflects(p, slot.kind) { &reflection } else { &surface };
            let mean = mean(window, centre, p, slot, met, s);
            for (k, colour) in mean.colours.iter().enumerate() {
                for c in 0..3 {
                    colours.set(x, y, 3 * (slot.first + k) + c, colour[c]);
                }
            }
            moments.set(x, y, 2 * l, mean.spread);
            moments.set(x, y, 2 * l + 1, mean.count);
        }
    }
    Gathered { slots, colours, moments }
}

/// A pixel of a frame that shows what the pixel shows.
struct Met {
    frame: usize,
    /// Frames between.
    distance: usize,
    pixel: usize,
    weight: f32,
}

struct Mean {
    colours: Vec<[f32; 3]>,
    spread: f32,
    count: f32,
}

/// The weighted mean of a light's samples.
fn mean(window: &[&PreparedFrame], centre: usize, p: usize, slot: &LightSlot, met: &[Met], s: &Gather) -> Mean {
    let here = window[centre];
    if let Samples::Own(own) = &here.stored[slot.light] {
        return Mean { colours: own.iter().map(|plane| plane.at(p)).collect(), spread: 0.0, count: 1.0 };
    }
    let around = |frame: &PreparedFrame, pixel: usize| {
        let place = frame.means.places.get(slot.light).copied().flatten();
        place.map_or([0.0; 2], |place| frame.means.at(place, pixel))
    };
    let light_here = around(here, p);
    if light_here[1] < 0.0 {
        // Noise-free light of a frame with media, where none is lit: as it came.
        let Place::At(first) = Place::of(here, slot.light) else {
            return Mean { colours: vec![[0.0; 3]; slot.planes], spread: 0.0, count: FREE_COUNT };
        };
        let colours = (0..slot.planes).map(|k| here.samples.at(first + k, p)).collect();
        return Mean { colours, spread: 0.0, count: FREE_COUNT };
    }
    let mut weighted: Vec<(f64, Vec<[f32; 3]>)> = Vec::new();
    for m in met {
        let there = window[m.frame];
        let likeness = match Class::of(slot.kind) {
            Class::Seen => weight(seen_distance(&here.features, p, &there.features, m.pixel, s)),
            _ => 1.0,
        };
        let w = m.weight * decay(s, slot.kind).powi(m.distance as i32) * likeness;
        let w = if m.distance > 0 { w * same_light(light_here, around(there, m.pixel), s) } else { w };
        let samples = match Place::of(there, slot.light) {
            Place::Unknown => continue,
            Place::Black => vec![[0.0; 3]; slot.planes],
            Place::At(first) => (0..slot.planes).map(|k| there.samples.at(first + k, m.pixel)).collect(),
        };
        weighted.push((f64::from(w), samples));
    }
    let total: f64 = weighted.iter().map(|(w, _)| w).sum();
    let squares: f64 = weighted.iter().map(|(w, _)| w * w).sum();
    let average = |f: &dyn Fn(&[[f32; 3]]) -> f64| weighted.iter().map(|(w, s)| w * f(s)).sum::<f64>() / total;
    let mean = average(&|s| f64::from(luminance(s[0])));
    let spread = average(&|s| (f64::from(luminance(s[0])) - mean).powi(2));
    let count = total * total / squares;
    let sure = count > f64::from(LEAST_COUNT);
    Mean {
        colours: (0..slot.planes).map(|k| [0, 1, 2].map(|c| average(&|s| f64::from(s[k][c])) as f32)).collect(),
        spread: if sure { (spread * count / (count - 1.0)) as f32 } else { 0.0 },
        count: count as f32,
    }
}

/// How far a sample of another frame counts, by the means of the light around: 1 where they differ by no more than noise
/// explains. Each: mean, deviation.
fn same_light(here: [f32; 2], there: [f32; 2], s: &Gather) -> f32 {
    let variance = here[1].max(0.0).powi(2) + there[1].max(0.0).powi(2);
    let mean = (here[0] + there[0]) / 2.0;
    if here[0] == there[0] {
        return 1.0;
    }
    let noisy = variance / (variance + (s.light_noise * mean).powi(2) + LEAST_NOISE);
    let low = s.light_deviations.powi(2);
    let high = s.light_deviations_high.powi(2).max(low);
    let allowed = (low + (high - low) * noisy) * variance + (s.light_contrast * mean).powi(2);
    (allowed / (here[0] - there[0]).powi(2)).min(1.0).powi(2)
}

/// The pixel itself, and those of the other frames that show its surface, or what is reflected there.
fn trajectory(window: &[&PreparedFrame], centre: usize, p: usize, reflected: bool, s: &Gather) -> Vec<Met> {
    let mut met = vec![Met { frame: centre, distance: 0, pixel: p, weight: 1.0 }];
    for forward in [false, true].into_iter().filter(|forward| !forward || s.future) {
        follow(window, centre, p, forward, reflected, s, &mut met);
    }
    met
}

fn follow(
    window: &[&PreparedFrame],
    centre: usize,
    p: usize,
    forward: bool,
    reflected: bool,
    s: &Gather,
    met: &mut Vec<Met>,
) {
    let here = &window[centre].features;
    let (w, h) = (here.size.width, here.picture_height);
    let origin = [(p % w) as f32, (here.first_row + p / w) as f32];
    let (mut at, mut pixel, mut frame) = (origin, p, centre);
    let mut tracked = here.surface[p];
    for distance in 1..=s.frames as usize {
        let next = if forward { frame + 1 } else { frame.wrapping_sub(1) };
        let Some(&there) = window.get(next) else { return };
        let from = window[frame];
        let Some(motion) = from.features.motion.get(forward, reflected) else { return };
        let m = motion.at(pixel);
        at = [at[0] + m[0], at[1] + m[1]];
        let inside = |v: f32, extent: usize| v > -0.5 && v < extent as f32 - 0.5;
        if !(inside(at[0], w) && inside(at[1], h)) || (at[1] - origin[1]).abs() > s.travel * h as f32 {
            return; // NaN, unknown motion, is not inside
        }
        let still = (at[0] - origin[0]).abs() < s.same_noise && (at[1] - origin[1]).abs() < s.same_noise;
        let repeated = still && (from.repeats_noise || there.repeats_noise);
        let back = there.features.motion.get(!forward, reflected);
        let size = pixel_size(&tracked, there.features.pixel_angle);
        // Of the four pixels around, the nearest that shows the surface: the one with the largest bilinear share. Along the
        // trajectory of what a mirror shows, those that show the same there go first.
        let around = footprint(at[0], at[1]);
        let nearest = usize::from(at[0] - at[0].floor() > 0.5) + 2 * usize::from(at[1] - at[1].floor() > 0.5);
        let mut best: Option<((bool, f32), f32, usize)> = None;
        for (x, y, share) in (0..4).map(|i| around[i ^ nearest]) {
            let row = there.features.row_here(y);
            let (Some(row), true) = (row, share > 0.0 && share >= s.least_share && x >= 0 && x < w as isize) else {
                continue;
            };
            let q = row * w + x as usize;
            let miss = back.map(|back| back.at(q)).map(|b| (m[0] + b[0]).hypot(m[1] + b[1]));
            let trust = trust(&there.features.surface[q], &tracked, size, m[0].hypot(m[1]), miss, s);
            let alike = !reflected || weight(seen_distance(here, p, &there.features, q, s)) >= s.seen_alike;
            let rank = (alike, share);
            if let Some(trust) = trust.filter(|_| rank > best.map_or((false, 0.0), |best| best.0)) {
                best = Some((rank, trust, q));
            }
        }
        let Some((_, trust, q)) = best else { return };
        (pixel, frame) = (q, next);
        if !repeated {
            met.push(Met { frame, distance, pixel, weight: trust });
        }
        // A surface that stands keeps its first place, so that errors do not add up; one that moves is carried along.
        let now = there.features.surface[pixel];
        if !(size > 0.0 && off_plane(&now, &tracked) < s.plane_distance * size) {
            tracked = now;
        }
    }
}

/// World-space size of a pixel at the surface; 0: unknown.
fn pixel_size(surface: &SurfacePoint, pixel_angle: f32) -> f32 {
    if surface.inverse_depth > 0.0 { pixel_angle / surface.inverse_depth } else { 0.0 }
}

/// How far a pixel is believed to show the tracked surface. `miss`: pixels by which motion there and back again misses,
/// `length`: of the motion. `None`: it shows another surface.
fn trust(
    now: &SurfacePoint,
    tracked: &SurfacePoint,
    pixel_size: f32,
    length: f32,
    miss: Option<f32>,
    s: &Gather,
) -> Option<f32> {
    let is_surface = |p: &SurfacePoint| p.inverse_depth > 0.0;
    if is_surface(now) != is_surface(tracked) {
        return None;
    }
    let both_unknown = now.normal == [0.0; 3] && tracked.normal == [0.0; 3];
    let cosine: f32 = if both_unknown { 1.0 } else { (0..3).map(|c| now.normal[c] * tracked.normal[c]).sum() };
    let off = off_plane(now, tracked);
    if pixel_size > 0.0 && off < s.plane_distance * pixel_size {
        let squared: f32 = (0..3).map(|c| (now.position[c] - tracked.position[c]).powi(2)).sum();
        let near = squared.sqrt() < s.standing_reach * pixel_size.max(off);
        if near || cosine > s.plane_normal {
            return (cosine >= s.standing_normal).then_some(1.0);
        }
    }
    let allowed = s.round_trip + s.round_trip_share * length;
    if miss.is_some_and(|miss| miss.is_nan() || miss > allowed) {
        return None;
    }
    let change = if is_surface(tracked) { (now.inverse_depth / tracked.inverse_depth - 1.0).abs() } else { 0.0 };
    (change <= s.moving_depth && cosine >= s.moving_normal).then_some(s.moving_weight)
}

/// Distance from the tracked surface's tangent plane.
fn off_plane(now: &SurfacePoint, tracked: &SurfacePoint) -> f32 {
    (0..3).map(|c| (now.position[c] - tracked.position[c]) * tracked.normal[c]).sum::<f32>().abs()
}
