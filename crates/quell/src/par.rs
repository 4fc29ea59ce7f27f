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

/// How many threads share a loop.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "threads")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "threads"))]
    1
}

/// Copies, on all threads.
pub(crate) fn copy<T: Copy + Send + Sync>(to: &mut [T], from: &[T]) {
    rows(to, PIECE, |i, to| to.copy_from_slice(&from[i * PIECE..][..to.len()]));
}

/// Elements that a thread takes at once where a loop has no rows.
const PIECE: usize = 1 << 15;

/// Up to so many threads, work that is done twice to spread it costs more than it saves. Chosen between 2 and 16, which were measured.
const FEW: usize = 4;

/// True where more than a few threads share a loop: what one of them does alone, or short loops, are what is waited for then.
pub(crate) fn many() -> bool {
    threads() > FEW
}

/// Rows of a band, where a picture is filtered some rows at a time: at least `least`, and `each` for every thread, so that threads seldom
/// wait for the last one of a band; at most twice `least`, since a band's memory counts.
pub(crate) fn band(least: usize, each: usize) -> usize {
    least.max((each * threads()).min(2 * least))
}

/// Numbers that a call needs for itself, from [`scratch`] or [`unset_scratch`].
pub(crate) struct Scratch(Vec<f32>);

thread_local! {
    static KEPT: std::cell::RefCell<Vec<Vec<f32>>> = const { std::cell::RefCell::new(Vec::new()) };
}

/// So many zeros for a row's work, in memory that this thread used before: the command keeps one heap for all threads, whose lock every row
/// of a picture would take several times.
pub(crate) fn scratch(count: usize) -> Scratch {
    let mut numbers = unset_scratch(count);
    numbers.fill(0.0);
    numbers
}

/// The same for numbers that mean nothing yet: all of them are to be written.
pub(crate) fn unset_scratch(count: usize) -> Scratch {
    let kept = KEPT.try_with(|kept| kept.try_borrow_mut().ok()?.pop()).ok().flatten();
    let mut numbers = kept.unwrap_or_default();
    numbers.resize(count, 0.0);
    if cfg!(debug_assertions) {
        numbers.fill(f32::NAN);
    }
    Scratch(numbers)
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let numbers = std::mem::take(&mut self.0);
        // A thread that ends keeps nothing.
        let _ = KEPT.try_with(|kept| kept.try_borrow_mut().map(|mut kept| kept.push(numbers)));
    }
}

impl std::ops::Deref for Scratch {
    type Target = [f32];

    #[inline(always)]
    fn deref(&self) -> &[f32] {
        &self.0
    }
}

impl std::ops::DerefMut for Scratch {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.0
    }
}

/// So many zeros, written on all threads: memory that was used before is cleared, and new memory is met, by one thread otherwise.
pub(crate) fn zeros<T: Copy + Default + Send + Sync>(count: usize) -> Vec<T> {
    #[cfg(feature = "threads")]
    if count >= PIECE && many() {
        use rayon::prelude::*;
        let pieces = count.div_ceil(PAGE);
        let pieces: Vec<[T; PAGE]> = (0..pieces).into_par_iter().map(|_| [T::default(); PAGE]).collect();
        let mut all = pieces.into_flattened();
        all.truncate(count);
        return all;
    }
    vec![T::default(); count]
}

/// Elements of a piece of memory that is cleared at once.
#[cfg(feature = "threads")]
const PAGE: usize = 1024;

/// Buffers of images that are gone, for the next ones, the one that waits longest first. Of bands of rows a stage holds a dozen at once, of
/// whole pictures few.
struct Spares(Vec<Vec<f32>>);

static SPARES: std::sync::Mutex<Spares> = std::sync::Mutex::new(Spares(Vec::new()));

impl Spares {
    /// Buffers of pictures that are kept at most: what is kept is there for nobody else.
    const MOST_LARGE: usize = 1;
    /// Those of bands.
    const MOST_SMALL: usize = 14;
    /// The least elements of a picture's: 64 MiB.
    const LARGE: usize = if cfg!(test) { 1200 } else { 1 << 24 };
    /// The least elements of one. Few in tests, so that small pictures use them.
    const LEAST: usize = if cfg!(test) { 64 } else { 1 << 16 };

    /// The smallest that holds `count` numbers, unless it is much too large.
    fn take(&mut self, count: usize) -> Option<Vec<f32>> {
        let fits = |spare: &Vec<f32>| spare.capacity() >= count && spare.capacity() <= count + count / 2;
        let best = (0..self.0.len()).filter(|i| fits(&self.0[*i])).min_by_key(|i| self.0[*i].capacity())?;
        Some(self.0.remove(best))
    }

    /// Keeps a buffer; the one of its kind that waits longest, where there are too many.
    fn keep(&mut self, numbers: Vec<f32>) -> Option<Vec<f32>> {
        let large = |spare: &Vec<f32>| spare.capacity() >= Self::LARGE;
        let of_a_picture = large(&numbers);
        let most = if of_a_picture { Self::MOST_LARGE } else { Self::MOST_SMALL };
        let alike = |spare: &&Vec<f32>| large(spare) == of_a_picture;
        let longest = if self.0.iter().filter(alike).count() < most {
            None
        } else {
            self.0.iter().position(|spare| alike(&spare)).map(|i| self.0.remove(i))
        };
        self.0.push(numbers);
        longest
    }
}

