//! What the trajectories of a frame's pixels show of its noise, sixteen pixels of a row at once.

use super::{BlendFrame, DEPTH_STEP, FRAMES, LEAST_BRIGHTNESS, LEAST_COSINE, MOST_CHANGE, follow};
use crate::frame::Rgb;
use crate::kernels::lanes::{BLOCK, store};
use crate::kernels::math::three;
use crate::kernels::motion_cpu::{motion_of, nearest};
use crate::sequence::settings::Gather;
use crate::simd::dispatch;
use crate::window::{Features, Rows, SurfacePoint};
use fearless_simd::{Simd, f32x16, i32x16, mask32x16, prelude::*};

/// Of a pixel the three sums of [`over_time`], then the changes and the frames that show it.
pub(super) const ALONG_CHANGES: usize = 3;

pub(super) const ALONG_SEEN: usize = 4;

pub(super) const ALONG_CHANNELS: usize = 5;

/// What the trajectories of `window[centre]` show of its noise: [`ALONG_CHANNELS`] a pixel. `stabilise` and `blend` both ask for it, and
/// following them costs more than what is done with it.
pub(crate) fn along(window: &[BlendFrame<'_>], centre: usize, gather: &Gather) -> Rows {
    Rows::written(window[centre].input.size(), ALONG_CHANNELS, |y, out| {
        dispatch!(crate::simd::level(), simd => along_row(simd, (window, centre), gather, y, out));
    })
}

#[inline(always)]
pub(super) fn along_row<S: Simd>(
    simd: S,
    (window, centre): (&[BlendFrame<'_>], usize),
    gather: &Gather,
    y: usize,
    out: &mut [f32],
) {
    let here = &window[centre];
    let w = here.input.size().width;
    for x in (0..w).step_by(BLOCK) {
        let count = BLOCK.min(w - x);
        let (mut wanted, mut mirrors) = ([0.0; BLOCK], 0u32);
        for i in 0..count {
            if here.features.is_mirror(y * w + x + i) {
                mirrors |= 1 << i;
            } else {
                wanted[i] = 1.0;
            }
        }
        let found = surfaces_over_time(simd, (window, centre), (x, y), &wanted, gather);
        for c in 0..ALONG_CHANNELS {
            store(found[c], &mut out[c * w..][..w], x);
        }
        // What mirrors show moves by its own motion, and seldom fills a row.
        for x in (0..count).filter(|i| mirrors >> i & 1 == 1).map(|i| x + i) {
            let (i, p) = (here.input.at(x, y), here.picture.at(x, y));
            let (sum, change, seen) = over_time(window, centre, (x, y), three(|c| i[c] - p[c]), gather);
            for (c, value) in [sum[0], sum[1], sum[2], change, seen].into_iter().enumerate() {
                out[c * w + x] = value;
            }
        }
    }
}

/// What sixteen pixels show on their way: inverse depth and normal, which decide whether it is the same surface.
struct SurfaceLanes<S: Simd> {
    inverse_depth: f32x16<S>,
    normal: [f32x16<S>; 3],
}

impl<S: Simd> SurfaceLanes<S> {
    #[inline(always)]
    fn of(simd: S, features: &Features, pixels: &[i32; BLOCK]) -> Self {
        let mut v = [[0.0; BLOCK]; 4];
        for i in 0..BLOCK {
            let SurfacePoint { inverse_depth, normal, .. } = &features.surface[pixels[i] as usize];
            (v[0][i], v[1][i], v[2][i], v[3][i]) = (*inverse_depth, normal[0], normal[1], normal[2]);
        }
        Self {
            inverse_depth: v[0].simd_into(simd),
            normal: [v[1].simd_into(simd), v[2].simd_into(simd), v[3].simd_into(simd)],
        }
    }

    /// As the end of [`follow`].
    #[inline(always)]
    fn is(&self, simd: S, other: &Self) -> mask32x16<S> {
        let splat = |v: f32| f32x16::splat(simd, v);
        let zero = splat(0.0);
        let (a, b, n, m) = (self.inverse_depth, other.inverse_depth, &self.normal, &other.normal);
        let near = (a - b).abs().simd_le(a.simd_gt(b).select(a, b) * DEPTH_STEP);
        let none = n[0].simd_eq(zero) & n[1].simd_eq(zero) & n[2].simd_eq(zero);
        let none = none & m[0].simd_eq(zero) & m[1].simd_eq(zero) & m[2].simd_eq(zero);
        near & (none | (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]).simd_ge(splat(LEAST_COSINE)))
    }
}

/// Colours of sixteen pixels of the input and of the wavelet's picture, channel by channel.
#[inline(always)]
fn colours_of<S: Simd>(simd: S, frame: &BlendFrame<'_>, pixels: &[i32; BLOCK]) -> [[f32x16<S>; 3]; 2] {
    let mut v = [[[0.0; BLOCK]; 3]; 2];
    for (k, plane) in [frame.input, frame.picture].into_iter().enumerate() {
        for i in 0..BLOCK {
            let [r, g, b] = plane.data()[pixels[i] as usize];
            (v[k][0][i], v[k][1][i], v[k][2][i]) = (r, g, b);
        }
    }
    let [i, p] = v;
    [
        [i[0].simd_into(simd), i[1].simd_into(simd), i[2].simd_into(simd)],
        [p[0].simd_into(simd), p[1].simd_into(simd), p[2].simd_into(simd)],
    ]
}

#[inline(always)]
fn brightness<S: Simd>(c: &[f32x16<S>; 3]) -> f32x16<S> {
    c[0] + c[1] + c[2] + LEAST_BRIGHTNESS
}

/// [`over_time`] of sixteen pixels from column `x` on, of those that are `wanted` (1, else 0), whose motion is their surface's:
/// [`ALONG_CHANNELS`].
#[inline(always)]
fn surfaces_over_time<S: Simd>(
    simd: S,
    (window, centre): (&[BlendFrame<'_>], usize),
    (x, y): (usize, usize),
    wanted: &[f32; BLOCK],
    gather: &Gather,
) -> [f32x16<S>; ALONG_CHANNELS] {
    let (splat, int) = (|v: f32| f32x16::splat(simd, v), |v: usize| i32x16::splat(simd, v as i32));
    let here = &window[centre];
    let (w, h) = (here.features.size.width, here.features.picture_height);
    let (mut pixels, mut columns) = ([0; BLOCK], [0.0; BLOCK]);
    for i in 0..BLOCK {
        (pixels[i], columns[i]) = ((y * w + (x + i).min(w - 1)) as i32, (x + i) as f32);
    }
    let (zero, row) = (splat(0.0), splat((here.features.first_row + y) as f32));
    let farthest = splat(gather.travel * h as f32);
    let own = SurfaceLanes::of(simd, here.features, &pixels);
    let [input, picture] = colours_of(simd, here, &pixels);
    let e = [input[0] - picture[0], input[1] - picture[1], input[2] - picture[2]];
    let bright = brightness(&picture);
    let (least, most) = (splat(1.0 / MOST_CHANGE), splat(MOST_CHANGE));
    let (mut sum, mut change, mut seen) = (e, zero, zero);
    for forward in [false, true] {
        if forward && !gather.future {
            continue;
        }
        let ahead = if forward { window.len() - 1 - centre } else { centre };
        let (mut at, mut q) = ([columns.simd_into(simd), row], pixels);
        let mut alive = f32x16::from_slice(simd, wanted).simd_gt(zero);
        let mut before = SurfaceLanes { ..own };
        for k in 1..=ahead.min(FRAMES) {
            let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
            let other = &window[to];
            let Some(motion) = window[from].features.motion.get(forward, false) else { break };
            let m = motion_of(simd, motion, &q);
            at = [at[0] + m[0], at[1] + m[1]];
            let column = nearest(simd, at[0]).to_int::<i32x16<S>>().min(int(w - 1));
            let row_here = nearest(simd, at[1]).to_int::<i32x16<S>>().min(int(h - 1)) - int(other.features.first_row);
            // NaN fails too: unknown motion ends the trajectory.
            alive &= at[0].simd_gt(splat(-0.5)) & at[0].simd_lt(splat(w as f32 - 0.5));
            alive &= at[1].simd_gt(splat(-0.5)) & at[1].simd_lt(splat(h as f32 - 0.5));
            alive &= row_here.simd_ge(int(0)) & row_here.simd_lt(int(other.features.size.height));
            alive &= !(at[1] - row).abs().simd_gt(farthest);
            q = alive.select(row_here * int(w) + column, int(0)).into();
            let there = SurfaceLanes::of(simd, other.features, &q);
            alive &= before.is(simd, &there);
            if !alive.any_true() {
                break;
            }
            before = there;
            let [input, filtered] = colours_of(simd, other, &q);
            let ratio = bright / brightness(&filtered);
            // What is no number stays none.
            let ratio = ratio.simd_lt(least).select(least, ratio);
            let ratio = ratio.simd_gt(most).select(most, ratio);
            for c in 0..3 {
                let d = (input[c] - filtered[c]) * ratio;
                sum[c] = alive.select(sum[c] + d, sum[c]);
                let changed = e[c] - d;
                change = alive.select(change + changed * 0.5 * changed, change);
            }
            seen = alive.select(seen + 1.0, seen);
        }
    }
    [sum[0], sum[1], sum[2], change, seen]
}

/// Sum of the differences `e` of input and wavelet's picture along the pixel's trajectory, half the sum of their squared changes, and the
/// frames that show it.
// Not inlined: it is rare, and would keep the loops around it from wide vectors.
#[inline(never)]
fn over_time(
    window: &[BlendFrame<'_>],
    centre: usize,
    (x, y): (usize, usize),
    e: Rgb,
    gather: &Gather,
) -> (Rgb, f32, f32) {
    let here = &window[centre];
    let w = here.features.size.width;
    let p = y * w + x;
    let reflected = here.features.is_mirror(p);
    let origin = [x as f32, (here.features.first_row + y) as f32];
    let farthest = gather.travel * here.features.picture_height as f32;
    let brightness = |c: Rgb| c[0] + c[1] + c[2] + LEAST_BRIGHTNESS;
    let own = brightness(here.picture.data()[p]);
    let (mut sum, mut change, mut seen) = (e, 0.0f32, 0.0f32);
    for forward in [false, true] {
        if forward && !gather.future {
            continue;
        }
        let ahead = if forward { window.len() - 1 - centre } else { centre };
        let (mut at, mut q) = (origin, p);
        for k in 1..=ahead.min(FRAMES) {
            let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
            let other = &window[to];
            let Some(there) = follow(window[from].features, other.features, forward, reflected, (&mut at, q)) else {
                break;
            };
            if (at[1] - origin[1]).abs() > farthest {
                break;
            }
            q = there;
            let (i, f) = (other.input.data()[q], other.picture.data()[q]);
            let ratio = (own / brightness(f)).clamp(1.0 / MOST_CHANGE, MOST_CHANGE);
            for c in 0..3 {
                let d = (i[c] - f[c]) * ratio;
                sum[c] += d;
                change += 0.5 * (e[c] - d) * (e[c] - d);
            }
            seen += 1.0;
        }
    }
    (sum, change, seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::{Plane, Size};
    use crate::sequence::SequenceSettings;

    /// Also motion that leads out of the picture or is unknown, surfaces that hide others, and the ends of rows.
    #[test]
    fn sixteen_pixels_find_what_one_does() {
        let (size, settings) = (Size::new(37, 21), SequenceSettings::default());
        let noisy = |seed: usize| {
            Plane::from_fn(size, |x, y| three(|c| ((x * 31 + y * 17 + c * 7 + seed * 13) % 29) as f32 * 0.04))
        };
        let frames: Vec<_> = (0..5)
            .map(|t| {
                let mut frame = crate::sequence::testing::frame(t as i64, size);
                let some = |i: usize| if i % 13 == 5 { f32::NAN } else { (i * i % 17) as f32 * 0.3 - 2.4 };
                let motion = |sign: f32| Some(Plane::from_fn(size, |x, y| [sign * some(x + 5 * y), some(3 * x + y)]));
                (frame.motion_to_next, frame.motion_to_previous) = (motion(1.0), motion(-1.0));
                let mut features = Features::new(&frame, &settings);
                for (i, surface) in features.surface.iter_mut().enumerate() {
                    surface.inverse_depth = [1.0, 1.05, 1.3, 0.0][(i + t) / 9 % 4];
                    surface.normal = [[0.0, 0.0, 1.0], [0.0, 0.5, 0.866], [0.0; 3]][(i / 5 + t) % 3];
                }
                (features, noisy(t), noisy(t + 7))
            })
            .collect();
        let window: Vec<_> = frames
            .iter()
            .map(|(features, input, picture)| BlendFrame { features, input, picture, alpha: None, along: None })
            .collect();
        let mut seen_at = [0; 5];
        for centre in [0, 2, 4] {
            let found = along(&window, centre, &settings.gather);
            for (x, y) in (0..21).flat_map(|y| (0..37).map(move |x| (x, y))) {
                let (i, p) = (window[centre].input.at(x, y), window[centre].picture.at(x, y));
                let (sum, change, seen) =
                    super::over_time(&window, centre, (x, y), three(|c| i[c] - p[c]), &settings.gather);
                let expected = [sum[0], sum[1], sum[2], change, seen];
                for (c, expected) in expected.into_iter().enumerate() {
                    assert_eq!(found.at(x, y, c).to_bits(), expected.to_bits(), "{x} {y} {c}");
                }
                seen_at[seen as usize] += 1;
            }
        }
        assert!(seen_at[..4].iter().all(|n| *n > 10), "{seen_at:?}");
    }
}
