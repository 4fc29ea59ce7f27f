//! Images that hold in most places what is known without them.

use crate::par;
use bytemuck::{Pod, bytes_of};

/// Pixels, one after the other, that are kept together.
const BLOCK: usize = 16;
/// Stands for a block of which nothing is kept.
const KNOWN: u32 = u32::MAX;

/// An image of which only those blocks of pixels are kept that hold something else than what is known: of motion in mirrors, than that of
/// surfaces.
#[derive(Clone, Debug)]
pub struct Sparse<T> {
    /// Of each block where it begins in `values`.
    blocks: Vec<u32>,
    values: Vec<T>,
}

/// Blocks that a thread looks at at once.
const RUN: usize = 4096;

impl<T: Pod> Sparse<T> {
    /// Keeps what of `value` is not `known`, bit by bit.
    pub(crate) fn new(pixels: usize, value: impl Fn(usize) -> T + Sync, known: impl Fn(usize) -> T + Sync) -> Self {
        let mut differs = vec![false; pixels.div_ceil(BLOCK)];
        let block_at = |block: usize| BLOCK * block..(BLOCK * (block + 1)).min(pixels);
        par::rows(&mut differs, RUN, |run, differs| {
            for (k, differs) in differs.iter_mut().enumerate() {
                *differs = block_at(RUN * run + k).any(|p| bytes_of(&value(p)) != bytes_of(&known(p)));
            }
        });
        let mut sparse = Self { blocks: Vec::with_capacity(differs.len()), values: Vec::new() };
        for (block, differs) in differs.into_iter().enumerate() {
            if differs {
                sparse.blocks.push(sparse.values.len() as u32);
                sparse.values.extend(block_at(block).map(&value));
            } else {
                sparse.blocks.push(KNOWN);
            }
        }
        sparse.values.shrink_to_fit();
        sparse
    }

    /// The value at a pixel; `None`: what is known.
    #[inline(always)]
    pub fn get(&self, pixel: usize) -> Option<T> {
        let at = self.blocks[pixel / BLOCK];
        if at == KNOWN { None } else { Some(self.values[at as usize + pixel % BLOCK]) }
    }

    /// The blocks that are kept: their first pixel, and their values.
    #[cfg(feature = "cpu")]
    pub(crate) fn kept(&self) -> impl Iterator<Item = (usize, &[T])> {
        let kept = self.blocks.iter().enumerate().filter(|(_, at)| **at != KNOWN);
        kept.map(|(i, at)| {
            let values = &self.values[*at as usize..];
            (i * BLOCK, &values[..BLOCK.min(values.len())])
        })
    }

    /// All values of the first so many pixels.
    pub(crate) fn dense(&self, pixels: usize, known: impl Fn(usize) -> T) -> Vec<T> {
        (0..pixels).map(|p| self.get(p).unwrap_or_else(|| known(p))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_takes_no_memory_and_nothing_is_lost() {
        let known = |p: usize| if p.is_multiple_of(5) { f32::NAN } else { p as f32 };
        let value = |p: usize| if (40..45).contains(&p) || p == 99 { -1.0 } else { known(p) };
        let sparse = Sparse::new(100, value, known);
        assert_eq!(sparse.values.len(), 16 + 4);
        for (p, found) in sparse.dense(100, known).into_iter().enumerate() {
            assert_eq!(found.to_bits(), value(p).to_bits(), "{p}");
        }
        assert_eq!((sparse.get(39), sparse.get(50)), (Some(39.0), None));
        assert_eq!(Sparse::new(0, value, known).dense(0, known).len(), 0);
    }
}
