//! The specification of the means of the light.

use super::{Asked, FREE, LEAST, MOST, RADIUS, SECOND_DIFFERENCE, STEPS, STRONGEST, WINDOW};
use crate::kernels::halves::widen;
use crate::kernels::math::luminance;
use crate::par;
use crate::plane::Plane;
use crate::sequence::settings::Gather;
use crate::window::{Features, Packed};
use half::f16;

/// Of each pixel the means of all lights, then their deviations: [`super::LightMeans::data`].
pub(super) fn data(
    f: &Features,
    lights: &[Asked],
    media: &[usize],
    samples: &Packed,
    scale: f32,
    s: &Gather,
) -> Vec<f16> {
    let near = near(f, lights, media, samples, scale, s);
    planar(&wide(f, lights, &near, s), lights.len())
}

/// Means over 5x5 pixels of the same surface, as far as they are equal but for their noise, and the deviation of these means. With few
/// samples a pixel all count; with many only those that show the same: stripes and the edge of a shadow are kept apart.
fn near(f: &Features, lights: &[Asked], media: &[usize], samples: &Packed, scale: f32, s: &Gather) -> Vec<[f16; 2]> {
    let (w, h, n) = (f.size.width, f.size.height, lights.len());
    let mut data = vec![[f16::ZERO; 2]; f.size.pixels() * n];
    if n == 0 {
        return data;
    }
    let light: Vec<Plane<f32>> = (lights.iter())
        .map(|light| par::plane(f.size, |x, y| luminance(samples.at(light.first, y * w + x)).clamp(-MOST, MOST)))
        .collect();
    par::rows(&mut data, w * n, |y, out| {
        let found: Vec<_> = light.iter().map(|light| least_noise(light, y)).collect();
        let mut sums = vec![[0.0f32; 5]; n];
        let mut limits = vec![[0.0f32; 2]; n];
        for x in 0..w {
            sums.fill([0.0; 5]);
            for (limit, (noise, mean)) in limits.iter_mut().zip(&found) {
                let allowed = s.mean_strong * mean[x];
                let strong = (noise[x] / (allowed * allowed + LEAST)).min(STRONGEST);
                // The spread of the pixels is noise as far as it is below this.
                let bound = noise[x] * (s.mean_least + s.mean_few * strong);
                *limit = [s.mean_pixels * noise[x] * (1.0 + strong), bound];
            }
            let mut medium = false;
            for qy in (y as isize - RADIUS).max(0)..=(y as isize + RADIUS).min(h as isize - 1) {
                for qx in (x as isize - RADIUS).max(0)..=(x as isize + RADIUS).min(w as isize - 1) {
                    let (qx, qy) = (qx as usize, qy as usize);
                    let q = qy * w + qx;
                    let same = alike(f, y * w + x, q, s);
                    medium |= media.iter().any(|first| samples.at(*first, q) != [0.0; 3]);
                    for (k, sum) in sums.iter_mut().enumerate() {
                        if same || !lights[k].bounded {
                            let value = light[k].at(qx, qy);
                            let (difference, t) = (value - light[k].at(x, y), limits[k][0]);
                            let weight = t / (t + difference * difference + LEAST);
                            let weight = if (qx, qy) == (x, y) { 1.0 } else { weight };
                            *sum = [
                                sum[0] + weight * value,
                                sum[1] + weight * weight,
                                sum[2] + weight,
                                sum[3] + weight * value * value,
                                sum[4] + 1.0,
                            ];
                        }
                    }
                }
            }
            for (k, out) in out[x * n..][..n].iter_mut().enumerate() {
                let [first, squared, total, second, count] = sums[k];
                let mean = first / total;
                // Of one value alone the deviation is the value.
                let variance = if count > 1.0 {
                    let spread = (second / total - mean * mean).max(0.0) * count / (count - 1.0);
                    spread.min(limits[k][1]) * squared / (total * total)
                } else {
                    mean * mean
                };
                let deviation = if lights[k].behind && !medium { FREE } else { variance.sqrt() / scale };
                *out = [mean / scale, deviation].map(f16::from_f32);
            }
        }
    });
    data
}

