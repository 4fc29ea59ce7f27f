//! The mean of the samples met along each surface's trajectory, its variance, and how many samples it is worth: on all
//! threads, one trajectory for all lights, eight colour planes at once on vectors; the frames of the window one after the
//! other for some pixels of a row, so that few runs of memory are read at a time.

use super::seen::{Eight, Seen};
use super::trajectory::{Met, Pair, Way};
use super::{FREE_COUNT, Gathered, LANES, LEAST_COUNT, LEAST_NOISE, Place, decay, lit, mean_of};
use crate::kernels::halves::{Eights, Runs, widen_from};
use crate::kernels::math::{LUMINANCE, three};
use crate::par;
use crate::sequence::settings::Gather;
use crate::simd::dispatch;
use crate::window::{Class, Features, LightSlot, PreparedFrame, Rows, Samples};
use fearless_simd::{Simd, f32x8, prelude::*};
use half::f16;

/// Means over the window for every light of `window[centre]`.
pub(crate) fn run(window: &[&PreparedFrame], centre: usize, gather: &Gather) -> Gathered {
    let slots = lit(window, centre);
    let size = window[centre].features.size;
    let job = Job::new(window, centre, &slots, gather);
    let planes = slots.iter().map(|s| s.planes).sum::<usize>();
    let mut colours = Rows::unset(size, 3 * planes);
    let mut moments = Rows::unset(size, 2 * slots.len());
    let (cw, mw) = (3 * planes * size.width, 2 * slots.len() * size.width);
    par::two_rows(colours.data_mut(), STRIP * cw, moments.data_mut(), STRIP * mw, |k, colours, moments| {
        dispatch!(crate::simd::level(), simd => job.strip(simd, STRIP * k, colours, moments));
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
    /// Of each frame [`Features::mirror_bits`], where that is so.
    mirrors: Vec<Vec<u64>>,
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
        let mut mirrors = vec![Vec::new(); window.len()];
        if looks_through {
            par::rows(&mut mirrors, 1, |frame, bits| bits[0] = window[frame].features.mirror_bits());
        }
        Self { window, centre, slots, gather, looks_through, mirrors, lanes: lanes.collect() }
    }

    /// What a frame shows in mirrors and through glass, where that is compared.
    #[inline(always)]
    fn seen(&self, frame: usize) -> Option<Seen<'_>> {
        Seen::new(&self.window[frame].features, &self.mirrors[frame]).filter(|_| self.looks_through)
    }

    /// Some rows from row `first_row` on: a block of columns after the other, in all rows, which lead to the same surfaces.
    #[inline(always)]
    fn strip<S: Simd>(&self, simd: S, first_row: usize, colours: &mut [f32], moments: &mut [f32]) {
        let here = self.window[self.centre];
        let w = here.features.size.width;
        let rows = moments.len() / (2 * self.slots.len() * w);
        let (cw, mw) = (colours.len() / rows, moments.len() / rows);
        for k in 0..rows {
            self.copy_own(first_row + k, &mut colours[k * cw..][..cw], &mut moments[k * mw..][..mw]);
        }
        let new = || Block {
            ways: Vec::with_capacity(GROUPS),
            sums: vec![Sums::default(); BLOCK.min(w.next_multiple_of(LANES)) * self.lanes.len()],
            met: [Met::default(); GROUPS],
            own: [Eight::default(); GROUPS],
        };
        let (mut surface, mut reflected) = (new(), None::<Block<S>>);
        for (first, k) in (0..w).step_by(BLOCK).flat_map(|first| (0..rows).map(move |k| (first, k))) {
            let (colours, moments) = (&mut colours[k * cw..][..cw], &mut moments[k * mw..][..mw]);
            let p = (first_row + k) * w + first;
            let count = BLOCK.min(w - first);
            let whole = count.next_multiple_of(LANES);
            let mut inside = [false; BLOCK];
            inside[..count].fill(true);
            let mut mirrors = inside;
            mirrors.iter_mut().enumerate().for_each(|(i, m)| *m = *m && here.features.is_mirror(p + i));
            surface.walk(simd, self, p, &inside[..whole], false);
            if mirrors.contains(&true) {
                reflected.get_or_insert_with(new).walk(simd, self, p, &mirrors[..whole], true);
            }
            for i in 0..count {
                for (k, lanes) in self.lanes.iter().enumerate() {
                    let place = i * self.lanes.len() + k;
                    let mut mean = surface.sums[place].mean(simd);
                    if let (true, Some(reflected)) = (mirrors[i] && lanes.reflects, &reflected) {
                        let other = reflected.sums[place].mean(simd);
                        for (i, _) in lanes.each.iter().enumerate().filter(|(_, lane)| lane.reflects()) {
                            mean.take(&other, i);
                        }
                    }
                    lanes.store(&mean, first + i, w, colours, moments);
                }
            }
        }
    }

    /// Lights that stay as they came, in row `y`.
    fn copy_own(&self, y: usize, colours: &mut [f32], moments: &mut [f32]) {
        let here = self.window[self.centre];
        let w = here.features.size.width;
        for (l, slot) in self.slots.iter().enumerate() {
            if let Samples::Own(own) = &here.stored[slot.light] {
                for (k, plane) in own.iter().enumerate() {
                    for x in 0..w {
                        let value = plane.at(y * w + x);
                        for c in 0..3 {
                            colours[(3 * (slot.first + k) + c) * w + x] = value[c];
                        }
                    }
                }
                moments[2 * l * w..][..w].fill(0.0);
                moments[(2 * l + 1) * w..][..w].fill(1.0);
            }
        }
    }
}

