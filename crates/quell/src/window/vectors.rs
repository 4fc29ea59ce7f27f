//! Motion as it waits in a window of frames.

use super::packed::exact_halves;
use crate::kernels::halves::widen;
use crate::par;
use crate::plane::{Plane, Size};
use half::f16;

/// A vector a pixel, in half precision where that holds every one of them, else as they came: most files hold half floats.
#[derive(Clone, Debug)]
pub enum Vectors {
    /// Row by row.
    Half(Size, Vec<[f16; 2]>),
    /// As they came.
    Full(Plane<[f32; 2]>),
}

impl Vectors {
    /// What is no number stays none.
    pub fn new(plane: Plane<[f32; 2]>) -> Self {
        match exact_halves(plane.data(), true) {
            Some(halves) => Self::Half(plane.size(), halves),
            None => Self::Full(plane),
        }
    }

    /// Of a pixel.
    #[inline(always)]
    pub fn at(&self, pixel: usize) -> [f32; 2] {
        match self {
            Self::Half(_, data) => {
                let [x, y] = data[pixel];
                [widen(x), widen(y)]
            }
            Self::Full(plane) => plane.data()[pixel],
        }
    }

    /// All of them, in single precision.
    pub fn plane(&self) -> Plane<[f32; 2]> {
        match self {
            Self::Half(size, _) => par::plane(*size, |x, y| self.at(y * size.width + x)),
            Self::Full(plane) => plane.clone(),
        }
    }

    /// True where one of them is unknown.
    pub(crate) fn lacks_some(&self) -> bool {
        match self {
            Self::Half(_, data) => par::any(data, |v| v.iter().any(|v| v.is_nan())),
            Self::Full(plane) => par::any(plane.data(), |v| v.iter().any(|v| v.is_nan())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_lose_nothing() {
        let size = Size::new(3, 2);
        for value in [0.25f32, 0.3, 1e6, -0.0, 3.0e-8] {
            let plane = Plane::from_fn(size, |x, y| if (x, y) == (1, 1) { [f32::NAN, 1.0] } else { [value, -2.0] });
            let vectors = Vectors::new(plane.clone());
            assert_eq!(matches!(vectors, Vectors::Half(..)), [0.25, -0.0].contains(&value), "{value}");
            assert!(vectors.lacks_some());
            for (i, (found, v)) in vectors.plane().data().iter().zip(plane.data()).enumerate() {
                let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(same(found[0], v[0]) && same(found[1], v[1]), "{i}");
            }
        }
        assert!(!Vectors::new(Plane::filled(size, [1.5, 0.0])).lacks_some());
    }
}
