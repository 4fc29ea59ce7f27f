//! The specification of `stabilise`.

use super::{
    BRIGHTNESS, INPUT, LEAST_NOISE, LEAST_OWN, LIGHT, Likeness, POOL, SIGNATURE, Shown, StabiliseFrame, TAP_RADIUS,
    WIDE, albedo_around, bandwidths, log_brightness, may_miss, mixed, normal_at, own_weight, seen_difference,
    signature_at, tap_weight,
};
use crate::frame::Rgb;
use crate::kernels::guide_distance::weight;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Gather, Stabilise};
use crate::stages::blend::{self, BlendFrame};
use crate::window::{Features, Rows};

/// Runs the stage for `window[centre]` on the whole image. Coverage is averaged where all frames have it, stays where this
/// one alone has it, and is `None` where it has none.
pub fn run(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    gather: &Gather,
    s: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    if s.net {
        return joint(window, centre, gather, s);
    }
    let here = &window[centre];
    let (w, h) = (here.picture.size().width, here.picture.size().height);
    let (mut picture, mut alpha) = (here.picture.clone(), here.alpha.cloned());
    let every_alpha = window.iter().all(|frame| frame.alpha.is_some());
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        let visits = visits(window, centre, (x, y), 0.0, gather, s);
        let mut total = 1.0;
        let mut colour = here.picture.at(x, y);
        let mut coverage = here.alpha.map_or(0.0, |a| a.at(x, y));
        for visit in &visits {
            let other = &window[visit.frame];
            for (c, sum) in colour.iter_mut().enumerate() {
                let fetched = cubic(other.features, visit.at, |i| other.picture.data()[i][c]);
                let (low, high) = range(w, h, (x, y), |qx, qy| here.picture.at(qx, qy)[c]);
                *sum += visit.weight * fetched.max(low).min(high);
            }
            if let (true, Some(own), Some(alpha)) = (every_alpha, here.alpha, other.alpha) {
                let fetched = cubic(other.features, visit.at, |i| alpha.data()[i]);
                let (low, high) = range(w, h, (x, y), |qx, qy| own.at(qx, qy));
                coverage += visit.weight * fetched.max(low).min(high);
            }
            total += visit.weight;
        }
        picture.data_mut()[y * w + x] = colour.map(|c| c / total);
        if let Some(alpha) = alpha.as_mut().filter(|_| every_alpha) {
            alpha.data_mut()[y * w + x] = coverage / total;
        }
    }
    (picture, alpha)
}

/// The net's form: every pixel averaged with those of its own frame and of others whose signatures are near.
fn joint(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    gather: &Gather,
    s: &Stabilise,
) -> (Plane<Rgb>, Option<Plane<f32>>) {
    let here = &window[centre];
    let (w, h) = (here.picture.size().width, here.picture.size().height);
    let frames: Vec<_> = window.iter().map(BlendFrame::from).collect();
    let (pooled, scale) = blend::reference::pooled(&frames, centre, here.picture, (gather, s));
    let every_alpha = window.iter().all(|frame| frame.alpha.is_some());
    let (mut picture, mut alpha) = (here.picture.clone(), here.alpha.cloned());
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        let statistics = (pooled.at(x, y), 1.0 / scale.at(x, y) as f32);
        let mut bandwidths = bandwidths(&statistics, s, here.features.camera_motion);
        let believed = own_weight((&frames, centre), (x, y), (bandwidths.raw, statistics.0.noise(1)), (gather, s));
        bandwidths.parts.iter_mut().flat_map(|parts| &mut parts[..LIGHT]).for_each(|b| *b *= believed);
        let mut own = here.signature.map_or([0.0; SIGNATURE], |signature| signature_at(signature, x, y));
        let judge = window_mean(here.input.size(), WIDE, (x, y), |q| here.input.data()[q]);
        own[INPUT].copy_from_slice(&judge.map(|v| v as f32));
        // (frame, place in it where the pixel is shown, frames between)
        let mut places = vec![(centre, [x as f32, (here.features.first_row + y) as f32], 0)];
        let visits = visits(window, centre, (x, y), statistics.0.noise(1), gather, s);
        places.extend(visits.iter().map(|v| (v.frame, v.at, v.frame.abs_diff(centre))));
        let mut shown = Shown::new(own[BRIGHTNESS]);
        for (frame, at, ..) in &places {
            let (other, column, row) = (&window[*frame], at[0].round() as usize, at[1].round() as isize);
            if let Some(row) = other.features.row_here(row) {
                shown.add(other.input.at(column, row));
            }
        }
        let shown = shown.bounds(s, here.features.camera_motion);
        let (mut sum, mut total) = ([0.0f64; 4], 0.0f64);
        for (frame, at, away) in places {
            let other = &window[frame];
            let Some(signatures) = other.signature else { continue };
            let (column, row) = (at[0].round() as isize, at[1].round() as isize);
            let r = TAP_RADIUS as isize;
            for (qx, qy) in (row - r..=row + r).flat_map(|qy| (column - r..=column + r).map(move |qx| (qx, qy))) {
                let Some(here_row) = other.features.row_here(qy).filter(|_| qx >= 0 && qx < w as isize) else {
                    continue;
                };
                let q = here_row * w + qx as usize;
                let offset = (qx as f32 - at[0]).powi(2) + (qy as f32 - at[1]).powi(2);
                let itself = frame == centre && q == y * w + x;
                let tap = (&signature_at(signatures, qx as usize, here_row), offset, away);
                let weight = if itself {
                    f64::from(believed.max(LEAST_OWN))
                } else {
                    f64::from(tap_weight(&bandwidths, &own, &shown, tap))
                };
                let colour = mixed(other.picture.data()[q], other.input.data()[q], bandwidths.raw);
                for c in 0..3 {
                    sum[c] += weight * f64::from(colour[c]);
                }
                sum[3] += weight * other.alpha.map_or(0.0, |alpha| f64::from(alpha.data()[q]));
                total += weight;
            }
        }
        picture.data_mut()[y * w + x] = [0, 1, 2].map(|c| (sum[c] / total) as f32);
        if let Some(alpha) = alpha.as_mut().filter(|_| every_alpha) {
            alpha.data_mut()[y * w + x] = (sum[3] / total) as f32;
        }
    }
    (picture, alpha)
}

