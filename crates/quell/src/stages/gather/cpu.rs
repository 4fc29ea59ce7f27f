//! The mean of the samples met along each surface's trajectory, its variance, and how many samples it is worth: on all
//! threads, one trajectory for all lights, eight colour planes at once on vectors.

use super::trajectory::{LANES, Tap, taps};
use super::{FREE_COUNT, Gathered, LEAST_COUNT, LEAST_NOISE, Place, decay, lit, mean_of};
use crate::kernels::guide_distance::FARTHEST;
use crate::kernels::halves::{Eights, widen, widen_eight};
use crate::kernels::math::{LUMINANCE, three};
use crate::par;
use crate::sequence::settings::Gather;
use crate::window::{Class, Features, LightSlot, Packed, PreparedFrame, Rows, Samples};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*};
use half::f16;

/// Means over the window for every light of `window[centre]`.
pub(crate) fn run(window: &[&PreparedFrame], centre: usize, gather: &Gather) -> Gathered {
    let slots = lit(window, centre);
    let size = window[centre].features.size;
    let job = Job::new(window, centre, &slots, gather);
    let planes = slots.iter().map(|s| s.planes).sum::<usize>();
    let mut colours = Rows::new(size, 3 * planes);
    let mut moments = Rows::new(size, 2 * slots.len());
    let (cw, mw) = (3 * planes * size.width, 2 * slots.len() * size.width);
    par::two_rows(colours.data_mut(), cw, moments.data_mut(), mw, |y, colours, moments| {
        dispatch!(crate::simd::level(), simd => job.row(simd, y, colours, moments));
    });
    Gathered { slots, colours, moments }
}

/// What the loop over pixels knows.
struct Job<'a> {
    window: &'a [&'a PreparedFrame],
    centre: usize,
    slots: &'a [LightSlot],
    gather: &'a Gather,
    /// What mirrors and glass show is compared.
    looks_through: bool,
    /// Planes that are averaged, eight at a time.
    lanes: Vec<Lanes<'a>>,
}

impl<'a> Job<'a> {
    fn new(window: &'a [&'a PreparedFrame], centre: usize, slots: &'a [LightSlot], gather: &'a Gather) -> Self {
        let here = window[centre];
        let looks_through = here.features.seen.is_some() && slots.iter().any(|s| Class::of(s.kind) == Class::Seen);
        let averaged = slots.iter().enumerate().filter(|(_, slot)| !matches!(here.stored[slot.light], Samples::Own(_)));
        let lanes: Vec<Lane> = averaged
            .flat_map(|(l, slot)| {
                let lane = move |k| Lane { slot: *slot, light: l, plane: k };
                (0..slot.planes).map(lane)
            })
            .collect();
        let lanes = lanes.chunks(LANES).enumerate().map(|(i, some)| Lanes::new(window, some, LANES * i, gather));
        Self { window, centre, slots, gather, looks_through, lanes: lanes.collect() }
    }

    #[inline(always)]
    fn row<S: Simd>(&self, simd: S, y: usize, colours: &mut [f32], moments: &mut [f32]) {
        let here = self.window[self.centre];
        let w = here.features.size.width;
        for (l, slot) in self.slots.iter().enumerate() {
            if let Samples::Own(own) = &here.stored[slot.light] {
                for (k, plane) in own.iter().enumerate() {
                    for (x, value) in plane.row(y).iter().enumerate() {
                        for c in 0..3 {
                            colours[(3 * (slot.first + k) + c) * w + x] = value[c];
                        }
                    }
                }
                moments[(2 * l + 1) * w..][..w].fill(1.0);
            }
        }
        let (mut surface, mut reflected) = (Trajectories::default(), Trajectories::default());
        for first in (0..w).step_by(LANES) {
            let p = y * w + first;
            let mut inside = [false; LANES];
            inside.iter_mut().take(w - first).for_each(|inside| *inside = true);
            let mut mirrors = inside;
            mirrors.iter_mut().enumerate().for_each(|(i, m)| *m = *m && here.features.is_mirror(p + i));
            surface.follow(simd, self, p, inside, false, self.looks_through);
            if mirrors.contains(&true) {
                reflected.follow(simd, self, p, mirrors, true, true);
            }
            for i in 0..LANES.min(w - first) {
                let met = (surface.of(i), mirrors[i].then(|| reflected.of(i)));
                self.pixel(simd, (y, first + i), met, colours, moments);
            }
        }
    }

    /// One pixel, of what was met on its surface's trajectory, and on that of what is reflected there.
    #[inline(always)]
    fn pixel<S: Simd>(
        &self,
        simd: S,
        (y, x): (usize, usize),
        (surface, reflected): (Met<'_>, Option<Met<'_>>),
        colours: &mut [f32],
        moments: &mut [f32],
    ) {
        let w = self.window[self.centre].features.size.width;
        let p = y * w + x;
        for lanes in &self.lanes {
            let mut mean = lanes.mean(simd, self, p, surface);
            if let Some(reflected) = reflected.filter(|_| lanes.reflects) {
                let other = lanes.mean(simd, self, p, reflected);
                for (i, _) in lanes.each.iter().enumerate().filter(|(_, lane)| lane.reflects()) {
                    mean.take(&other, i);
                }
            }
            for (i, lane) in lanes.each.iter().enumerate() {
                let first = 3 * (lane.slot.first + lane.plane);
                for c in 0..3 {
                    colours[(first + c) * w + x] = mean.colours[c][i];
                }
                if lane.plane == 0 {
                    moments[2 * lane.light * w + x] = mean.spread[i];
                    moments[(2 * lane.light + 1) * w + x] = mean.count[i];
                }
            }
        }
    }
}

