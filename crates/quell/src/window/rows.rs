//! Images of many channels, row by row and channel by channel within the row: loops over x read and write runs.

use crate::plane::Size;

/// `channels` values a pixel; value c of pixel (x, y) lies at `(y * channels + c) * width + x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    size: Size,
    channels: usize,
    data: Vec<f32>,
}

impl Rows {
    pub(crate) fn new(size: Size, channels: usize) -> Self {
        Self { size, channels, data: vec![0.0; size.pixels() * channels] }
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
