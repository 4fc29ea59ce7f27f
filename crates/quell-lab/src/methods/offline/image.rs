//! One channel of an image, stored so that vectors may be read past its edges.

use quell::{Plane, Rgb, Size};

/// Pixels that are handled together.
pub const LANES: usize = 16;

/// Pixels around an image in which its edge is repeated: no less than any window's radius plus any patch's.
pub const MARGIN: usize = 16;

/// One channel: row-major, with [`MARGIN`] pixels of the repeated edge around it, and so many more on the right that
/// whole vectors may be read from any pixel in reach.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    size: Size,
    stride: usize,
    data: Vec<f32>,
}

/// Red, green, blue.
pub type Colour = [Image; 3];

impl Image {
    /// `value` inside, 0 in the margin.
    pub fn filled(size: Size, value: f32) -> Self {
        let stride = size.width.next_multiple_of(LANES) + 3 * MARGIN;
        let mut image = Self { size, stride, data: vec![0.0; stride * (size.height + 2 * MARGIN)] };
        for y in 0..size.height {
            let begin = image.index(0, y);
            image.data[begin..][..size.width].fill(value);
        }
        image
    }

    /// Pixel by pixel; what is not finite becomes 0.
    pub fn from_fn(size: Size, mut value: impl FnMut(usize, usize) -> f32) -> Self {
        let mut image = Self::filled(size, 0.0);
        for y in 0..size.height {
            for x in 0..size.width {
                let v = value(x, y);
                image.set(x, y, if v.is_finite() { v } else { 0.0 });
            }
        }
        image.repeat_edges();
        image
    }

    /// One image of each component.
    pub fn colour(plane: &Plane<Rgb>) -> Colour {
        std::array::from_fn(|c| Self::from_fn(plane.size(), |x, y| plane.at(x, y)[c]))
    }

    /// Element by element, margins too.
    pub fn map(&self, f: impl Fn(f32) -> f32) -> Self {
        Self { data: self.data.iter().map(|&v| f(v)).collect(), ..*self }
    }

    /// Element by element from two images of one size, margins too.
    pub fn zip(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self { data: self.data.iter().zip(&other.data).map(|(&a, &b)| f(a, b)).collect(), ..*self }
    }

    /// Extent without the margin.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Elements from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Everything, margins too.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// Everything, margins too.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// Where pixel (x, y) lies in [`Image::data`].
    pub fn index(&self, x: usize, y: usize) -> usize {
        (y + MARGIN) * self.stride + x + MARGIN
    }

    /// Pixel (x, y).
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.data[self.index(x, y)]
    }

    /// Sets pixel (x, y); the margin follows with [`Image::repeat_edges`].
    pub fn set(&mut self, x: usize, y: usize, value: f32) {
        let i = self.index(x, y);
        self.data[i] = value;
    }

    /// Fills the margin with the nearest pixels.
    pub fn repeat_edges(&mut self) {
        let (Size { width, height }, stride) = (self.size, self.stride);
        if width == 0 || height == 0 {
            return;
        }
        for y in 0..height {
            let row = &mut self.data[(y + MARGIN) * stride..][..stride];
            let (first, last) = (row[MARGIN], row[MARGIN + width - 1]);
            row[..MARGIN].fill(first);
            row[MARGIN + width..].fill(last);
        }
        for y in 0..MARGIN {
            self.data.copy_within(MARGIN * stride..(MARGIN + 1) * stride, y * stride);
            self.data.copy_within(
                (height + MARGIN - 1) * stride..(height + MARGIN) * stride,
                (height + MARGIN + y) * stride,
            );
        }
    }
}

/// Channel by channel from two colours.
pub fn zip(a: &Colour, b: &Colour, f: impl Fn(f32, f32) -> f32) -> Colour {
    std::array::from_fn(|c| a[c].zip(&b[c], &f))
}

/// The mean of two colours.
pub fn mean(a: &Colour, b: &Colour) -> Colour {
    zip(a, b, |a, b| 0.5 * (a + b))
}