/// Pixels of the window's frames that show the surfaces of eight pixels, or what mirrors show there.
#[derive(Default)]
struct Trajectories {
    taps: [Vec<Tap>; LANES],
    /// Of each tap, how alike the things are that mirrors and glass show; 1 where that is not asked.
    likeness: [Vec<f32>; LANES],
}

/// The taps of one pixel, itself first, each with the likeness of what mirrors and glass show.
#[derive(Clone, Copy)]
struct Met<'t> {
    taps: &'t [Tap],
    likeness: &'t [f32],
}

impl Trajectories {
    fn of(&self, lane: usize) -> Met<'_> {
        Met { taps: &self.taps[lane], likeness: &self.likeness[lane] }
    }

    #[inline(always)]
    fn follow<S: Simd>(
        &mut self,
        simd: S,
        job: &Job<'_>,
        first: usize,
        wanted: [bool; LANES],
        reflected: bool,
        looks_through: bool,
    ) {
        taps(simd, (job.window, job.centre), first, wanted, reflected, job.gather, &mut self.taps);
        fetch(job.window, &self.taps, looks_through);
        for (i, (taps, likeness)) in self.taps.iter().zip(&mut self.likeness).enumerate() {
            likeness.clear();
            if !looks_through {
                likeness.resize(taps.len(), 1.0);
                continue;
            }
            for taps in taps.chunks(LANES) {
                let some = seen_likeness(simd, job, first + i, taps);
                likeness.extend_from_slice(&some[..taps.len()]);
            }
        }
    }
}

/// Reads of every tap what will be summed, all at once, so that the memory serves many at a time: in the sums each would be waited for.
fn fetch(window: &[&PreparedFrame], taps: &[Vec<Tap>; LANES], looks_through: bool) {
    let first = |data: &[f16], at: usize| data.get(at).map_or(0, |half| half.to_bits());
    for tap in taps.iter().flatten() {
        let (frame, pixel) = (&window[tap.frame as usize], tap.pixel as usize);
        let mut read = first(&frame.samples.data, 3 * frame.samples.planes * pixel);
        read ^= first(&frame.means.data, 2 * frame.means.lights * pixel);
        if let (true, Some(seen)) = (looks_through, &frame.features.seen) {
            read ^= first(&seen.data, 6 * pixel);
        }
        std::hint::black_box(read);
    }
}