/// What the net's form compares pixels by: `SIGNATURE` channels.
pub fn signature(features: &Features, picture: &Plane<Rgb>) -> Rows {
    let size = picture.size();
    let clamped = |v: usize, d: isize, extent: usize| (v as isize + d).clamp(0, extent as isize - 1) as usize;
    let mut out = Rows::new(size, SIGNATURE);
    for (x, y) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))) {
        let mut near = [0.0f64; 3];
        for (dx, dy) in (-1..=1isize).flat_map(|dy| (-1..=1isize).map(move |dx| (dx, dy))) {
            let share = (2 - dx.abs()) * (2 - dy.abs());
            let colour = picture.at(clamped(x, dx, size.width), clamped(y, dy, size.height));
            for c in 0..3 {
                near[c] += share as f64 / 16.0 * f64::from(colour[c]);
            }
        }
        let wide = window_mean(size, WIDE, (x, y), |q| picture.data()[q]);
        let albedo = albedo_around(features, y * size.width + x).map(f64::from);
        let normal = window_mean(size, 1, (x, y), |q| normal_at(features, q));
        let parts = [near, wide, albedo, normal];
        parts.iter().flatten().enumerate().for_each(|(c, value)| out.set(x, y, c, *value as f32));
        let offsets = (-1..=1isize).flat_map(|dy| (-1..=1isize).map(move |dx| (dx, dy)));
        let around = offsets.map(|(dx, dy)| picture.at(clamped(x, dx, size.width), clamped(y, dy, size.height)));
        let mut sums: Vec<f32> = around.map(|colour| colour.iter().sum()).collect();
        sums.sort_by(f32::total_cmp);
        out.set(x, y, BRIGHTNESS, log_brightness(sums[4]));
    }
    out
}

/// Mean over the pixels that lie in the picture and in a window of 2 `radius` + 1.
fn window_mean(size: Size, radius: usize, (x, y): (usize, usize), value: impl Fn(usize) -> [f32; 3]) -> [f64; 3] {
    let (mut sum, mut n) = ([0.0f64; 3], 0.0);
    for qy in y.saturating_sub(radius)..(y + radius + 1).min(size.height) {
        for qx in x.saturating_sub(radius)..(x + radius + 1).min(size.width) {
            let v = value(qy * size.width + qx);
            for c in 0..3 {
                sum[c] += f64::from(v[c]);
            }
            n += 1.0;
        }
    }
    sum.map(|v| v / n)
}

