//! How the fast back end stores images: every row as four interleaved column phases, columns 0, 4, 8, ... first, then
//! 1, 5, 9, ... and so on, without padding. The spirals of stages 4 and 7 repeat over 4x4 pixels, so that in this
//! order a tap of a whole run of pixels is a run of memory: no gathers.

use crate::frame::Rgb;
use crate::kernels::spiral::PERIOD;
use crate::plane::Size;
use std::ops::Range;

/// The order of pixels in images of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Phases {
    /// Extent of the image.
    pub size: Size,
    /// Where in a row each phase begins; its last entry is the width.
    begin: [usize; PERIOD + 1],
}

/// A run of pixels of one phase of a row, and where a tap's run of source pixels lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// First lane that has a source.
    pub first: usize,
    /// Number of lanes.
    pub len: usize,
    /// Element of the row in which the source of lane `first` lies.
    pub source: usize,
}

impl Phases {
    pub fn new(size: Size) -> Self {
        let mut begin = [0; PERIOD + 1];
        for p in 0..PERIOD {
            begin[p + 1] = begin[p] + (size.width + PERIOD - 1 - p) / PERIOD;
        }
        Self { size, begin }
    }

    /// Number of pixels of a phase in a row.
    #[inline(always)]
    pub fn count(&self, phase: usize) -> usize {
        self.begin[phase + 1] - self.begin[phase]
    }

    /// Most pixels of any phase in a row.
    pub fn longest(&self) -> usize {
        self.count(0)
    }

    /// The elements of a row that hold a phase.
    #[inline(always)]
    pub fn range(&self, phase: usize) -> Range<usize> {
        self.begin[phase]..self.begin[phase + 1]
    }

    /// Element of a row that holds column `x`.
    #[inline(always)]
    pub fn element(&self, x: usize) -> usize {
        self.begin[x % PERIOD] + x / PERIOD
    }

    /// Element of an image of one scalar a pixel.
    #[inline(always)]
    pub fn index(&self, x: usize, y: usize) -> usize {
        y * self.size.width + self.element(x)
    }

    /// For pixels `first..first + lanes` of a phase: where the pixels `dx` columns to the right lie; `None` where all
    /// of them are off the image.
    #[inline(always)]
    pub fn shifted(&self, phase: usize, first: usize, lanes: usize, dx: i32) -> Option<Span> {
        let target = phase as isize + dx as isize;
        let source_phase = target.rem_euclid(PERIOD as isize) as usize;
        let shift = target.div_euclid(PERIOD as isize);
        let low = (first as isize).max(-shift);
        let high = ((first + lanes).min(self.count(phase)) as isize).min(self.count(source_phase) as isize - shift);
        (low < high).then(|| Span {
            first: low as usize - first,
            len: (high - low) as usize,
            source: self.begin[source_phase] + (low + shift) as usize,
        })
    }
}

/// A colour image in this order, and its passes: row by row, in a row plane by plane, in a plane red, green, blue.
#[derive(Clone, Debug, Default)]
pub(crate) struct Colours {
    /// The signal and its passes.
    pub planes: usize,
    /// Grouped by three only so that it can be given away as a [`crate::Plane`] without a copy.
    pub data: Vec<Rgb>,
}

impl Colours {
    /// Elements of one row.
    pub fn stride(&self, width: usize) -> usize {
        3 * width * self.planes
    }

    /// Row `y`.
    #[inline(always)]
    pub fn row(&self, width: usize, y: usize) -> &[f32] {
        let stride = self.stride(width);
        &self.data.as_flattened()[y * stride..][..stride]
    }

    /// All elements.
    pub fn elements(&self) -> &[f32] {
        self.data.as_flattened()
    }

    /// All elements.
    pub fn elements_mut(&mut self) -> &mut [f32] {
        self.data.as_flattened_mut()
    }
}

/// Of a row of [`Colours`]: one channel (0..3) of one plane.
#[inline(always)]
pub(crate) fn channel(row: &[f32], width: usize, plane: usize, c: usize) -> &[f32] {
    &row[(plane * 3 + c) * width..][..width]
}

