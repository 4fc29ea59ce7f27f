//! Guide distances of sixteen pixels of a row at once: the fast twin of [`super::guide_distance`].

use super::guide_distance::{APART, FARTHEST, LEAST_BASE, LEAST_TOLERANCE};
use super::lanes::{self, BLOCK, load_row, load_within};
use crate::par::{self, Scratch};
use crate::sequence::settings::Wavelet;
use crate::window::{Class, LocalFeatures, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};

/// Classes of light ([`Class`]).
pub(crate) const CLASSES: usize = Class::ALL.len();

/// [`super::guide_distance::weight`] on lanes.
#[inline(always)]
pub(crate) fn weight<S: Simd>(distance: f32x16<S>) -> f32x16<S> {
    let zero = f32x16::splat(distance.simd, 0.0);
    let b = 1.0 - distance * (1.0 / FARTHEST);
    let mut b = b.simd_ge(f32x16::splat(distance.simd, LEAST_BASE)).select(b, zero);
    b *= b;
    b *= b;
    b *= b;
    b * b
}

/// One tap of a kernel, for the pixels of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tap {
    /// Pixels to the right and down, in steps of the kernel.
    pub dx: isize,
    pub dy: isize,
    /// The same in pixels.
    pub offset: [isize; 2],
    /// The row that it lies in.
    pub row: usize,
    /// What [`reach_of`] finds.
    reach: f32,
}

impl Tap {
    pub(crate) fn is_centre(&self) -> bool {
        self.dx == 0 && self.dy == 0
    }

    /// The same tap in an image whose rows count from `first` on.
    #[inline(always)]
    pub(crate) fn counted_from(self, first: usize) -> Self {
        Self { row: self.row - first, ..self }
    }

    /// The column of the tap of pixel `x`.
    #[inline(always)]
    fn column(&self, x: usize) -> isize {
        x as isize + self.offset[0]
    }

    /// Where the tap of a row's first pixel lies in channel 0 of an image, or would: found once for all channels and pixels.
    #[inline(always)]
    pub(crate) fn start(&self, rows: &Rows) -> usize {
        rows.start(self.row, 0).wrapping_add_signed(self.offset[0])
    }

    /// [`Self::of`], with what [`Self::start`] found and with `data`, the image's values from its first row's channel on.
    #[inline(always)]
    pub(crate) fn at<const EDGE: bool, S: Simd>(
        &self,
        simd: S,
        (rows, channel): (&Rows, usize),
        (data, start): (&[f32], usize),
        x: usize,
    ) -> f32x16<S> {
        if EDGE { self.of::<true, _>(simd, rows, channel, x) } else { load_within(simd, data, start.wrapping_add(x)) }
    }

    /// A channel of the taps of the sixteen pixels from `x` on.
    #[inline(always)]
    pub(crate) fn of<const EDGE: bool, S: Simd>(&self, simd: S, rows: &Rows, channel: usize, x: usize) -> f32x16<S> {
        load_row::<EDGE, _>(simd, rows.data(), rows.start(self.row, channel), rows.size().width, self.column(x))
    }

    /// `weight`, and nothing for those of the sixteen pixels from `x` on whose tap lies beyond a row of `w`.
    #[inline(always)]
    pub(crate) fn inside<const EDGE: bool, S: Simd>(&self, x: usize, w: usize, weight: f32x16<S>) -> f32x16<S> {
        let at = self.column(x);
        if !EDGE || lanes::whole(at, w) {
            return weight;
        }
        let (simd, zero) = (weight.simd, f32x16::splat(weight.simd, 0.0));
        let inside: f32x16<S> = lanes::inside(at, w).simd_into(simd);
        inside.simd_gt(zero).select(weight, zero)
    }
}

/// Three channels of the taps of the sixteen pixels from `x` on.
#[inline(always)]
pub(crate) fn three_rows<const EDGE: bool, S: Simd>(
    simd: S,
    rows: &Rows,
    tap: &Tap,
    first: usize,
    x: usize,
) -> [f32x16<S>; 3] {
    [
        tap.of::<EDGE, _>(simd, rows, first, x),
        tap.of::<EDGE, _>(simd, rows, first + 1, x),
        tap.of::<EDGE, _>(simd, rows, first + 2, x),
    ]
}

/// Guide distances of taps from sixteen pixels of a row, for the classes of light that are wanted.
pub(crate) struct Guides<'a, S: Simd, const EDGE: bool> {
    simd: S,
    local: &'a LocalFeatures,
    s: &'a Wavelet,
    wanted: [bool; CLASSES],
    centre: Place,
    inverse_depth: f32x16<S>,
    slope: [f32x16<S>; 2],
    /// What the noise of depth adds to its tolerance.
    noise: f32x16<S>,
    surface: Normals<S>,
    /// What multiplies the distance of normals.
    bend: f32x16<S>,
    /// What mirrors and glass show, and the colour of the surface; zeros where they are not compared.
    seen_albedo: [f32x16<S>; 3],
    seen: Normals<S>,
    albedo: [f32x16<S>; 3],
}