/// What a filtered picture shows without its noise, and how far that may be off. `raw`: the picture as it came.
pub fn likeness(picture: &Plane<Rgb>, raw: &Plane<Rgb>, s: &Stabilise) -> Likeness {
    let size = picture.size();
    let clamped = |v: usize, d: isize, extent: usize| (v as isize + d).clamp(0, extent as isize - 1) as usize;
    let nine = |plane: &Plane<Rgb>, x: usize, y: usize, c: usize| -> Vec<f32> {
        let offsets = (-1..=1isize).flat_map(|dy| (-1..=1isize).map(move |dx| (dx, dy)));
        offsets.map(|(dx, dy)| plane.at(clamped(x, dx, size.width), clamped(y, dy, size.height))[c]).collect()
    };
    let binomial = |plane: &Plane<Rgb>, x: usize, y: usize| {
        [0, 1, 2].map(|c| {
            let shares = [1.0, 2.0, 1.0, 2.0, 4.0, 2.0, 1.0, 2.0, 1.0];
            nine(plane, x, y, c).iter().zip(shares).map(|(v, share)| f64::from(*v) * share / 16.0).sum::<f64>()
        })
    };
    let median = Plane::from_fn(size, |x, y| {
        [0, 1, 2].map(|c| {
            let mut values = nine(picture, x, y, c);
            values.sort_by(f32::total_cmp);
            values[4]
        })
    });
    let guide = Plane::from_fn(size, |x, y| binomial(&median, x, y).map(|v| v as f32));
    let fine = |x: usize, y: usize| {
        let around = binomial(picture, x, y);
        (0..3).map(|c| (f64::from(picture.at(x, y)[c]) - around[c]).powi(2)).sum()
    };
    let noise = |x: usize, y: usize| {
        (0..3).map(|c| (f64::from(picture.at(x, y)[c]) - f64::from(raw.at(x, y)[c])).powi(2)).sum()
    };
    let pooled = |value: &dyn Fn(usize, usize) -> f64, radius: usize, x: usize, y: usize| {
        let mut values = Vec::new();
        for qy in y.saturating_sub(radius)..(y + radius + 1).min(size.height) {
            values.extend((x.saturating_sub(radius)..(x + radius + 1).min(size.width)).map(|qx| value(qx, qy)));
        }
        values.iter().sum::<f64>() / values.len() as f64
    };
    let tolerance = Plane::from_fn(size, |x, y| {
        let (fine, noise) = (pooled(&fine, 1, x, y), pooled(&noise, POOL, x, y));
        let bright: f64 = guide.at(x, y).iter().map(|v| f64::from(*v).powi(2)).sum();
        let noisy = noise / (noise + f64::from(s.low_noise).powi(2) * bright + f64::from(LEAST_NOISE));
        (f64::from(s.likeness) * fine).min(f64::from(s.residue) * noisy.powi(2) * noise) as f32
    });
    Likeness { guide, tolerance }
}

/// How far a neighbour counts by what both pictures show.
fn alike(here: &StabiliseFrame<'_>, (x, y): (usize, usize), there: &StabiliseFrame<'_>, at: [f32; 2]) -> f32 {
    let (Some(a), Some(b)) = (here.likeness, there.likeness) else { return 1.0 };
    let f = there.features;
    let between = |value: &dyn Fn(usize) -> f32| {
        let mut sum = 0.0;
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (fx, fy) = (at[0].floor(), at[1].floor());
            let column = (fx as usize + i).min(f.size.width - 1);
            let row = (fy as usize + j).min(f.picture_height - 1).saturating_sub(f.first_row).min(f.size.height - 1);
            let share = (1.0 - (at[0] - fx - i as f32).abs()) * (1.0 - (at[1] - fy - j as f32).abs());
            sum += share * value(row * f.size.width + column);
        }
        sum
    };
    let unlike: f32 = (0..3).map(|c| (a.guide.at(x, y)[c] - between(&|i| b.guide.data()[i][c])).powi(2)).sum();
    let allowed = a.tolerance.at(x, y) + between(&|i| b.tolerance.data()[i]);
    if unlike == 0.0 { 1.0 } else { allowed / (allowed + unlike) }
}

/// A place in another frame that shows what the pixel shows.
struct Visit {
    frame: usize,
    at: [f32; 2],
    weight: f32,
}