/// Pixels of a row that go through the frames of the window together: what they read of a frame is a few runs of memory, long enough
/// that a processor fetches ahead. With 64 pixels `gather` took a fifth more time at 1280x720, with 128 3 % (docs/performance.md).
/// Few in tests, so that small pictures have several runs.
const BLOCK: usize = if cfg!(test) { 16 } else { 256 };
const GROUPS: usize = BLOCK / LANES;
/// Rows that follow each other before the next block of columns.
const STRIP: usize = if cfg!(test) { 3 } else { 4 };

/// What is known of the pixels of a block on their way through the frames.
struct Block<S: Simd> {
    ways: Vec<Way<S>>,
    /// Of each pixel, for each eight planes.
    sums: Vec<Sums>,
    /// Of each eight pixels.
    met: [Met; GROUPS],
    /// What each eight pixels show in mirrors and through glass.
    own: [Eight; GROUPS],
}

impl<S: Simd> Block<S> {
    /// Sums up what the pixels from `first` on meet in all frames, those of whole groups that are `wanted`.
    #[inline(always)]
    fn walk(&mut self, simd: S, job: &Job<'_>, first: usize, wanted: &[bool], reflected: bool) {
        let seen = job.seen(job.centre);
        for (g, wanted) in wanted.as_chunks::<LANES>().0.iter().enumerate() {
            if !wanted.contains(&true) {
                continue;
            }
            let pixels = first + LANES * g;
            let mut alike = [1.0; LANES];
            if let Some(seen) = seen {
                let mut places = [0i32; LANES];
                for i in (0..LANES).filter(|i| wanted[*i]) {
                    places[i] = (pixels + i) as i32;
                }
                self.own[g] = Eight::new(simd, seen, &places);
                alike = self.own[g].likeness(simd, job.gather, seen, &places).into();
            }
            for i in (0..LANES).filter(|i| wanted[*i]) {
                for (k, lanes) in job.lanes.iter().enumerate() {
                    self.sums[(LANES * g + i) * job.lanes.len() + k] =
                        lanes.begin(simd, job.centre, pixels + i, alike[i]);
                }
            }
        }
        self.follow(simd, job, first, wanted, (false, reflected));
        if job.gather.future {
            self.follow(simd, job, first, wanted, (true, reflected));
        }
    }

