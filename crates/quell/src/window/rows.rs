//! Images of many channels, row by row and channel by channel within the row: loops over x read and write runs.

use crate::par;
use crate::plane::Size;
use half::f16;
use half::slice::HalfFloatSliceExt;

/// `channels` values a pixel; value c of pixel (x, y) lies at `(y * channels + c) * width + x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    size: Size,
    channels: usize,
    data: Vec<f32>,
}

impl Rows {
    pub(crate) fn new(size: Size, channels: usize) -> Self {
        Self { size, channels, data: par::zeros(size.pixels() * channels) }
    }

    /// Made row by row, on all threads: `f(y, all channels of the row one after the other)`; a row is 0 before.
    #[cfg(feature = "cpu")]
    pub(crate) fn made(size: Size, channels: usize, f: impl Fn(usize, &mut [f32]) + Sync + Send) -> Self {
        Self::written(size, channels, |y, row| {
            row.fill(0.0);
            f(y, row);
        })
    }

    /// The same where `f` writes all of a row.
    #[cfg(feature = "cpu")]
    pub(crate) fn written(size: Size, channels: usize, f: impl Fn(usize, &mut [f32]) + Sync + Send) -> Self {
        let mut rows = Self::unset(size, channels);
        par::rows(&mut rows.data, (channels * size.width).max(1), f);
        rows
    }

    /// Values that mean nothing: all of them are to be written.
    pub(crate) fn unset(size: Size, channels: usize) -> Self {
        Self { size, channels, data: par::recycled(size.pixels() * channels) }
    }

    /// Extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Without pixels: gives the memory back.
    pub(crate) fn empty() -> Self {
        Self::new(Size::new(0, 0), 0)
    }

    /// Channels a pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    pub(crate) fn data(&self) -> &[f32] {
        &self.data
    }

    pub(crate) fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// Where row `y` of channel `c` begins in [`Self::data`].
    #[inline(always)]
    #[cfg(feature = "cpu")]
    pub(crate) fn start(&self, y: usize, c: usize) -> usize {
        y * (self.channels * self.size.width) + c * self.size.width
    }

    /// Row `y` of channel `c`.
    pub(crate) fn row(&self, y: usize, c: usize) -> &[f32] {
        &self.data[(y * self.channels + c) * self.size.width..][..self.size.width]
    }

    /// Value of channel `c` at a pixel.
    pub fn at(&self, x: usize, y: usize, c: usize) -> f32 {
        self.row(y, c)[x]
    }

    /// Sets channel `c` at a pixel.
    pub(crate) fn set(&mut self, x: usize, y: usize, c: usize, value: f32) {
        let place = (y * self.channels + c) * self.size.width + x;
        self.data[place] = value;
    }

    /// Three channels from `first` on at a pixel.
    pub fn colour(&self, x: usize, y: usize, first: usize) -> [f32; 3] {
        [0, 1, 2].map(|c| self.at(x, y, first + c))
    }
}

impl Drop for Rows {
    fn drop(&mut self) {
        par::recycle(std::mem::take(&mut self.data));
    }
}

/// [`Rows`] that wait in half precision.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfRows {
    size: Size,
    channels: usize,
    data: Vec<f16>,
}

impl HalfRows {
    /// Rounded to the nearest; what half precision does not reach becomes the largest number of it.
    pub(crate) fn new(rows: &Rows) -> Self {
        let (size, channels) = (rows.size, rows.channels);
        let mut data = vec![f16::ZERO; rows.data.len()];
        let stride = (channels * size.width).max(1);
        par::rows(&mut data, stride, |y, out| {
            out.convert_from_f32_slice(&rows.data[y * stride..][..out.len()]);
            // Infinite differences would make weights that are no numbers.
            for value in out.iter_mut().filter(|value| value.is_infinite()) {
                *value = f16::MAX.copysign(*value);
            }
        });
        Self { size, channels, data }
    }

    /// Row `y` of channel `c`.
    #[inline(always)]
    pub(crate) fn row(&self, y: usize, c: usize) -> &[f16] {
        &self.data[(y * self.channels + c) * self.size.width..][..self.size.width]
    }

    /// All channels of row `y`, one after the other.
    #[inline(always)]
    #[cfg(feature = "cpu")]
    pub(crate) fn channels_of(&self, y: usize) -> &[f16] {
        let length = self.channels * self.size.width;
        &self.data[y * length..][..length]
    }

    /// Value of channel `c` at a pixel.
    pub(crate) fn at(&self, x: usize, y: usize, c: usize) -> f32 {
        self.row(y, c)[x].to_f32()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_halves_do_not_reach_is_their_largest() {
        let mut rows = Rows::new(Size::new(5, 3), 4);
        rows.data.iter_mut().enumerate().for_each(|(i, value)| *value = -9000.0 * (i as f32 - 7.3));
        let halves = HalfRows::new(&rows);
        assert_eq!((halves.at(0, 0, 0), halves.at(4, 2, 3)), (65504.0, -65504.0));
        assert_eq!(halves.at(2, 0, 1), f16::from_f32(rows.at(2, 0, 1)).to_f32());
        assert_eq!(halves.row(0, 1)[2].to_f32(), halves.at(2, 0, 1));
    }
}