/// Of the pixels of row `y` their variance and mean over 5x5 pixels. The variance is that of second differences along the direction in which they
/// are least: what is smooth, and edges and stripes along one of four directions, is no noise.
fn least_noise(light: &Plane<f32>, y: usize) -> (Vec<f32>, Vec<f32>) {
    let (w, h) = (light.size().width, light.size().height);
    let pad = RADIUS as usize + 1;
    // Rows around, continued beyond the edges of the picture.
    let rows: Vec<Vec<f32>> = (0..=2 * pad)
        .map(|k| {
            let row = light.row((y + k).saturating_sub(pad).min(h - 1));
            (0..w + 2 * pad).map(|x| row[x.saturating_sub(pad).min(w - 1)]).collect()
        })
        .collect();
    let mut least = vec![f32::MAX; w];
    let mut column = vec![0.0f32; w + 2 * pad];
    for (dx, dy) in [(1usize, 0isize), (0, 1), (1, 1), (1, -1)] {
        column.fill(0.0);
        for k in 1..2 * pad {
            let (before, here, after) =
                (&rows[(k as isize - dy) as usize], &rows[k], &rows[(k as isize + dy) as usize]);
            for x in 1..w + 2 * pad - 1 {
                let d = before[x - dx] - 2.0 * here[x] + after[x + dx];
                column[x] += d * d;
            }
        }
        for (x, least) in least.iter_mut().enumerate() {
            let sum: f32 = column[x + 1..x + 2 * pad].iter().sum();
            *least = least.min(sum);
        }
    }
    let number = (2 * pad - 1) * (2 * pad - 1);
    least.iter_mut().for_each(|sum| *sum /= SECOND_DIFFERENCE * number as f32);
    column.fill(0.0);
    for row in &rows[1..2 * pad] {
        column.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    let mean = (0..w).map(|x| column[x + 1..x + 2 * pad].iter().sum::<f32>() / number as f32).collect();
    (least, mean)
}

/// Means of the means of 5x5 windows side by side, as far as they are equal but for their noise: what few samples say of a broad change of
/// the light is lost in the noise of 5x5 pixels.
fn wide(f: &Features, lights: &[Asked], near: &[[f16; 2]], s: &Gather) -> Vec<[f16; 2]> {
    let (w, h, n) = (f.size.width, f.size.height, lights.len());
    let mut data = near.to_vec();
    if n == 0 {
        return data;
    }
    // Light without noise, whose deviation is below 0, is compared like the rest.
    let at = |q: usize, light: usize| {
        let [mean, deviation] = near[q * n + light];
        [widen(mean), widen(deviation).max(0.0)]
    };
    par::rows(&mut data, w * n, |y, out| {
        let mut sums = vec![[0.0f32; 3]; n];
        // Of the windows their squared deviations, and how many there are.
        let mut pooled = vec![[0.0f32; 2]; n];
        for x in 0..w {
            let p = y * w + x;
            for (light, (sum, pooled)) in sums.iter_mut().zip(&mut pooled).enumerate() {
                let [mean, deviation] = at(p, light);
                *sum = [mean, deviation * deviation, 1.0];
                *pooled = [deviation * deviation, 1.0];
            }
            let steps = (-STEPS..=STEPS).flat_map(|dy| (-STEPS..=STEPS).map(move |dx| (dx, dy)));
            let windows = steps.filter(|step| *step != (0, 0)).filter_map(|(dx, dy)| {
                let (qx, qy) = (x as isize + dx * WINDOW, y as isize + dy * WINDOW);
                let inside = qx >= 0 && qy >= 0 && qx < w as isize && qy < h as isize;
                inside.then(|| qy as usize * w + qx as usize)
            });
            for q in windows.clone() {
                let same = alike(f, p, q, s);
                for (light, pooled) in pooled.iter_mut().enumerate() {
                    if same || !lights[light].bounded {
                        let [_, others] = at(q, light);
                        *pooled = [pooled[0] + others * others, pooled[1] + 1.0];
                    }
                }
            }
            for q in windows {
                let same = alike(f, p, q, s);
                for (light, sum) in sums.iter_mut().enumerate() {
                    if same || !lights[light].bounded {
                        let ([mean, _], [other, others]) = (at(p, light), at(q, light));
                        // The noise of a window alone is small where it is dark by chance: that of all is surer.
                        let t = pooled[light][0] / pooled[light][1] * (2.0 * s.mean_windows);
                        let difference = other - mean;
                        let share = if t > 0.0 { (t - difference * difference).max(0.0) / t } else { 0.0 };
                        let weight = share * share;
                        *sum = [sum[0] + weight * other, sum[1] + weight * weight * others * others, sum[2] + weight];
                    }
                }
            }
            for (light, out) in out[x * n..][..n].iter_mut().enumerate() {
                // Below 0: without noise.
                if out[1] > f16::ZERO {
                    let [mean, variance, total] = sums[light];
                    *out = [mean / total, variance.sqrt() / total].map(f16::from_f32);
                }
            }
        }
    });
    data
}

/// Of each pixel the means of all lights, then their deviations: eight lights are read at once.
fn planar(pairs: &[[f16; 2]], lights: usize) -> Vec<f16> {
    let mut data = vec![f16::ZERO; 2 * pairs.len()];
    for (pairs, out) in pairs.chunks_exact(lights.max(1)).zip(data.chunks_exact_mut(2 * lights.max(1))) {
        for (light, pair) in pairs.iter().enumerate() {
            (out[light], out[lights + light]) = (pair[0], pair[1]);
        }
    }
    data
}

/// True where pixel `q` shows the surface of pixel `p`.
#[inline(always)]
fn alike(f: &Features, p: usize, q: usize, s: &Gather) -> bool {
    if p == q {
        return true;
    }
    let (a, b) = (&f.surface[p], &f.surface[q]);
    if f.is_mirror(p) != f.is_mirror(q) || (a.inverse_depth > 0.0) != (b.inverse_depth > 0.0) {
        return false;
    }
    let near = (b.inverse_depth - a.inverse_depth).abs() <= s.moving_depth * a.inverse_depth;
    let cosine: f32 = (0..3).map(|c| a.normal[c] * b.normal[c]).sum();
    near && (cosine >= s.plane_normal || (a.normal == [0.0; 3] && b.normal == [0.0; 3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Size;
    use crate::sequence::{SequenceFrame, SequenceSettings};

    /// Windows of another brightness do not mix, even where one of them has no noise at all: its deviation, below 0, is no noise of 1.
    #[test]
    fn other_light_without_noise_stays_out_of_a_mean() {
        let size = Size::new(11, 1);
        let settings = SequenceSettings::default();
        let features = Features::new(&SequenceFrame::new(0, size), &settings);
        let lights = [Asked { first: 0, bounded: true, behind: true }];
        let noisy = [1.0, 0.1].map(f16::from_f32);
        let wide = |other: [f32; 2]| {
            let mut near = vec![noisy; size.pixels()];
            near[..5].fill(other.map(f16::from_f32));
            wide(&features, &lights, &near, &settings.gather)[5][0].to_f32()
        };
        for deviation in [0.1, 0.0, FREE] {
            assert!((wide([3.0, deviation]) - 1.0).abs() < 0.02, "deviation {deviation}");
            // What is equal but for noise does.
            assert!((1.02..1.04).contains(&wide([1.1, deviation.max(0.1)])));
        }
    }
}