    /// The frames before, or those after, nearest first.
    #[inline(always)]
    fn follow(&mut self, simd: S, job: &Job<'_>, first: usize, wanted: &[bool], (forward, reflected): (bool, bool)) {
        let (window, centre) = (job.window, job.centre);
        let here = &window[centre].features;
        let steps = if forward { window.len() - 1 - centre } else { centre }.min(job.gather.frames as usize);
        self.ways.clear();
        for (g, wanted) in wanted.as_chunks::<LANES>().0.iter().enumerate() {
            self.ways.push(Way::new(simd, here, first + LANES * g, wanted));
        }
        for k in 1..=steps {
            let (from, to) = if forward { (centre + k - 1, centre + k) } else { (centre + 1 - k, centre - k) };
            let pair = Pair { from: window[from], to: window[to], forward, reflected };
            let (mut met_any, seen) = (false, job.seen(to));
            for ((way, met), own) in self.ways.iter_mut().zip(&mut self.met).zip(&self.own) {
                if way.goes_on() {
                    way.step(simd, pair, seen.map(|seen| (own, seen)), job.gather, met);
                    fetch(window[to], met);
                    met_any = true;
                } else {
                    met.weights = [0.0; LANES];
                }
            }
            if !met_any {
                break;
            }
            for (g, met) in self.met[..self.ways.len()].iter().enumerate() {
                if met.weights == [0.0; LANES] {
                    continue;
                }
                for i in (0..LANES).filter(|i| met.weights[*i] != 0.0) {
                    let (pixel, share) = (met.pixels[i] as usize, (met.weights[i], met.alike[i]));
                    let sums = &mut self.sums[(LANES * g + i) * job.lanes.len()..];
                    for (lanes, sums) in job.lanes.iter().zip(sums) {
                        let there = &lanes.frames[to];
                        let add = Adding { s: job.gather, lanes, to, distance: k, share };
                        // No function is called where there is a run.
                        if let Some(few) = &there.few {
                            add.to(simd, few.means(simd, pixel), few.samples(simd, pixel), sums);
                        } else if let Some(first) = there.run {
                            let light = there.means_beside(simd, first, pixel);
                            add.to(simd, light, there.samples_beside(simd, first, pixel), sums);
                        } else {
                            scattered(simd, there, &add, pixel, sums);
                        }
                    }
                }
            }
        }
    }
}

/// Adds a sample whose planes do not lie side by side, apart from the loop around.
#[inline(always)]
fn scattered<S: Simd>(simd: S, there: &There<'_>, add: &Adding<'_>, pixel: usize, sums: &mut Sums) {
    simd.vectorize(
        #[inline(always)]
        || add.to(simd, there.means(simd, pixel), there.samples(simd, pixel), sums),
    );
}

/// Reads what will be summed, all at once, so that the memory serves many at a time: in the sums each would be waited for.
#[inline(always)]
fn fetch(frame: &PreparedFrame, met: &Met) {
    let first = |data: &[f16], at: usize| data.get(at).map_or(0, |half| half.to_bits());
    let mut read = 0;
    for (pixel, weight) in met.pixels.iter().zip(&met.weights) {
        if *weight != 0.0 {
            let pixel = *pixel as usize;
            read ^= first(&frame.samples.data, 3 * frame.samples.planes * pixel);
            read ^= first(&frame.means.data, 2 * frame.means.lights * pixel);
        }
    }
    std::hint::black_box(read);
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
    /// The same where there are no others.
    few: Option<Few<'a>>,
    places: [Place; LANES],
    means: [Option<usize>; LANES],
    /// 0 where nothing is known of a light.
    known: [f32; LANES],
}

/// A frame with up to eight planes and as many lights: what is read of a pixel lies in two runs.
struct Few<'a> {
    samples: Runs<'a, { 3 * LANES }>,
    light: Runs<'a, { 2 * LANES }>,
    planes: usize,
    lights: usize,
    scale: f32,
}

