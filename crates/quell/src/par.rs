//! Loops over rows, on all threads of the current rayon pool where the feature `threads` is on. What a row computes
//! never depends on which thread computes it.
//!
//! What a row computes is called through a pointer: rayon's loops are compiled once for a type of elements, not for each of the
//! hundred callers, which made the crate's machine code a fifth larger. A row is long, a call short.

use crate::plane::{Plane, Size};

/// Calls `f(y, row)` for every row of `data`, rows `width` elements long.
pub(crate) fn rows<T: Send>(data: &mut [T], width: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
    each_row(data, width, &f);
}

fn each_row<T: Send>(data: &mut [T], width: usize, f: &(dyn Fn(usize, &mut [T]) + Sync)) {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        data.par_chunks_mut(width).enumerate().for_each(|(y, row)| f(y, row));
    }
    #[cfg(not(feature = "threads"))]
    data.chunks_mut(width).enumerate().for_each(|(y, row)| f(y, row));
}

/// [`Plane::from_fn`] on all threads.
pub(crate) fn plane<T: Copy + Default + Send>(size: Size, f: impl Fn(usize, usize) -> T + Sync + Send) -> Plane<T> {
    let mut plane = Plane::filled(size, T::default());
    rows(plane.data_mut(), size.width, |y, row| {
        for (x, value) in row.iter_mut().enumerate() {
            *value = f(x, y);
        }
    });
    plane
}

/// [`rows`] over two images at once: `f(y, row of a, row of b)`.
#[cfg(feature = "cpu")]
pub(crate) fn two_rows<A: Send, B: Send>(
    a: &mut [A],
    a_width: usize,
    b: &mut [B],
    b_width: usize,
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync + Send,
) {
    each_pair(a, a_width.max(1), b, b_width.max(1), &f);
}

#[cfg(feature = "cpu")]
type OfPair<'f, A, B> = &'f (dyn Fn(usize, &mut [A], &mut [B]) + Sync);

#[cfg(feature = "cpu")]
fn each_pair<A: Send, B: Send>(a: &mut [A], a_width: usize, b: &mut [B], b_width: usize, f: OfPair<'_, A, B>) {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let pairs = a.par_chunks_mut(a_width).zip(b.par_chunks_mut(b_width));
        pairs.enumerate().for_each(|(y, (a, b))| f(y, a, b));
    }
    #[cfg(not(feature = "threads"))]
    a.chunks_mut(a_width).zip(b.chunks_mut(b_width)).enumerate().for_each(|(y, (a, b))| f(y, a, b));
}