/// Pixels of the four phases, `N` of each at most, to a run of columns in the host's order.
#[inline(always)]
pub(crate) fn interleave<const N: usize>(phases: &[[f32; N]; PERIOD], columns: &mut [f32]) {
    let [a, b, c, d] = phases;
    let (groups, rest) = columns.as_chunks_mut::<PERIOD>();
    let n = groups.len().min(N);
    let groups = &mut groups[..n];
    for i in 0..n {
        groups[i] = [a[i], b[i], c[i], d[i]];
    }
    for (phase, out) in rest.iter_mut().enumerate() {
        *out = phases[phase][n.min(N - 1)];
    }
}

/// Copies a slice without a call, up to [`LONGEST_COPY`] elements: whole where it is `N` long, as it nearly always is,
/// else by powers of two.
#[inline(always)]
pub(crate) fn copy<const N: usize, T: Copy>(target: &mut [T], source: &[T]) {
    match (<&mut [T; N]>::try_from(&mut *target), <&[T; N]>::try_from(source)) {
        (Ok(target), Ok(source)) => *target = *source,
        _ if source.len() < LONGEST_COPY => {
            let rest = copy_part::<64, _>(target, source);
            let rest = copy_part::<32, _>(rest.0, rest.1);
            let rest = copy_part::<16, _>(rest.0, rest.1);
            let rest = copy_part::<8, _>(rest.0, rest.1);
            let rest = copy_part::<4, _>(rest.0, rest.1);
            let rest = copy_part::<2, _>(rest.0, rest.1);
            copy_part::<1, _>(rest.0, rest.1);
        }
        _ => target.copy_from_slice(source),
    }
}

/// Longer slices are copied by the system's function.
const LONGEST_COPY: usize = 128;

/// Copies the first `M` elements where the length has that bit; what is left.
#[inline(always)]
fn copy_part<'a, const M: usize, T: Copy>(target: &'a mut [T], source: &'a [T]) -> (&'a mut [T], &'a [T]) {
    if source.len() & M == 0 {
        return (target, source);
    }
    match (target.split_first_chunk_mut::<M>(), source.split_first_chunk::<M>()) {
        (Some((to, target)), Some((from, source))) => {
            *to = *from;
            (target, source)
        }
        _ => (&mut [], &[]), // the slices differ in length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_whole() {
        let source: Vec<u32> = (1..300).collect();
        for n in 0..source.len() {
            let mut target = vec![0; n + 1];
            copy::<66, _>(&mut target[..n], &source[..n]);
            assert_eq!((&target[..n], target[n]), (&source[..n], 0), "{n}");
        }
    }

    #[test]
    fn every_column_has_its_element_and_taps_land_where_they_should() {
        for width in 1..40 {
            let phases = Phases::new(Size::new(width, 1));
            let mut seen = vec![false; width];
            for x in 0..width {
                seen[phases.element(x)] = true;
            }
            assert!(seen.iter().all(|s| *s), "{width}");
            let column_of = |e: usize| (0..width).find(|x| phases.element(*x) == e).unwrap();
            for p in 0..PERIOD {
                for dx in -9..=9 {
                    for first in (0..phases.count(p)).step_by(3) {
                        let mut landed = [false; 3];
                        if let Some(span) = phases.shifted(p, first, 3, dx) {
                            for k in 0..span.len {
                                let lane = span.first + k;
                                landed[lane] = true;
                                let x = (4 * (first + lane) + p) as i32 + dx;
                                assert_eq!(column_of(span.source + k) as i32, x, "{width} {p} {dx} {first} {lane}");
                            }
                        }
                        for lane in 0..3 {
                            let x = 4 * (first + lane) + p;
                            let inside = x < width && (0..width as i32).contains(&(x as i32 + dx));
                            assert_eq!(landed[lane], inside, "{width} {p} {dx} {first} {lane}");
                        }
                    }
                }
            }
        }
    }
}