/// How alike the things are that pixel `p` and up to eight others show in mirrors and through glass, as weights:
/// [`super::seen_distance`] on lanes.
#[inline(always)]
fn seen_likeness<S: Simd>(simd: S, job: &Job<'_>, p: usize, taps: &[Tap]) -> [f32; LANES] {
    let here = &job.window[job.centre].features;
    let Some(own) = &here.seen else { return [1.0; LANES] };
    let own = of_each(own, p);
    let mirror = here.is_mirror(p);
    let mut there = [[f16::ZERO; LANES]; 6];
    // Light that was divided by what it shows never mixes with light that was not.
    let (mut apart, mut known) = ([0.0f32; LANES], [0.0f32; LANES]);
    for (i, tap) in taps.iter().enumerate() {
        let (features, pixel) = (&job.window[tap.frame as usize].features, tap.pixel as usize);
        let Some(seen) = &features.seen else { continue };
        known[i] = 1.0;
        apart[i] = if features.is_mirror(pixel) == mirror { 0.0 } else { 1.0 };
        for (there, half) in there.iter_mut().zip(of_each(seen, pixel)) {
            there[i] = half;
        }
    }
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let s = job.gather;
    let (tolerance, mut squared, mut cosine) = (s.seen_albedo * s.seen_albedo, zero, zero);
    let mut has_normals = zero.simd_lt(zero);
    for c in 0..3 {
        let (albedo, normal) = (widen_eight(simd, there[2 * c]), widen_eight(simd, there[2 * c + 1]));
        let d = f32x8::splat(simd, widen(own[2 * c])) - albedo;
        squared += d * d;
        let a = f32x8::splat(simd, widen(own[2 * c + 1]));
        cosine = if c == 0 { a * normal } else { cosine + a * normal };
        has_normals |= !a.simd_eq(zero) | !normal.simd_eq(zero);
    }
    let bend = has_normals.select((one - cosine) * s.seen_normal, zero);
    let distance = squared * 0.5 / tolerance + bend;
    // `guide_distance::weight`
    let mut b = (one - distance * (1.0 / FARTHEST)).max(zero);
    for _ in 0..4 {
        b *= b;
    }
    let [apart, known]: [f32x8<S>; 2] = [apart.simd_into(simd), known.simd_into(simd)];
    known.simd_gt(zero).select(apart.simd_gt(zero).select(zero, b), one).into()
}

/// What a pixel shows in mirrors and through glass: albedo and normal one after the other, channel by channel.
#[inline(always)]
fn of_each(seen: &Packed, pixel: usize) -> [f16; 6] {
    match seen.data.get(6 * pixel..) {
        Some(rest) => *rest.first_chunk::<6>().unwrap_or(&[f16::ZERO; 6]),
        None => [f16::ZERO; 6],
    }
}

/// A colour plane of a light.
#[derive(Clone, Copy)]
struct Lane {
    slot: LightSlot,
    /// Place of the light among all.
    light: usize,
    /// Place of the plane among the light's.
    plane: usize,
}

impl Lane {
    fn reflects(&self) -> bool {
        Features::can_reflect(self.slot.kind)
    }
}

/// Eight planes, or fewer.
struct Lanes<'a> {
    each: Vec<Lane>,
    /// Some of them have a motion of their own in mirrors and glass.
    reflects: bool,
    /// Weight of a sample by its distance in frames.
    powers: Vec<[f32; LANES]>,
    /// 1 where what mirrors and glass show counts.
    seen: [f32; LANES],
    /// Where each frame of the window has them.
    frames: Vec<There<'a>>,
}

/// Where a frame has its planes.
struct There<'a> {
    frame: &'a PreparedFrame,
    samples: Eights<'a>,
    light: Eights<'a>,
    /// The planes lie side by side from here on, and so do their means.
    run: Option<usize>,
    places: [Place; LANES],
    means: [Option<usize>; LANES],
    /// 0 where nothing is known of a light.
    known: [f32; LANES],
}

/// The means of eight planes in one pixel.
struct Means {
    colours: [[f32; LANES]; 3],
    /// Variance of one sample's luminance.
    spread: [f32; LANES],
    /// Samples that the mean is worth.
    count: [f32; LANES],
}