/// So many numbers that mean nothing yet. Every stage of every frame makes images of the same few sizes: one thread would clear each
/// while the others wait, which took 3.5 % of a job's processor seconds at 1920x1080.
pub(crate) fn recycled(count: usize) -> Vec<f32> {
    let kept = match SPARES.lock() {
        Ok(mut spares) if count >= Spares::LEAST => spares.take(count),
        _ => None,
    };
    let Some(mut numbers) = kept else { return vec![0.0; count] };
    numbers.resize(count, 0.0);
    // What is read before it was written shows in tests.
    if cfg!(debug_assertions) {
        numbers.fill(f32::NAN);
    }
    numbers
}

/// Keeps a buffer for [`recycled`].
pub(crate) fn recycle(numbers: Vec<f32>) {
    if numbers.capacity() < Spares::LEAST {
        return;
    }
    // Memory is given back after the lock.
    let longest = SPARES.lock().ok().and_then(|mut spares| spares.keep(numbers));
    drop(longest);
}

/// Gives back what is kept for [`recycled`].
pub(crate) fn forget_spares() {
    let spares = SPARES.lock().map(|mut spares| std::mem::take(&mut spares.0));
    drop(spares);
}

/// Both, at once where there are threads.
pub(crate) fn both<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "threads")]
    return rayon::join(a, b);
    #[cfg(not(feature = "threads"))]
    (a(), b())
}

/// True where `f` is true of some element.
pub(crate) fn any<T: Sync>(data: &[T], f: impl Fn(&T) -> bool + Sync + Send) -> bool {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        data.par_chunks(PIECE).any(|piece| piece.iter().any(&f))
    }
    #[cfg(not(feature = "threads"))]
    data.iter().any(f)
}

/// The sum of what `f` counts in pieces of `data`.
pub(crate) fn count<T: Send>(data: &mut [T], f: impl Fn(&mut [T]) -> usize + Sync + Send) -> usize {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        data.par_chunks_mut(PIECE).map(f).sum()
    }
    #[cfg(not(feature = "threads"))]
    f(data)
}

/// What `f` makes of each element.
pub(crate) fn map<T: Sync, O: Copy + Default + Send>(data: &[T], f: impl Fn(&T) -> O + Sync + Send) -> Vec<O> {
    let mut out = vec![O::default(); data.len()];
    rows(&mut out, PIECE, |i, out| {
        out.iter_mut().zip(&data[i * PIECE..]).for_each(|(out, value)| *out = f(value));
    });
    out
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

#[cfg(all(test, feature = "threads"))]
mod tests {
    use super::*;

    /// Longer than a piece, and no multiple of one.
    const COUNT: usize = 3 * PIECE + 77;

    #[test]
    fn many_threads_find_what_one_does() {
        let of = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                assert_eq!(many(), threads > FEW);
                let mut numbers: Vec<u32> = zeros(COUNT);
                assert_eq!((numbers.len(), numbers.iter().max()), (COUNT, Some(&0)));
                rows(&mut numbers, 100, |y, row| {
                    row.iter_mut().enumerate().for_each(|(x, n)| *n = (100 * y + x) as u32)
                });
                let odd = count(&mut numbers, |piece| piece.iter().filter(|n| **n % 2 == 1).count());
                let last = COUNT as u32 - 1;
                assert!(any(&numbers, |n| *n == last) && !any(&numbers, |n| *n > last));
                let mut copied = vec![0; COUNT];
                copy(&mut copied, &map(&numbers, |n| n + 1));
                (odd, copied)
            })
        };
        let (odd, numbers) = of(6);
        assert_eq!((odd, numbers.last()), (COUNT / 2, Some(&(COUNT as u32))));
        assert_eq!((odd, numbers), of(1));
    }

    #[test]
    fn buffers_of_about_the_size_are_used_again() {
        let mut spares = Spares(Vec::new());
        for size in [100, 1000, 700] {
            assert!(spares.keep(Vec::with_capacity(size)).is_none());
        }
        assert_eq!(spares.take(650).map(|v| v.capacity()), Some(700));
        assert!(spares.take(300).is_none() && spares.take(4000).is_none());
        // One of a picture's size, and of the smaller ones those that were used last.
        assert!(spares.keep(Vec::with_capacity(1500)).is_none());
        assert_eq!(spares.keep(Vec::with_capacity(1600)).map(|v| v.capacity()), Some(1500));
        for size in 102..100 + Spares::MOST_SMALL {
            assert!(spares.keep(Vec::with_capacity(size)).is_none());
        }
        assert_eq!(spares.keep(Vec::with_capacity(200)).map(|v| v.capacity()), Some(100));
    }

    #[test]
    fn memory_that_was_used_before_is_cleared() {
        let place = {
            let mut first = scratch(1000);
            first.fill(7.0);
            first.as_ptr()
        };
        let (second, other) = (scratch(500), scratch(500));
        assert_eq!(second.as_ptr(), place);
        assert!(second.iter().chain(other.iter()).all(|v| *v == 0.0));
    }
}
