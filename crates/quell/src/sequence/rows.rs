//! Images of many channels, row by row and channel by channel within the row: loops over x read and write runs.

use crate::plane::Size;

/// `channels` values a pixel; value c of pixel (x, y) lies at `(y * channels + c) * width + x`.
#[derive(Clone)]
pub(super) struct Rows {
    size: Size,
    channels: usize,
    data: Vec<f32>,
}

impl Rows {
    pub(super) fn new(size: Size, channels: usize) -> Self {
        Self { size, channels, data: vec![0.0; size.pixels() * channels] }
    }

    /// Without pixels: gives the memory back.
    pub(super) fn empty() -> Self {
        Self::new(Size::new(0, 0), 0)
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    pub(super) fn data(&self) -> &[f32] {
        &self.data
    }

    pub(super) fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// Row `y` of channel `c`.
    pub(super) fn row(&self, y: usize, c: usize) -> &[f32] {
        &self.data[(y * self.channels + c) * self.size.width..][..self.size.width]
    }
}