/// Where a class of light compares a buffer: it is wanted, and the buffer is there.
#[inline(always)]
fn compares(wanted: &[bool; CLASSES], class: Class, planes: &[Vec<f32>; 3]) -> bool {
    wanted[class as usize] && !planes[0].is_empty()
}

impl<'a, S: Simd, const EDGE: bool> Guides<'a, S, EDGE> {
    /// Of the pixels from (x, y) on.
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        local: &'a LocalFeatures,
        s: &'a Wavelet,
        wanted: [bool; CLASSES],
        [x, y]: [usize; 2],
    ) -> Self {
        let at = Place { w: local.size.width, y, x: x as isize };
        let zero = f32x16::splat(simd, 0.0);
        let rough = at.of::<EDGE, _>(simd, &local.normal_noise) * (s.guide_noise * s.normal) + 1.0;
        let of = |class, planes: &[Vec<f32>; 3]| {
            if compares(&wanted, class, planes) { at.of_three::<EDGE, _>(simd, planes) } else { [zero; 3] }
        };
        Self {
            simd,
            local,
            s,
            wanted,
            centre: at,
            inverse_depth: at.of::<EDGE, _>(simd, &local.inverse_depth),
            slope: [at.of::<EDGE, _>(simd, &local.slope[0]), at.of::<EDGE, _>(simd, &local.slope[1])],
            noise: at.of::<EDGE, _>(simd, &local.depth_noise) * s.guide_noise,
            surface: Normals::new(at.of_three::<EDGE, _>(simd, &local.normal)),
            bend: f32x16::splat(simd, s.normal) / rough,
            seen_albedo: of(Class::Seen, &local.seen_albedo),
            seen: Normals::new(of(Class::Seen, &local.seen_normal)),
            albedo: of(Class::Coloured, &local.albedo),
        }
    }

    /// The distances of a tap, class by class; those that are not wanted are 0.
    #[inline(always)]
    fn distances(&self, tap: &Tap) -> [f32x16<S>; CLASSES] {
        let (simd, local, s) = (self.simd, self.local, self.s);
        let there = Place { y: tap.row, x: self.centre.x + tap.offset[0], ..self.centre };
        let zero = f32x16::splat(simd, 0.0);
        let mut out = [zero; CLASSES];
        if !(self.wanted[0] || self.wanted[1] || self.wanted[2]) {
            return out;
        }
        let [dx, dy] = tap.offset;
        let (iz_p, iz_q) = (self.inverse_depth, there.of::<EDGE, _>(simd, &local.inverse_depth));
        let along = self.slope[0] * dx as f32 + self.slope[1] * dy as f32;
        let miss = iz_q - iz_p - along;
        let tolerance = iz_p * (self.noise + tap.reach) + along.abs() * s.slope_error + LEAST_TOLERANCE;
        let r = miss / tolerance;
        let differ = iz_p.simd_gt(zero) ^ iz_q.simd_gt(zero);
        let bend = self.surface.bend(&there.of_three::<EDGE, _>(simd, &local.normal));
        let surface = differ.select(f32x16::splat(simd, APART), r * r + bend * self.bend);
        out[Class::Surface as usize] = surface;
        if self.wanted[Class::Seen as usize] {
            let mut seen = surface;
            if !local.seen_albedo[0].is_empty() {
                seen = colours(
                    seen,
                    &self.seen_albedo,
                    &there.of_three::<EDGE, _>(simd, &local.seen_albedo),
                    s.seen_albedo,
                );
            }
            if !local.seen_normal[0].is_empty() {
                seen += self.seen.bend(&there.of_three::<EDGE, _>(simd, &local.seen_normal)) * s.seen_normal;
            }
            out[Class::Seen as usize] = seen;
        }
        if self.wanted[Class::Coloured as usize] {
            out[Class::Coloured as usize] = if local.albedo[0].is_empty() {
                surface
            } else {
                colours(surface, &self.albedo, &there.of_three::<EDGE, _>(simd, &local.albedo), s.albedo)
            };
        }
        out
    }
}

/// `distance` and that of two colours.
#[inline(always)]
fn colours<S: Simd>(mut distance: f32x16<S>, p: &[f32x16<S>; 3], q: &[f32x16<S>; 3], tolerance: f32) -> f32x16<S> {
    let scale = 0.5 / (tolerance * tolerance);
    for c in 0..3 {
        let d = p[c] - q[c];
        distance += d * scale * d;
    }
    distance
}

/// Normals of sixteen pixels.
struct Normals<S: Simd> {
    each: [f32x16<S>; 3],
    /// More than 0 where there is one.
    length: f32x16<S>,
}

impl<S: Simd> Normals<S> {
    #[inline(always)]
    fn new(each: [f32x16<S>; 3]) -> Self {
        let length = each[0].abs() + each[1].abs() + each[2].abs();
        Self { each, length }
    }

    /// 1 - cosine between them and others; 0 where both have none.
    #[inline(always)]
    fn bend(&self, others: &[f32x16<S>; 3]) -> f32x16<S> {
        let [a, b, c] = self.each;
        let cosine = a * others[0] + b * others[1] + c * others[2];
        let length = self.length + others[0].abs() + others[1].abs() + others[2].abs();
        let zero = f32x16::splat(cosine.simd, 0.0);
        length.simd_gt(zero).select(1.0 - cosine, zero)
    }
}

