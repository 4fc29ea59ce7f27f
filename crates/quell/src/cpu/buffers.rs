//! Colour images in use and at rest. A steady frame finds every buffer that it needs at rest.

use crate::frame::Rgb;
use crate::phased::guides::show;
use crate::phased::layout::{Colours, Phases};
use crate::pipeline::Image;
use crate::plane::Plane;
use fearless_simd::Level;

/// Images of the frame at work, in phase order, and buffers at rest.
#[derive(Clone, Debug, Default)]
pub(crate) struct Buffers {
    live: Vec<(Image, Colours)>,
    rest: Vec<Vec<Rgb>>,
}

impl Buffers {
    /// A buffer for `planes` planes of `pixels` pixels; what it holds is of no meaning.
    pub fn take(&mut self, pixels: usize, planes: usize) -> Colours {
        let len = pixels * planes;
        let data = match self.rest.iter().position(|b| b.len() == len) {
            Some(i) => self.rest.swap_remove(i),
            None => vec![[0.0; 3]; len],
        };
        Colours { planes, data }
    }

    /// A buffer at rest again.
    pub fn give(&mut self, colours: Colours) {
        self.rest.push(colours.data);
    }

    /// As [`Buffers::give`].
    pub fn give_plane(&mut self, plane: Plane<Rgb>) {
        self.rest.push(plane.into_vec());
    }

    /// An image of this frame.
    pub fn get(&self, image: Image) -> Option<&Colours> {
        self.live.iter().find(|(i, _)| *i == image).map(|(_, c)| c)
    }

    /// Puts an image of this frame in.
    pub fn insert(&mut self, image: Image, colours: Colours) {
        self.live.push((image, colours));
    }

    /// Takes an image of this frame out.
    pub fn remove(&mut self, image: Image) -> Option<Colours> {
        let at = self.live.iter().position(|(i, _)| *i == image)?;
        Some(self.live.swap_remove(at).1)
    }

    /// Ends the frame: every image comes to rest.
    pub fn clear(&mut self) {
        self.rest.extend(self.live.drain(..).map(|(_, c)| c.data));
    }

    /// Lets go of buffers at rest whose length no image has any more.
    pub fn retain(&mut self, lengths: &[usize]) {
        self.rest.retain(|b| lengths.contains(&b.len()));
    }

    /// Copies an image to `shown`, plane by plane, in the host's order.
    pub fn show(&mut self, level: Level, phases: &Phases, source: &Colours, shown: &mut Vec<Plane<Rgb>>) {
        for plane in 0..source.planes {
            let buffer = self.take(phases.size.pixels(), 1);
            // The length is right by construction.
            if let Ok(mut target) = Plane::from_vec(phases.size, buffer.data) {
                show(level, phases, source, plane, &mut target);
                shown.push(target);
            }
        }
    }
}