impl<'a> Few<'a> {
    fn new(frame: &'a PreparedFrame) -> Option<Self> {
        let (planes, lights) = (frame.samples.planes, frame.means.lights);
        if planes > LANES || lights > LANES {
            return None;
        }
        let (samples, light) = (Runs::new(&frame.samples.data), Runs::new(&frame.means.data));
        Some(Self { samples, light, planes, lights, scale: frame.means.scale })
    }

    /// As [`There::samples_beside`].
    #[inline(always)]
    fn samples<S: Simd>(&self, simd: S, pixel: usize) -> [f32x8<S>; 3] {
        // That they are no more is plain to the compiler so.
        let planes = self.planes.min(LANES);
        let run = self.samples.at(3 * pixel * self.planes);
        [widen_from(simd, run, 0), widen_from(simd, run, planes), widen_from(simd, run, 2 * planes)]
    }

    /// As [`There::means_beside`].
    #[inline(always)]
    fn means<S: Simd>(&self, simd: S, pixel: usize) -> [f32x8<S>; 2] {
        let lights = self.lights.min(LANES);
        let light = self.light.at(2 * pixel * self.lights);
        [widen_from(simd, light, 0) * self.scale, widen_from(simd, light, lights) * self.scale]
    }
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
            let run = run.then_some(before);
            let few = run.and_then(|_| Few::new(frame));
            There { frame, samples, light, run, few, places, means, known }
        };
        Self {
            each: each.to_vec(),
            reflects: each.iter().any(Lane::reflects),
            powers,
            seen,
            frames: window.iter().map(there).collect(),
        }
    }

    /// A pixel's own sample.
    #[inline(always)]
    fn begin<S: Simd>(&self, simd: S, centre: usize, p: usize, alike: f32) -> Sums {
        let load = |v: &[f32; LANES]| -> f32x8<S> { (*v).simd_into(simd) };
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let there = &self.frames[centre];
        let [here, deviation] = there.means(simd, p);
        let sample = there.samples(simd, p);
        let alike = load(&self.seen).simd_gt(zero).select(f32x8::splat(simd, alike), one);
        let weight = load(&self.powers[0]) * alike * load(&there.known);
        let zeros = [0.0; LANES];
        Sums {
            here: here.into(),
            deviation: deviation.into(),
            pivot: luminance(&sample).into(),
            colours: three(|c| (zero + weight * sample[c]).into()),
            total: weight.into(),
            squares: (weight * weight).into(),
            second: zeros,
        }
    }

    /// Writes the means of pixel `x` of a row.
    #[inline(always)]
    fn store(&self, mean: &Means, x: usize, w: usize, colours: &mut [f32], moments: &mut [f32]) {
        for (i, lane) in self.each.iter().enumerate() {
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

#[inline(always)]
fn luminance<S: Simd>(c: &[f32x8<S>; 3]) -> f32x8<S> {
    c[0] * LUMINANCE[0] + c[1] * LUMINANCE[1] + c[2] * LUMINANCE[2]
}

/// What one pixel has met of eight planes so far.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Mean of the light here and its deviation; below 0: it has no noise.
    here: [f32; LANES],
    deviation: [f32; LANES],
    /// Luminance of the first sample: moments about it lose less than differences of large numbers.
    pivot: [f32; LANES],
    colours: [[f32; LANES]; 3],
    total: [f32; LANES],
    /// Sum of the weights squared.
    squares: [f32; LANES],
    second: [f32; LANES],
}

impl Sums {
    /// The weighted mean of every plane over what was met, and what it is worth.
    #[inline(always)]
    fn mean<S: Simd>(&self, simd: S) -> Means {
        let load = |v: &[f32; LANES]| -> f32x8<S> { (*v).simd_into(simd) };
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let free = load(&self.deviation).simd_lt(zero);
        let [total, squares] = [load(&self.total), load(&self.squares)];
        let sums = &self.colours;
        let colours = [load(&sums[0]) / total, load(&sums[1]) / total, load(&sums[2]) / total];
        let count = free.select(f32x8::splat(simd, FREE_COUNT), total * total / squares);
        let mean = luminance(&colours) - load(&self.pivot);
        let spread = (load(&self.second) / total - mean * mean).max(zero);
        let sure = count.simd_gt(f32x8::splat(simd, LEAST_COUNT));
        let spread = free.select(zero, sure.select(spread * count / (count - one), zero));
        Means { colours: three(|c| colours[c].into()), spread: spread.into(), count: count.into() }
    }
}

/// How a pixel of another frame is added to what eight planes of a pixel have met.
struct Adding<'a> {
    s: &'a Gather,
    lanes: &'a Lanes<'a>,
    /// The frame, and how many frames away it is.
    to: usize,
    distance: usize,
    /// Trust in the surface, and how alike the things are that mirrors and glass show.
    share: (f32, f32),
}

