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

/// What a band's function gets beside the four images: rows of two others, where they are there.
pub(crate) type Beside<'a> = [Option<&'a mut [f32]>; 2];

/// Calls `f(k, rows, beside)` for the k-th band of each image: `strides` elements of it, the fourth's also of those beside.
pub(crate) fn bands(
    images: [&mut [f32]; 4],
    strides: [usize; 4],
    beside: Beside<'_>,
    f: impl Fn(usize, [&mut [f32]; 4], Beside<'_>) + Sync + Send,
) {
    each_band(images, strides, beside, &f);
}

/// Of the k-th band: its number, the images' rows, those of what is beside.
type OfBand<'f> = &'f (dyn Fn(usize, [&mut [f32]; 4], Beside<'_>) + Sync);

/// Compiled once, as what is in `par.rs`.
fn each_band([a, b, c, d]: [&mut [f32]; 4], strides: [usize; 4], beside: Beside<'_>, f: OfBand<'_>) {
    let stride = strides[3];
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let (ab, cd) = (
            a.par_chunks_mut(strides[0]).zip(b.par_chunks_mut(strides[1])),
            c.par_chunks_mut(strides[2]).zip(d.par_chunks_mut(strides[3])),
        );
        let all = ab.zip(cd).enumerate();
        match beside {
            [Some(e), Some(g)] => all
                .zip(e.par_chunks_mut(stride).zip(g.par_chunks_mut(stride)))
                .for_each(|((k, ((a, b), (c, d))), (e, g))| f(k, [a, b, c, d], [Some(e), Some(g)])),
            [Some(e), None] => all
                .zip(e.par_chunks_mut(stride))
                .for_each(|((k, ((a, b), (c, d))), e)| f(k, [a, b, c, d], [Some(e), None])),
            [None, Some(g)] => all
                .zip(g.par_chunks_mut(stride))
                .for_each(|((k, ((a, b), (c, d))), g)| f(k, [a, b, c, d], [None, Some(g)])),
            [None, None] => all.for_each(|(k, ((a, b), (c, d)))| f(k, [a, b, c, d], [None, None])),
        }
    }
    #[cfg(not(feature = "threads"))]
    {
        let ab = a.chunks_mut(strides[0]).zip(b.chunks_mut(strides[1]));
        let cd = c.chunks_mut(strides[2]).zip(d.chunks_mut(strides[3]));
        let mut beside = beside.map(|image| image.map(|image| image.chunks_mut(stride)));
        for (k, ((a, b), (c, d))) in ab.zip(cd).enumerate() {
            f(k, [a, b, c, d], beside.each_mut().map(|rows| rows.as_mut().and_then(Iterator::next)));
        }
    }
}

pub(crate) use crate::par::rows as each;
