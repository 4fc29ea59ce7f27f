//! Guide distances of sixteen pixels of a row at once: the fast twin of [`super::guide_distance`].

use super::guide_distance::{APART, FARTHEST, LEAST_TOLERANCE};
use super::lanes::{self, BLOCK, load_row};
use crate::sequence::settings::Wavelet;
use crate::window::{Class, LocalFeatures, Rows};
use fearless_simd::{Simd, f32x16, prelude::*};

/// Classes of light ([`Class`]).
pub(crate) const CLASSES: usize = Class::ALL.len();

/// [`super::guide_distance::weight`] on lanes.
#[inline(always)]
pub(crate) fn weight<S: Simd>(distance: f32x16<S>) -> f32x16<S> {
    let zero = f32x16::splat(distance.simd, 0.0);
    let mut b = (1.0 - distance * (1.0 / FARTHEST)).max_precise(zero);
    b *= b;
    b *= b;
    b *= b;
    b * b
}

/// One tap of a kernel, seen from sixteen pixels of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tap {
    /// Pixels to the right and down, in steps of the kernel.
    pub dx: isize,
    pub dy: isize,
    /// The same in pixels.
    pub offset: [isize; 2],
    /// Row of the taps, and the column of the first.
    pub row: usize,
    pub at: isize,
    /// Every pixel's tap lies in the image.
    pub whole: bool,
}

impl Tap {
    pub(crate) fn is_centre(&self) -> bool {
        self.dx == 0 && self.dy == 0
    }

    /// A channel of the taps.
    #[inline(always)]
    pub(crate) fn of<const EDGE: bool, S: Simd>(&self, simd: S, rows: &Rows, channel: usize) -> f32x16<S> {
        load_row::<EDGE, _>(simd, rows.data(), rows.start(self.row, channel), rows.size().width, self.at)
    }
}

/// Nothing for pixels whose tap lies outside of the image.
#[inline(always)]
pub(crate) fn inside<const EDGE: bool, S: Simd>(tap: &Tap, w: usize, weight: f32x16<S>) -> f32x16<S> {
    if !EDGE || tap.whole {
        return weight;
    }
    let (simd, zero) = (weight.simd, f32x16::splat(weight.simd, 0.0));
    let inside: f32x16<S> = lanes::inside(tap.at, w).simd_into(simd);
    inside.simd_gt(zero).select(weight, zero)
}

