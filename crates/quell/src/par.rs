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