impl Adding<'_> {
    #[inline(always)]
    fn to<S: Simd>(&self, simd: S, light: [f32x8<S>; 2], sample: [f32x8<S>; 3], sums: &mut Sums) {
        let Self { s, lanes, to, distance, share: (share, alike) } = *self;
        let load = |v: &[f32; LANES]| -> f32x8<S> { (*v).simd_into(simd) };
        let (there, zero) = (&lanes.frames[to], f32x8::splat(simd, 0.0));
        let deviation = load(&sums.deviation);
        let own = deviation.max(zero);
        // Deviations below 0: without noise.
        let light = [light[0], light[1].max(zero)];
        let likeness = Likeness::new(simd, s).of(load(&sums.here), own * own, light);
        let weight = load(&lanes.powers[distance]) * load(&there.known) * likeness;
        // Light without noise: the pixel itself alone.
        let weight = deviation.simd_lt(zero).select(zero, weight);
        let shown = load(&lanes.seen).simd_gt(zero);
        let weight = weight * shown.select(f32x8::splat(simd, share * alike), f32x8::splat(simd, share));
        for (sum, sample) in sums.colours.iter_mut().zip(sample) {
            (load(sum) + weight * sample).store_slice(sum);
        }
        let off = luminance(&sample) - load(&sums.pivot);
        (load(&sums.second) + weight * off * off).store_slice(&mut sums.second);
        (load(&sums.total) + weight).store_slice(&mut sums.total);
        (load(&sums.squares) + weight * weight).store_slice(&mut sums.squares);
    }
}

impl There<'_> {
    /// Red, green and blue of a pixel, where those of all planes lie side by side.
    #[inline(always)]
    fn samples_beside<S: Simd>(&self, simd: S, first: usize, pixel: usize) -> [f32x8<S>; 3] {
        let planes = self.frame.samples.planes;
        let at = 3 * pixel * planes + first;
        [self.samples.widen(simd, at), self.samples.widen(simd, at + planes), self.samples.widen(simd, at + 2 * planes)]
    }

    /// Means of the light around a pixel and their deviations, where those of all planes lie side by side.
    #[inline(always)]
    fn means_beside<S: Simd>(&self, simd: S, first: usize, pixel: usize) -> [f32x8<S>; 2] {
        let (lights, scale) = (self.frame.means.lights, self.frame.means.scale);
        let light = 2 * pixel * lights + first;
        [self.light.widen(simd, light) * scale, self.light.widen(simd, light + lights) * scale]
    }

    /// Red, green and blue of a pixel.
    #[inline(always)]
    fn samples<S: Simd>(&self, simd: S, pixel: usize) -> [f32x8<S>; 3] {
        match self.run {
            Some(first) => self.samples_beside(simd, first, pixel),
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
        match self.run {
            Some(first) => self.means_beside(simd, first, pixel),
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
        let noise = own + deviation * deviation;
        let scale = self.noise * mean;
        let share = noise / (noise + scale * scale + LEAST_NOISE);
        let contrast = self.contrast * mean;
        let allowed = (self.low + self.range * share) * noise + contrast * contrast;
        let squared = d * d;
        let left = allowed / squared;
        squared.simd_le(allowed).select(1.0f32.simd_into(d.simd), left * left)
    }
}