/// Three channels of the taps.
#[inline(always)]
pub(crate) fn three_rows<const EDGE: bool, S: Simd>(simd: S, rows: &Rows, tap: &Tap, first: usize) -> [f32x16<S>; 3] {
    [
        tap.of::<EDGE, _>(simd, rows, first),
        tap.of::<EDGE, _>(simd, rows, first + 1),
        tap.of::<EDGE, _>(simd, rows, first + 2),
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
    normal: [f32x16<S>; 3],
    /// What divides the distance of normals.
    rough: f32x16<S>,
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
        Self {
            simd,
            local,
            s,
            wanted,
            centre: at,
            inverse_depth: at.of::<EDGE, _>(simd, &local.inverse_depth),
            slope: [at.of::<EDGE, _>(simd, &local.slope[0]), at.of::<EDGE, _>(simd, &local.slope[1])],
            noise: at.of::<EDGE, _>(simd, &local.depth_noise) * s.guide_noise,
            normal: at.of_three::<EDGE, _>(simd, &local.normal),
            rough: at.of::<EDGE, _>(simd, &local.normal_noise) * (s.guide_noise * s.normal) + 1.0,
        }
    }

    /// The distances of a tap, class by class; those that are not wanted are 0.
    #[inline(always)]
    pub(crate) fn distances(&self, tap: &Tap) -> [f32x16<S>; CLASSES] {
        let (simd, local, s) = (self.simd, self.local, self.s);
        let there = Place { y: tap.row, x: tap.at, ..self.centre };
        let zero = f32x16::splat(simd, 0.0);
        let mut out = [zero; CLASSES];
        if !(self.wanted[0] || self.wanted[1] || self.wanted[2]) {
            return out;
        }
        let [dx, dy] = tap.offset;
        let apart = ((dx * dx + dy * dy) as f32).sqrt();
        let reach = s.depth * (s.depth_near + s.depth_far * apart);
        let (iz_p, iz_q) = (self.inverse_depth, there.of::<EDGE, _>(simd, &local.inverse_depth));
        let along = self.slope[0] * dx as f32 + self.slope[1] * dy as f32;
        let miss = iz_q - iz_p - along;
        let tolerance = iz_p * (self.noise + reach) + along.abs() * s.slope_error + LEAST_TOLERANCE;
        let r = miss / tolerance;
        let differ = iz_p.simd_gt(zero) ^ iz_q.simd_gt(zero);
        // Two pixels without normals do not differ in them.
        let bend = bend(&self.normal, &there.of_three::<EDGE, _>(simd, &local.normal));
        let surface = differ.select(f32x16::splat(simd, APART), r * r + bend * s.normal / self.rough);
        out[Class::Surface as usize] = surface;
        if self.wanted[Class::Seen as usize] {
            let mut seen = surface;
            if !local.seen_albedo[0].is_empty() {
                seen = self.colours(seen, &there, &local.seen_albedo, s.seen_albedo);
            }
            if !local.seen_normal[0].is_empty() {
                // The sky in a mirror has none.
                let here = self.centre.of_three::<EDGE, _>(simd, &local.seen_normal);
                seen += self::bend(&here, &there.of_three::<EDGE, _>(simd, &local.seen_normal)) * s.seen_normal;
            }
            out[Class::Seen as usize] = seen;
        }
        if self.wanted[Class::Coloured as usize] {
            out[Class::Coloured as usize] = if local.albedo[0].is_empty() {
                surface
            } else {
                self.colours(surface, &there, &local.albedo, s.albedo)
            };
        }
        out
    }

    #[inline(always)]
    fn colours(&self, mut distance: f32x16<S>, there: &Place, planes: &[Vec<f32>; 3], tolerance: f32) -> f32x16<S> {
        let scale = 0.5 / (tolerance * tolerance);
        let (p, q) = (self.centre.of_three::<EDGE, _>(self.simd, planes), there.of_three::<EDGE, _>(self.simd, planes));
        for c in 0..3 {
            let d = p[c] - q[c];
            distance += d * scale * d;
        }
        distance
    }
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

/// 1 - cosine between normals; 0 where both have none.
#[inline(always)]
fn bend<S: Simd>(p: &[f32x16<S>; 3], q: &[f32x16<S>; 3]) -> f32x16<S> {
    let cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let length = p[0].abs() + p[1].abs() + p[2].abs() + q[0].abs() + q[1].abs() + q[2].abs();
    let zero = f32x16::splat(cosine.simd, 0.0);
    length.simd_gt(zero).select(1.0 - cosine, zero)
}

/// Guide distances of all taps of a kernel from sixteen pixels of a row.
pub(crate) struct Distances {
    radius: isize,
    taps: Vec<Tap>,
    /// Taps that there are.
    count: usize,
    /// Of each class, tap by tap; those of classes that are not wanted are 0.
    by_class: [Vec<[f32; BLOCK]>; CLASSES],
}

impl Distances {
    /// Of a kernel with up to `radius` steps each way.
    pub(crate) fn new(radius: usize) -> Self {
        let most = (2 * radius + 1) * (2 * radius + 1);
        Self {
            radius: radius as isize,
            taps: vec![Tap::default(); most],
            count: 0,
            by_class: std::array::from_fn(|_| vec![[0.0; BLOCK]; most]),
        }
    }

    /// Most taps that there can be.
    pub(crate) fn most(&self) -> usize {
        self.taps.len()
    }

    /// True where some taps of the pixels from `x` on may lie outside of a row of `w`: `EDGE` for what follows.
    pub(crate) fn reach_edge(&self, x: usize, w: usize, step: isize) -> bool {
        let far = (self.radius * step) as usize;
        x < far || x + BLOCK + far > w
    }

    /// Finds those of the taps that lie in an image of `h` rows for some of the pixels, row by row; `step` pixels a step.
    #[inline(always)]
    pub(crate) fn find<S: Simd, const EDGE: bool>(&mut self, guides: &Guides<'_, S, EDGE>, h: usize, step: isize) {
        let Place { w, x, y } = guides.centre;
        self.count = 0;
        for dy in -self.radius..=self.radius {
            let row = y as isize + dy * step;
            if row < 0 || row >= h as isize {
                continue;
            }
            for dx in -self.radius..=self.radius {
                let at = x + dx * step;
                if EDGE && (at + BLOCK as isize <= 0 || at >= w as isize) {
                    continue;
                }
                let whole = !EDGE || lanes::whole(at, w);
                let tap = Tap { dx, dy, offset: [dx * step, dy * step], row: row as usize, at, whole };
                // A pixel's distance from itself is 0.
                let found =
                    if tap.is_centre() { [f32x16::splat(guides.simd, 0.0); CLASSES] } else { guides.distances(&tap) };
                for class in 0..CLASSES {
                    if guides.wanted[class] {
                        found[class].store_slice(&mut self.by_class[class][self.count]);
                    }
                }
                self.taps[self.count] = tap;
                self.count += 1;
            }
        }
    }

    /// The taps with their distances for a class of light.
    #[inline(always)]
    pub(crate) fn of(&self, class: Class) -> impl Iterator<Item = (&Tap, &[f32; BLOCK])> {
        self.taps[..self.count].iter().zip(&self.by_class[class as usize])
    }
}