/// What a tap's distance adds to the tolerance of depth.
fn reach_of([dx, dy]: [isize; 2], s: &Wavelet) -> f32 {
    let apart = ((dx * dx + dy * dy) as f32).sqrt();
    s.depth * (s.depth_near + s.depth_far * apart)
}

/// Sixteen pixels of a row: its width, the row, the first column.
#[derive(Clone, Copy)]
struct Place {
    w: usize,
    y: usize,
    x: isize,
}

impl Place {
    #[inline(always)]
    fn of<const EDGE: bool, S: Simd>(&self, simd: S, plane: &[f32]) -> f32x16<S> {
        load_row::<EDGE, _>(simd, plane, self.y * self.w, self.w, self.x)
    }

    #[inline(always)]
    fn of_three<const EDGE: bool, S: Simd>(&self, simd: S, planes: &[Vec<f32>; 3]) -> [f32x16<S>; 3] {
        [
            self.of::<EDGE, _>(simd, &planes[0]),
            self.of::<EDGE, _>(simd, &planes[1]),
            self.of::<EDGE, _>(simd, &planes[2]),
        ]
    }
}

/// Blocks of pixels whose distances are found before the first light is filtered: their channels are read light by light, each in runs of
/// a page of memory, which is as far as a processor fetches ahead. Block by block, all lights' channels of three rows are a hundred
/// streams at once, more than it follows: at 1920x1080 the wavelet took 1.5 times as long so (docs/performance.md). One in tests, so that small
/// pictures have several.
pub(crate) const RUN: usize = if cfg!(test) { 1 } else { 64 };

/// Guide distances of all taps of a kernel from the pixels of a [`RUN`] of blocks.
pub(crate) struct Distances {
    /// How far taps lie to the left and right, in pixels.
    far: usize,
    /// The taps that lie in the image's rows.
    taps: Vec<Tap>,
    /// Of each class, block by block and tap by tap; those of classes that are not wanted mean nothing.
    distances: Scratch,
}

impl Distances {
    /// Of a kernel with up to `radius` steps of `step` pixels each way, around the pixels of row `y` of an image of `h` rows.
    pub(crate) fn new(radius: usize, step: isize, y: usize, h: usize, s: &Wavelet) -> Self {
        let radius = radius as isize;
        let mut taps = Vec::new();
        for dy in -radius..=radius {
            let Some(row) = y.checked_add_signed(dy * step).filter(|row| *row < h) else { continue };
            for dx in -radius..=radius {
                let offset = [dx * step, dy * step];
                taps.push(Tap { dx, dy, offset, row, reach: reach_of(offset, s) });
            }
        }
        let distances = par::unset_scratch(CLASSES * RUN * taps.len() * BLOCK);
        Self { far: (radius * step) as usize, taps, distances }
    }

    /// True where some taps of the pixels from `x` on may lie outside of a row of `w`: `EDGE` for what follows.
    pub(crate) fn reach_edge(&self, x: usize, w: usize) -> bool {
        x < self.far || x + BLOCK + self.far > w
    }

    /// Where the distances of a block begin.
    #[inline(always)]
    fn start(&self, block: usize, class: usize) -> usize {
        (class * RUN + block) * self.taps.len()
    }

    /// Finds the distances of a block of the run.
    #[inline(always)]
    pub(crate) fn find<S: Simd, const EDGE: bool>(&mut self, block: usize, guides: &Guides<'_, S, EDGE>) {
        for i in 0..self.taps.len() {
            let tap = self.taps[i];
            // A pixel's distance from itself is 0.
            let found =
                if tap.is_centre() { [f32x16::splat(guides.simd, 0.0); CLASSES] } else { guides.distances(&tap) };
            for class in 0..CLASSES {
                if guides.wanted[class] {
                    let at = (self.start(block, class) + i) * BLOCK;
                    found[class].store_slice(&mut self.distances[at..at + BLOCK]);
                }
            }
        }
    }

    /// From distances of a block to [`weight`]s, for all lights of a class at once.
    #[inline(always)]
    pub(crate) fn weigh<S: Simd>(&mut self, simd: S, block: usize, wanted: [bool; CLASSES]) {
        for class in 0..CLASSES {
            let start = self.start(block, class) * BLOCK;
            if wanted[class] {
                for distance in self.distances[start..][..self.taps.len() * BLOCK].as_chunks_mut::<BLOCK>().0 {
                    weight(f32x16::from_slice(simd, distance)).store_slice(distance);
                }
            }
        }
    }

    /// The taps.
    #[inline(always)]
    pub(crate) fn taps(&self) -> &[Tap] {
        &self.taps
    }

    /// The distances of a block for a class of light, tap by tap.
    #[inline(always)]
    pub(crate) fn of(&self, block: usize, class: Class) -> &[[f32; BLOCK]] {
        let start = self.start(block, class as usize) * BLOCK;
        self.distances[start..][..self.taps.len() * BLOCK].as_chunks().0
    }
}