impl Means {
    fn take(&mut self, other: &Self, lane: usize) {
        for c in 0..3 {
            self.colours[c][lane] = other.colours[c][lane];
        }
        (self.spread[lane], self.count[lane]) = (other.spread[lane], other.count[lane]);
    }
}

impl<'a> Lanes<'a> {
    fn new(window: &'a [&'a PreparedFrame], each: &[Lane], before: usize, gather: &Gather) -> Self {
        let mut powers = vec![[0.0; LANES]; gather.frames as usize + 1];
        let mut seen = [0.0; LANES];
        for (i, lane) in each.iter().enumerate() {
            let mut power = 1.0f32;
            for of in &mut powers {
                of[i] = power;
                power *= decay(gather, lane.slot.kind);
            }
            seen[i] = if Class::of(lane.slot.kind) == Class::Seen { 1.0 } else { 0.0 };
        }
        let there = |frame: &&'a PreparedFrame| {
            let (mut places, mut means, mut known) = ([Place::Unknown; LANES], [None; LANES], [0.0; LANES]);
            for (i, lane) in each.iter().enumerate() {
                places[i] = match Place::of(frame, lane.slot.light) {
                    Place::At(first) => Place::At(first + lane.plane),
                    other => other,
                };
                means[i] = frame.means.places.get(lane.slot.light).copied().flatten();
                known[i] = if places[i] == Place::Unknown { 0.0 } else { 1.0 };
            }
            let packed = |(i, place): (usize, &Place)| *place == Place::At(before + i);
            let met = |(i, place): (usize, &Option<usize>)| *place == Some(before + i);
            let n = each.len();
            let run = frame.samples.beyond.is_empty()
                && places[..n].iter().enumerate().all(packed)
                && means[..n].iter().enumerate().all(met);
            let (samples, light) = (Eights::new(&frame.samples.data), Eights::new(&frame.means.data));
            There { frame, samples, light, run: run.then_some(before), places, means, known }
        };
        Self {
            each: each.to_vec(),
            reflects: each.iter().any(Lane::reflects),
            powers,
            seen,
            frames: window.iter().map(there).collect(),
        }
    }

    /// The weighted mean of every plane over what was met, and what it is worth.
    #[inline(always)]
    fn mean<S: Simd>(&self, simd: S, job: &Job<'_>, p: usize, met: Met<'_>) -> Means {
        let splat = |v: f32| f32x8::splat(simd, v);
        let load = |v: &[f32; LANES]| -> f32x8<S> { (*v).simd_into(simd) };
        let luminance = |c: &[f32x8<S>; 3]| c[0] * LUMINANCE[0] + c[1] * LUMINANCE[1] + c[2] * LUMINANCE[2];
        let (zero, one) = (splat(0.0), splat(1.0));
        let [here, deviation] = self.frames[job.centre].means(simd, p);
        let free = deviation.simd_lt(zero);
        let own = deviation.max(zero);
        let own = own * own;
        let seen = load(&self.seen);
        // Moments about the first sample: differences of large numbers lose less.
        let pivot = luminance(&self.frames[job.centre].samples(simd, p));
        let mut sums = [zero; 3];
        let (mut total, mut squares, mut second) = (zero, zero, zero);
        let likeness = Likeness::new(simd, job.gather);
        for (k, (tap, alike)) in met.taps.iter().zip(met.likeness).enumerate() {
            let there = &self.frames[tap.frame as usize];
            let alike = seen.simd_gt(zero).select(splat(*alike), one);
            let mut weight = load(&self.powers[tap.distance as usize]) * tap.weight * alike * load(&there.known);
            let pixel = tap.pixel as usize;
            if k > 0 {
                weight *= likeness.of(here, own, there.means(simd, pixel));
                // Without noise: itself alone.
                weight = free.select(zero, weight);
            }
            let sample = there.samples(simd, pixel);
            for c in 0..3 {
                sums[c] += weight * sample[c];
            }
            let off = luminance(&sample) - pivot;
            second += weight * off * off;
            total += weight;
            squares += weight * weight;
        }
        let colours = [sums[0] / total, sums[1] / total, sums[2] / total];
        let count = free.select(splat(FREE_COUNT), total * total / squares);
        let mean = luminance(&colours) - pivot;
        let spread = (second / total - mean * mean).max(zero);
        let sure = count.simd_gt(splat(LEAST_COUNT));
        let spread = free.select(zero, sure.select(spread * count / (count - one), zero));
        Means { colours: three(|c| colours[c].into()), spread: spread.into(), count: count.into() }
    }
}

