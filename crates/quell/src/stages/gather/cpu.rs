//! The mean of the samples met along each surface's trajectory, its variance, and how many samples it is worth: on all
//! threads, one trajectory for all lights.

use super::trajectory::{Tap, taps};
use super::{FREE_COUNT, Gathered, LEAST_COUNT, Place, decay, light_likeness, lit, mean_of, seen_distance};
use crate::frame::Rgb;
use crate::kernels::guide_distance::weight;
use crate::kernels::math::luminance;
use crate::par;
use crate::sequence::settings::Gather;
use crate::window::{Class, LightSlot, PreparedFrame, Rows, Samples};

/// Means over the window for every light of `window[centre]`.
pub(crate) fn run(window: &[&PreparedFrame], centre: usize, gather: &Gather) -> Gathered {
    let here = window[centre];
    let slots = lit(window, centre);
    let size = here.features.size;
    let w = size.width;
    let planes = slots.iter().map(|s| s.planes).sum::<usize>();
    let lights: Vec<Light> = slots.iter().map(|slot| Light::new(window, slot, gather)).collect();
    let looks_through = here.features.seen.is_some() && slots.iter().any(|s| Class::of(s.kind) == Class::Seen);
    let mut colours = Rows::new(size, 3 * planes);
    let mut moments = Rows::new(size, 2 * slots.len());
    let (cw, mw) = (3 * planes * w, 2 * slots.len() * w);
    par::two_rows(colours.data_mut(), cw, moments.data_mut(), mw, |y, colours, moments| {
        let (mut surface, mut reflected) = (Trajectory::default(), Trajectory::default());
        let mut sums = vec![[0.0f32; 3]; planes];
        for x in 0..w {
            let p = y * w + x;
            surface.follow(window, centre, p, false, looks_through, gather);
            if here.features.is_mirror(p) {
                reflected.follow(window, centre, p, true, true, gather);
            }
            for (l, (slot, light)) in slots.iter().zip(&lights).enumerate() {
                let mut set = |k: usize, value: Rgb| {
                    for (c, value) in value.into_iter().enumerate() {
                        colours[(3 * (slot.first + k) + c) * w + x] = value;
                    }
                };
                if let Samples::Own(own) = &here.stored[slot.light] {
                    own.iter().enumerate().for_each(|(k, plane)| set(k, plane.data()[p]));
                    moments[(2 * l + 1) * w + x] = 1.0;
                    continue;
                }
                let met = if here.features.reflects(p, slot.kind) { &reflected } else { &surface };
                let sums = &mut sums[..slot.planes];
                let mean = light.mean(window, centre, p, met, sums);
                sums.iter().enumerate().for_each(|(k, sum)| set(k, sum.map(|s| s / mean.total)));
                moments[2 * l * w + x] = mean.spread;
                moments[(2 * l + 1) * w + x] = mean.count;
            }
        }
    });
    Gathered { slots, colours, moments }
}

/// Pixels of the window's frames that show a surface, or what a mirror shows.
#[derive(Default)]
struct Trajectory {
    taps: Vec<Tap>,
    /// Of each tap, how alike the things are that mirrors and glass show. Empty: not asked.
    likeness: Vec<f32>,
}

impl Trajectory {
    fn follow(
        &mut self,
        window: &[&PreparedFrame],
        centre: usize,
        p: usize,
        reflected: bool,
        looks_through: bool,
        gather: &Gather,
    ) {
        taps(window, centre, p, reflected, gather, &mut self.taps);
        self.likeness.clear();
        if looks_through {
            let here = &window[centre].features;
            let there = |t: &Tap| &window[t.frame as usize].features;
            let likeness = |t: &Tap| weight(seen_distance(here, p, there(t), t.pixel as usize, gather));
            self.likeness.extend(self.taps.iter().map(likeness));
        }
    }
}

/// What the loop over pixels knows of a light.
struct Light<'a> {
    /// Weight of a sample by its distance in frames.
    powers: Vec<f32>,
    /// Where each frame of the window has it.
    places: Vec<Place>,
    /// What mirrors and glass show counts.
    seen: bool,
    /// Where each frame of the window has its means.
    means: Vec<Option<usize>>,
    gather: &'a Gather,
}

/// The mean of one pixel.
struct Mean {
    /// Sum of weights.
    total: f32,
    /// Variance of one sample's luminance.
    spread: f32,
    /// Samples that the mean is worth.
    count: f32,
}

impl<'a> Light<'a> {
    fn new(window: &[&PreparedFrame], slot: &LightSlot, gather: &'a Gather) -> Self {
        let power = |p: &mut f32, _| {
            let now = *p;
            *p *= decay(gather, slot.kind);
            Some(now)
        };
        Self {
            powers: (0..=gather.frames).scan(1.0, power).collect(),
            places: window.iter().map(|frame| Place::of(frame, slot.light)).collect(),
            seen: Class::of(slot.kind) == Class::Seen,
            means: window.iter().map(|frame| frame.means.places.get(slot.light).copied().flatten()).collect(),
            gather,
        }
    }

    /// Sums of the weighted samples of every plane in `sums`, and what they are worth.
    #[inline(always)]
    fn mean(&self, window: &[&PreparedFrame], centre: usize, p: usize, met: &Trajectory, sums: &mut [Rgb]) -> Mean {
        sums.fill([0.0; 3]);
        let (mut total, mut squares, mut second) = (0.0f32, 0.0f32, 0.0f32);
        // Moments about the first sample: differences of large numbers lose less.
        let pivot = match self.places[centre] {
            Place::At(first) => luminance(window[centre].samples.at(first, p)),
            _ => 0.0,
        };
        let here = mean_of(window[centre], self.means[centre], p);
        let free = here[1] < 0.0;
        let likeness = if self.seen { &met.likeness[..] } else { &[] };
        // Without noise: itself alone.
        let taps = if free { &met.taps[..1] } else { &met.taps[..] };
        for (k, tap) in taps.iter().enumerate() {
            let seen = likeness.get(k).copied().unwrap_or(1.0);
            let mut weight = tap.weight * self.powers[tap.distance as usize] * seen;
            if weight == 0.0 {
                continue;
            }
            let (frame, pixel) = (tap.frame as usize, tap.pixel as usize);
            if k > 0 {
                weight *= light_likeness(here, mean_of(window[frame], self.means[frame], pixel), self.gather);
            }
            let mut off = -pivot;
            match self.places[frame] {
                Place::Unknown => continue,
                Place::Black => {}
                Place::At(first) => {
                    let samples = &window[frame].samples;
                    let sample = samples.at(first, pixel);
                    off = luminance(sample) - pivot;
                    for c in 0..3 {
                        sums[0][c] += weight * sample[c];
                    }
                    for (k, sum) in sums.iter_mut().enumerate().skip(1) {
                        let sample = samples.at(first + k, pixel);
                        for c in 0..3 {
                            sum[c] += weight * sample[c];
                        }
                    }
                }
            }
            second += weight * off * off;
            total += weight;
            squares += weight * weight;
        }
        let count = if free { FREE_COUNT } else { total * total / squares };
        let mean = luminance(sums[0].map(|s| s / total)) - pivot;
        let spread = (second / total - mean * mean).max(0.0);
        Mean { total, spread: if count > LEAST_COUNT && !free { spread * count / (count - 1.0) } else { 0.0 }, count }
    }
}
