//! Loops over rows, on all threads of the current rayon pool where the feature `threads` is on. What a row computes
//! never depends on which thread computes it.

use crate::plane::{Plane, Size};

/// Calls `f(y, row)` for every row of `data`, rows `width` elements long.
pub(crate) fn rows<T: Send>(data: &mut [T], width: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
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
    let (a_width, b_width) = (a_width.max(1), b_width.max(1));
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let pairs = a.par_chunks_mut(a_width).zip(b.par_chunks_mut(b_width));
        pairs.enumerate().for_each(|(y, (a, b))| f(y, a, b));
    }
    #[cfg(not(feature = "threads"))]
    a.chunks_mut(a_width).zip(b.chunks_mut(b_width)).enumerate().for_each(|(y, (a, b))| f(y, a, b));
}
