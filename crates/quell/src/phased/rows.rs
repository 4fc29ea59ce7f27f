//! Loops over the rows of several images at once, on all threads of the current rayon pool where the feature
//! `threads` is on. What a row computes never depends on which thread computes it.

/// Calls `f(y, a, b)` for every row: `strides` elements each.
pub(crate) fn zip2<A: Send, B: Send>(
    (a, b): (&mut [A], &mut [B]),
    strides: [usize; 2],
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync + Send,
) {
    crate::par::two_rows(a, strides[0], b, strides[1], f);
}

/// Calls `f(k, rows, also)` for the k-th band of each image: `strides` elements of it, the fourth's also of `also`.
pub(crate) fn bands(
    images: [&mut [f32]; 4],
    strides: [usize; 4],
    also: Option<&mut [f32]>,
    f: impl Fn(usize, [&mut [f32]; 4], Option<&mut [f32]>) + Sync + Send,
) {
    each_band(images, strides, also, &f);
}

/// Of the k-th band: its number, the images' rows, those of the fifth.
type OfBand<'f> = &'f (dyn Fn(usize, [&mut [f32]; 4], Option<&mut [f32]>) + Sync);

/// Compiled once, as what is in `par.rs`.
fn each_band([a, b, c, d]: [&mut [f32]; 4], strides: [usize; 4], also: Option<&mut [f32]>, f: OfBand<'_>) {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let (ab, cd) = (
            a.par_chunks_mut(strides[0]).zip(b.par_chunks_mut(strides[1])),
            c.par_chunks_mut(strides[2]).zip(d.par_chunks_mut(strides[3])),
        );
        let all = ab.zip(cd).enumerate();
        match also {
            Some(also) => all
                .zip(also.par_chunks_mut(strides[3]))
                .for_each(|((k, ((a, b), (c, d))), also)| f(k, [a, b, c, d], Some(also))),
            None => all.for_each(|(k, ((a, b), (c, d)))| f(k, [a, b, c, d], None)),
        }
    }
    #[cfg(not(feature = "threads"))]
    {
        let ab = a.chunks_mut(strides[0]).zip(b.chunks_mut(strides[1]));
        let cd = c.chunks_mut(strides[2]).zip(d.chunks_mut(strides[3]));
        let mut also = also.map(|also| also.chunks_mut(strides[3]));
        for (k, ((a, b), (c, d))) in ab.zip(cd).enumerate() {
            f(k, [a, b, c, d], also.as_mut().and_then(Iterator::next));
        }
    }
}

pub(crate) use crate::par::rows as each;
