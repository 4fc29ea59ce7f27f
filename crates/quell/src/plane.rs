//! Two-dimensional arrays: rows, columns, stride. No arithmetic lives here.

use crate::error::Error;

/// Extent of an image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Size {
    /// Columns, at least 1 in every valid image.
    pub width: usize,
    /// Rows, at least 1 in every valid image.
    pub height: usize,
}

impl Size {
    /// `width` columns and `height` rows.
    pub const fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// Number of pixels.
    pub const fn pixels(self) -> usize {
        self.width.saturating_mul(self.height)
    }

    /// True where the integer pixel (x, y) lies inside.
    pub const fn contains(self, x: isize, y: isize) -> bool {
        x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// An owned image: row-major, origin top left, no padding between rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<T> {
    size: Size,
    data: Vec<T>,
}

impl<T: Clone> Plane<T> {
    /// An image whose every pixel is `value`.
    pub fn filled(size: Size, value: T) -> Self {
        Self { size, data: vec![value; size.pixels()] }
    }
}

impl<T: Copy> Plane<T> {
    /// An image computed pixel by pixel: `f(x, y)`, x to the right, y down.
    pub fn from_fn(size: Size, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(size.pixels());
        for y in 0..size.height {
            for x in 0..size.width {
                data.push(f(x, y));
            }
        }
        Self { size, data }
    }

    /// Takes `data`, row-major without padding.
    ///
    /// # Errors
    /// [`Error::PlaneLength`] unless `data.len()` is the number of pixels.
    pub fn from_vec(size: Size, data: Vec<T>) -> Result<Self, Error> {
        if data.len() != size.pixels() {
            return Err(Error::PlaneLength { size, stride: size.width, len: data.len() });
        }
        Ok(Self { size, data })
    }

    /// The extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// All pixels, row by row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All pixels, row by row.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Row `y`.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.size.width..][..self.size.width]
    }

    /// Row `y`.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.size.width..][..self.size.width]
    }

    /// Pixel (x, y).
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> T {
        self.data[y * self.size.width + x]
    }

    /// Sets pixel (x, y).
    #[inline]
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        self.data[y * self.size.width + x] = value;
    }

    /// A view of the whole.
    pub fn view(&self) -> PlaneRef<'_, T> {
        PlaneRef { size: self.size, stride: self.size.width, data: &self.data }
    }

    /// Gives the pixels back.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }
}

/// A borrowed image: row-major, origin top left, rows `stride` elements apart.
#[derive(Clone, Copy, Debug)]
pub struct PlaneRef<'a, T> {
    size: Size,
    stride: usize,
    data: &'a [T],
}

impl<'a, T: Copy> PlaneRef<'a, T> {
    /// Borrows `data`, whose row `y` begins at element `y * stride`; the last row may end without padding.
    ///
    /// # Errors
    /// [`Error::EmptySize`] where an extent is 0, [`Error::PlaneLength`] where the stride does not hold a row or
    /// `data` does not hold the rows.
    pub fn new(data: &'a [T], size: Size, stride: usize) -> Result<Self, Error> {
        if size.width == 0 || size.height == 0 {
            return Err(Error::EmptySize { size });
        }
        let needed = (size.height - 1).checked_mul(stride).and_then(|n| n.checked_add(size.width));
        if stride < size.width || needed.is_none_or(|n| n > data.len()) {
            return Err(Error::PlaneLength { size, stride, len: data.len() });
        }
        Ok(Self { size, stride, data })
    }

    /// The extent.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Row `y`, without its padding.
    #[inline]
    pub fn row(&self, y: usize) -> &'a [T] {
        &self.data[y * self.stride..][..self.size.width]
    }

    /// Pixel (x, y).
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> T {
        self.data[y * self.stride + x]
    }

    /// A copy without padding.
    pub fn to_plane(&self) -> Plane<T> {
        Plane::from_fn(self.size, |x, y| self.at(x, y))
    }
}
