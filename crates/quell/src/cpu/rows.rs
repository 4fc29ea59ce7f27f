//! Loops over the rows of several images at once, on all threads of the current rayon pool where the feature
//! `threads` is on. What a row computes never depends on which thread computes it.

/// Calls `f(y, a, b, c)` for every row: `strides` elements each.
pub(crate) fn zip3<A: Send, B: Send, C: Send>(
    (a, b, c): (&mut [A], &mut [B], &mut [C]),
    strides: [usize; 3],
    f: impl Fn(usize, &mut [A], &mut [B], &mut [C]) + Sync + Send,
) {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let rows = a.par_chunks_mut(strides[0]).zip(b.par_chunks_mut(strides[1])).zip(c.par_chunks_mut(strides[2]));
        rows.enumerate().for_each(|(y, ((a, b), c))| f(y, a, b, c));
    }
    #[cfg(not(feature = "threads"))]
    {
        let rows = a.chunks_mut(strides[0]).zip(b.chunks_mut(strides[1])).zip(c.chunks_mut(strides[2]));
        rows.enumerate().for_each(|(y, ((a, b), c))| f(y, a, b, c));
    }
}

pub(crate) use crate::par::rows as each;
