//! Of each light of a frame its mean around each pixel, and how sure that mean is: what tells whether another frame shows
//! the same light there.
//!
//! Mean luminance over 5x5 pixels of the same surface, and the deviation of that mean if the pixels differ by noise alone. Both
//! are kept in half precision, scaled where a frame holds colours beyond it. What a surface or the sky emits has noise only behind a
//! medium, where a ray gets there by chance: where no medium is lit in 5x5 pixels its deviation is [`FREE`].
//! All is made for the whole frame, so that a band of rows finds the same.

use super::features::Features;
use super::local::Class;
use super::packed::Packed;
use super::prepared::{LightSlot, Samples};
use crate::kernels::math::luminance;
use crate::par;
use crate::sequence::LightKind;
use crate::sequence::settings::Gather;
use half::f16;

/// Pixels around a pixel, each way.
const RADIUS: isize = 2;
/// Luminances beyond it count as it: squares stay finite.
const MOST: f32 = 1e15;
/// Means and deviations are no larger than the largest sample, and half precision holds twice this.
const LARGEST: f32 = 32768.0;
/// Stands for a deviation where a light has no noise at all.
const FREE: f32 = -1.0;

/// A light whose means are asked for.
struct Asked {
    /// Its first plane.
    first: usize,
    /// Surfaces bound it.
    bounded: bool,
    /// It has noise only behind a medium.
    behind: bool,
}

/// Means of the lights of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightMeans {
    /// Lights that have samples; 0: nothing is known.
    pub lights: usize,
    /// Of each light of the frame its place below.
    pub places: Vec<Option<usize>>,
    /// What the numbers below are multiplied by: a power of two, 1 where half precision holds every colour.
    pub scale: f32,
    /// Mean and its deviation, light by light, pixel by pixel.
    pub data: Vec<[f16; 2]>,
}

impl LightMeans {
    /// `behind`: of each light whether it has noise only behind a medium.
    pub(crate) fn new(
        f: &Features,
        slots: &[LightSlot],
        behind: &[bool],
        stored: &[Samples],
        samples: &Packed,
        s: &Gather,
    ) -> Self {
        let mut places = vec![None; stored.len()];
        let mut lights: Vec<Asked> = Vec::new();
        // First planes of the light of media.
        let mut media: Vec<usize> = Vec::new();
        for (slot, behind) in slots.iter().zip(behind) {
            if let Samples::Packed(first) = stored[slot.light] {
                places[slot.light] = Some(lights.len());
                lights.push(Asked { first, bounded: Class::of(slot.kind) != Class::Free, behind: *behind });
                if slot.kind == LightKind::Volume {
                    media.push(first);
                }
            }
        }
        let brightest = samples.beyond.iter().flat_map(|(_, c)| c).fold(0.0f32, |most, v| most.max(v.abs()));
        let mut scale = 1.0f32;
        while brightest.min(MOST) / scale > LARGEST {
            scale *= 2.0;
        }
        let (w, h, n) = (f.size.width, f.size.height, lights.len());
        let mut data = vec![[f16::ZERO; 2]; f.size.pixels() * n];
        if n > 0 {
            par::rows(&mut data, w * n, |y, out| {
                let mut sums = vec![[0.0f32; 3]; n];
                for x in 0..w {
                    sums.fill([0.0; 3]);
                    let mut medium = false;
                    for qy in (y as isize - RADIUS).max(0)..=(y as isize + RADIUS).min(h as isize - 1) {
                        for qx in (x as isize - RADIUS).max(0)..=(x as isize + RADIUS).min(w as isize - 1) {
                            let q = qy as usize * w + qx as usize;
                            let same = alike(f, y * w + x, q, s);
                            medium |= media.iter().any(|first| samples.at(*first, q) != [0.0; 3]);
                            for (sum, light) in sums.iter_mut().zip(&lights) {
                                if same || !light.bounded {
                                    let v = luminance(samples.at(light.first, q)).clamp(-MOST, MOST);
                                    *sum = [sum[0] + v, sum[1] + v * v, sum[2] + 1.0];
                                }
                            }
                        }
                    }
                    for ((out, sum), light) in out[x * n..][..n].iter_mut().zip(&sums).zip(&lights) {
                        let [mean, deviation] = mean_and_deviation(*sum);
                        let deviation = if light.behind && !medium { FREE } else { deviation / scale };
                        *out = [mean / scale, deviation].map(f16::from_f32);
                    }
                }
            });
        }
        Self { lights: n, places, scale, data }
    }

    /// Mean and its deviation, which is below 0 where the light has no noise.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize, pixel: usize) -> [f32; 2] {
        self.data[pixel * self.lights + place].map(|v| v.to_f32() * self.scale)
    }
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

/// Of the sum of some values, of their squares, and their number. Of one value alone the deviation is the value.
fn mean_and_deviation([sum, squares, n]: [f32; 3]) -> [f32; 2] {
    let mean = sum / n;
    let variance = if n > 1.0 { (squares / n - mean * mean).max(0.0) / (n - 1.0) } else { mean * mean };
    [mean, variance.sqrt()]
}
