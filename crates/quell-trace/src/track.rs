//! Values that may change from frame to frame.

use std::sync::Arc;

/// A value over time. Time is counted in frames and may be fractional or negative.
///
/// A closure keeps the built-in scenes short, and file formats with key frames fit behind it just as well. What is
/// hashed is always the evaluated value, so a closure needs no identity.
#[derive(Clone)]
pub enum Track<T> {
    /// The same at every frame.
    Constant(T),
    /// A function of the frame number. It must be pure.
    Function(Arc<dyn Fn(f64) -> T + Send + Sync>),
}

impl<T: Clone> Track<T> {
    /// A track from a pure function of the frame number.
    pub fn function(f: impl Fn(f64) -> T + Send + Sync + 'static) -> Self {
        Self::Function(Arc::new(f))
    }

    /// The value at a frame.
    pub fn at(&self, frame: f64) -> T {
        match self {
            Self::Constant(value) => value.clone(),
            Self::Function(f) => f(frame),
        }
    }

    /// True where the value never changes.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

impl<T> From<T> for Track<T> {
    fn from(value: T) -> Self {
        Self::Constant(value)
    }
}

impl<T: std::fmt::Debug> std::fmt::Debug for Track<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Constant(value) => f.debug_tuple("Constant").field(value).finish(),
            Self::Function(_) => f.write_str("Function"),
        }
    }
}
