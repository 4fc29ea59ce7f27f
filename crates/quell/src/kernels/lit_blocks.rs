//! Which blocks of sixteen pixels have which lights: filters skip a light where it is 0 in all that they would read.

use super::lanes::BLOCK;
use crate::par;
use crate::plane::Size;
use crate::simd::widest;
use std::ops::Range;

/// Lights that have a bit of their own; further ones count as lit everywhere.
const MOST: usize = u64::BITS as usize;

/// For every [`BLOCK`] pixels of a row the lights that are not 0 in all of them.
pub(crate) struct LitBlocks {
    across: usize,
    /// Row by row, a bit a light.
    blocks: Vec<u64>,
}

/// Some lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lit(u64);

impl Lit {
    #[inline(always)]
    pub(crate) fn has(self, light: usize) -> bool {
        light >= MOST || self.0 >> light & 1 == 1
    }
}

impl LitBlocks {
    /// `channels(y, light)`: the values of a light in row `y`, channel by channel.
    pub(crate) fn new<'a, I: Iterator<Item = &'a [f32]>>(
        size: Size,
        lights: usize,
        channels: impl Fn(usize, usize) -> I + Sync + Send,
    ) -> Self {
        let across = size.width.div_ceil(BLOCK);
        let mut blocks = vec![0; across * size.height];
        par::rows(&mut blocks, across.max(1), |y, blocks| {
            for light in 0..lights.min(MOST) {
                for row in channels(y, light) {
                    widest!(mark(row, light, blocks));
                }
            }
        });
        Self { across, blocks }
    }

    /// The lights of blocks in which some pixel of `rows` and of `columns` lies; columns beyond the row are left out.
    #[inline(always)]
    pub(crate) fn within(&self, rows: impl Iterator<Item = usize>, columns: Range<isize>) -> Lit {
        let first = columns.start.max(0) as usize / BLOCK;
        let end = (columns.end.max(0) as usize).div_ceil(BLOCK).min(self.across);
        let of_row = |y: usize| self.blocks[y * self.across..][..self.across].get(first..end).unwrap_or(&[]);
        Lit(rows.flat_map(of_row).fold(0, |lit, block| lit | block))
    }
}

/// Sets the light's bit of each block of a row in which it is not 0. Of -0, too, nothing comes out.
#[inline(always)]
fn mark(row: &[f32], light: usize, blocks: &mut [u64]) {
    let (whole, rest) = row.as_chunks::<BLOCK>();
    let (of_whole, of_rest) = blocks.split_at_mut(whole.len());
    for (block, values) in of_whole.iter_mut().zip(whole) {
        // Mostly the first channel shows it.
        if *block >> light & 1 == 1 {
            continue;
        }
        let mut bits = 0;
        for value in values {
            bits |= value.to_bits() << 1;
        }
        *block |= u64::from(bits != 0) << light;
    }
    if let Some(block) = of_rest.first_mut() {
        *block |= u64::from(rest.iter().any(|value| *value != 0.0)) << light;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::Rows;

    #[test]
    fn a_block_is_lit_where_some_value_is_not_zero() {
        let size = Size::new(40, 5);
        let mut rows = Rows::new(size, 3 * 70);
        rows.set(17, 3, 3 * 2 + 1, -1e-30);
        rows.set(39, 0, 3 * 63 + 2, f32::NAN);
        rows.set(2, 4, 0, -0.0);
        let lit =
            LitBlocks::new(size, 70, |y, light| (0..3).map(move |c| (y, 3 * light + c)).map(|(y, c)| rows.row(y, c)));
        let lights = |y: Range<usize>, x: Range<isize>| -> Vec<usize> {
            let found = lit.within(y, x);
            (0..70).filter(|light| found.has(*light)).collect()
        };
        let always: Vec<usize> = (64..70).collect();
        let with = |some: &[usize]| [some, &always].concat();
        assert_eq!(lights(0..5, -9..60), with(&[2, 63]));
        assert_eq!(lights(3..4, 16..17), with(&[2]));
        assert_eq!(lights(3..4, 32..48), with(&[]));
        assert_eq!(lights(2..4, -5..16), with(&[]));
        assert_eq!(lights(0..1, 47..80), with(&[63]));
        assert_eq!(lights(0..5, -20..-3), with(&[]));
        assert_eq!(lights(0..5, 60..70), with(&[]));
    }
}