/// Follows what is in front of a pixel through the frames before, then through those after. `noise`: as [`may_miss`] takes it.
fn visits(
    window: &[StabiliseFrame<'_>],
    centre: usize,
    (x, y): (usize, usize),
    noise: f32,
    gather: &Gather,
    s: &Stabilise,
) -> Vec<Visit> {
    let here = window[centre].features;
    let p = y * here.size.width + x;
    let mirror = here.is_mirror(p);
    let origin_row = (here.first_row + y) as f32;
    let farthest = gather.travel * here.picture_height as f32;
    let mut visits = Vec::new();
    for forward in [false, true].into_iter().filter(|forward| !forward || gather.future) {
        let mut at = [x as f32, origin_row];
        let mut front = front(here, x, y, s.nearer);
        let mut decayed = 1.0;
        let mut frame = centre;
        for _ in 0..s.frames {
            let next = if forward { frame + 1 } else { frame.wrapping_sub(1) };
            let (Some(to), from) = (window.get(next), window[frame].features) else { break };
            let step = |reflected: bool| {
                next_place(from, to.features, forward, reflected, at, front, (s, may_miss(s, noise)))
                    .filter(|(at, _)| (at[1] - origin_row).abs() <= farthest)
            };
            let (mut found, mut tolerance) = (step(mirror), s.seen_albedo);
            if found.is_none() && mirror && departure(from, forward, front) <= s.departure {
                (found, tolerance) = (step(false), s.surface_seen_albedo);
            }
            let Some((place, pixel)) = found else { break };
            (at, front, frame) = (place, pixel, next);
            let Some(row) = to.features.row_here(at[1].round() as isize) else { break };
            let q = row * here.size.width + at[0].round() as usize;
            let unlike = if mirror { seen_difference(here, p, to.features, q) } else { 0.0 };
            let shown = alike(&window[centre], (x, y), to, at);
            visits.push(Visit { frame, at, weight: decayed * shown * weight(unlike / (2.0 * tolerance * tolerance)) });
            decayed *= s.decay;
        }
    }
    visits
}

/// The pixel of a 3x3 neighbourhood whose surface is nearest to the eye; the centre, if the others are hardly nearer.
pub(crate) fn front(f: &Features, x: usize, y: usize, nearer: f32) -> usize {
    let (w, h) = (f.size.width, f.size.height);
    let mut best = y * w + x;
    for qy in y.saturating_sub(1)..(y + 2).min(h) {
        for qx in x.saturating_sub(1)..(x + 2).min(w) {
            let q = qy * w + qx;
            if f.surface[q].inverse_depth > nearer * f.surface[best].inverse_depth {
                best = q;
            }
        }
    }
    best
}

/// Where motion leads from `at` in the neighbouring frame, and the pixel in front there; `None`: off the picture, another depth, or
/// the motion there does not lead back.
fn next_place(
    from: &Features,
    to: &Features,
    forward: bool,
    reflected: bool,
    at: [f32; 2],
    pixel: usize,
    (s, may_miss): (&Stabilise, f32),
) -> Option<([f32; 2], usize)> {
    let m = from.motion.get(forward, reflected)?.at(pixel);
    let at = [at[0] + m[0], at[1] + m[1]];
    let last = [(from.size.width - 1) as f32, (from.picture_height - 1) as f32];
    let inside = |c: usize| at[c] >= 0.0 && at[c] <= last[c];
    if !(inside(0) && inside(1)) {
        return None; // NaN is not inside
    }
    let there = front(to, at[0].round() as usize, to.row_here(at[1].round() as isize)?, s.nearer);
    let (before, after) = (from.surface[pixel].inverse_depth, to.surface[there].inverse_depth);
    if (after - before).abs() > s.depth_change * before {
        return None;
    }
    if let Some(back) = to.motion.get(!forward, reflected) {
        let back = back.at(there);
        let miss = (m[0] + back[0]).hypot(m[1] + back[1]);
        let allowed = may_miss + s.round_trip_share * m[0].hypot(m[1]);
        if miss.is_nan() || miss > allowed {
            return None;
        }
    }
    Some((at, there))
}

/// Pixels between the motion of what is seen at a pixel and that of its surface.
fn departure(f: &Features, forward: bool, pixel: usize) -> f32 {
    let at = |reflected: bool| f.motion.get(forward, reflected).map_or([0.0; 2], |m| m.at(pixel));
    (at(true)[0] - at(false)[0]).hypot(at(true)[1] - at(false)[1])
}

/// Least and largest value in 3x3.
fn range(w: usize, h: usize, (x, y): (usize, usize), value: impl Fn(usize, usize) -> f32) -> (f32, f32) {
    let (mut low, mut high) = (f32::MAX, f32::MIN);
    for qy in y.saturating_sub(1)..(y + 2).min(h) {
        for qx in x.saturating_sub(1)..(x + 2).min(w) {
            (low, high) = (low.min(value(qx, qy)), high.max(value(qx, qy)));
        }
    }
    (low, high)
}

/// Catmull-Rom interpolation at a place of the picture; beyond the border the border counts.
fn cubic(f: &Features, at: [f32; 2], value: impl Fn(usize) -> f32) -> f32 {
    let clamped = |v: isize, extent: usize| v.clamp(0, extent as isize - 1) as usize;
    let mut sum = 0.0;
    for j in -1..=2isize {
        for i in -1..=2isize {
            let (fx, fy) = (at[0].floor(), at[1].floor());
            let x = clamped(fx as isize + i, f.size.width);
            let row = clamped(fy as isize + j, f.picture_height).saturating_sub(f.first_row);
            let y = row.min(f.size.height - 1);
            let share = catmull_rom(at[0] - fx - i as f32) * catmull_rom(at[1] - fy - j as f32);
            sum += share * value(y * f.size.width + x);
        }
    }
    sum
}

/// The kernel of Catmull and Rom at a distance of less than two pixels.
fn catmull_rom(d: f32) -> f32 {
    let d = d.abs();
    if d < 1.0 { (1.5 * d - 2.5) * d * d + 1.0 } else { ((2.5 - 0.5 * d) * d - 4.0) * d + 2.0 }
}
