//! The noisy input.

use super::{Input, Method};
use crate::error::Error;
use quell::{Plane, Rgb};

/// Hands the noisy picture on.
pub struct None;

impl Method for None {
    fn name(&self) -> String {
        "none".to_owned()
    }

    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        Ok(input.composite())
    }
}