impl There<'_> {
    /// Red, green and blue of a pixel.
    #[inline(always)]
    fn samples<S: Simd>(&self, simd: S, pixel: usize) -> [f32x8<S>; 3] {
        let samples = &self.frame.samples;
        match self.run {
            Some(first) => {
                let at = 3 * pixel * samples.planes + first;
                three(|c| self.samples.widen(simd, at + c * samples.planes))
            }
            None => {
                let found = self.scattered_samples(pixel);
                three(|c| found[c].simd_into(simd))
            }
        }
    }

    #[cold]
    fn scattered_samples(&self, pixel: usize) -> [[f32; LANES]; 3] {
        let mut found = [[0.0; LANES]; 3];
        for (i, place) in self.places.iter().enumerate() {
            if let Place::At(plane) = place {
                let colour = self.frame.samples.at(*plane, pixel);
                (0..3).for_each(|c| found[c][i] = colour[c]);
            }
        }
        found
    }

    /// Means of the light around a pixel, and their deviations.
    #[inline(always)]
    fn means<S: Simd>(&self, simd: S, pixel: usize) -> [f32x8<S>; 2] {
        let means = &self.frame.means;
        match self.run {
            Some(first) => {
                let at = 2 * pixel * means.lights + first;
                let (mean, deviation) = (self.light.widen(simd, at), self.light.widen(simd, at + means.lights));
                [mean * means.scale, deviation * means.scale]
            }
            None => {
                let [means, deviations] = self.scattered_means(pixel);
                [means.simd_into(simd), deviations.simd_into(simd)]
            }
        }
    }

    #[cold]
    fn scattered_means(&self, pixel: usize) -> [[f32; LANES]; 2] {
        let mut found = [[0.0; LANES]; 2];
        for (i, place) in self.means.iter().enumerate() {
            let mean = mean_of(self.frame, *place, pixel);
            (0..2).for_each(|c| found[c][i] = mean[c]);
        }
        found
    }
}

/// What is left of a sample's weight where its light differs by more than noise from the light here.
struct Likeness<S: Simd> {
    noise: f32x8<S>,
    contrast: f32x8<S>,
    low: f32x8<S>,
    range: f32x8<S>,
}

impl<S: Simd> Likeness<S> {
    #[inline(always)]
    fn new(simd: S, s: &Gather) -> Self {
        let (low, high) = (s.light_deviations, s.light_deviations_high);
        let splat = |v: f32| f32x8::splat(simd, v);
        Self {
            noise: splat(s.light_noise),
            contrast: splat(s.light_contrast),
            low: splat(low * low),
            range: splat((high * high - low * low).max(0.0)),
        }
    }

    /// `own`: squared deviation of the mean here.
    #[inline(always)]
    fn of(&self, here: f32x8<S>, own: f32x8<S>, [there, deviation]: [f32x8<S>; 2]) -> f32x8<S> {
        let d = here - there;
        let mean = (here + there) * 0.5;
        let b = deviation.max(0.0);
        let noise = own + b * b;
        let scale = self.noise * mean;
        let share = noise / (noise + scale * scale + LEAST_NOISE);
        let contrast = self.contrast * mean;
        let allowed = (self.low + self.range * share) * noise + contrast * contrast;
        let squared = d * d;
        let left = allowed / squared;
        let left = left * left;
        squared.simd_le(allowed).select(1.0f32.simd_into(d.simd), left * left)
    }
}
