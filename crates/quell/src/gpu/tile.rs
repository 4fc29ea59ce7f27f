//! Pictures larger than a device's textures, filtered tile by tile: a denoiser for each.
//!
//! A tile is a frame of its own that knows where it lies in the whole picture: it has the whole picture's cameras and sizes of
//! kernels, so that a pixel whose neighbourhood lies in the tile gets the bits that it gets in the whole picture. How far that
//! neighbourhood reaches within a frame [`reach_px`] says. What outlives the frame is right only so far from the tile's
//! edge; [`Denoiser::take_margin`] brings the rest from the tiles that hold it, before the next frame. History is
//! found as far as the tile goes: what moved in from further begins afresh.

use super::denoiser::Denoiser;
use super::error::Error;
use super::planes::extent_of;
use super::program::Role;
use crate::denoiser::MAX_EXTENT;
use crate::frame::Signal;
use crate::kernels::spiral::PERIOD;
use crate::pipeline::{Inputs, Plan};
use crate::plane::Size;
use crate::settings::Settings;

/// Where a frame lies in a larger picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// The picture's pixel that is the frame's (0, 0): multiples of [`Tile::STEP`], because patterns of taps repeat so.
    pub origin: [u32; 2],
    /// Extent of the picture.
    pub whole: Size,
}

impl Tile {
    /// What origins are multiples of.
    pub const STEP: u32 = PERIOD as u32;

    /// Of a frame that is all of its picture.
    pub(super) const fn whole(size: Size) -> Self {
        Self { origin: [0; 2], whole: size }
    }

    /// Whether a frame of `size` can lie so.
    pub(super) fn check(self, size: Size) -> Result<(), Error> {
        let Self { origin: [x, y], whole } = self;
        let fits = |origin: u32, extent: usize, of: usize| {
            origin.is_multiple_of(Self::STEP) && (origin as usize).checked_add(extent).is_some_and(|end| end <= of)
        };
        if whole.width > MAX_EXTENT || whole.height > MAX_EXTENT {
            return Err(crate::Error::SizeTooLarge { size: whole, limit: MAX_EXTENT }.into());
        }
        if !(fits(x, size.width, whole.width) && fits(y, size.height, whole.height)) {
            return Err(Error::Tile { origin: self.origin, size, whole });
        }
        Ok(())
    }
}

/// Part of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// Its extent.
    pub size: Size,
}

impl Denoiser {
    /// Appends to the encoder what brings home, from the tile of another denoiser, part of what the next frame remembers:
    /// between the frame that both have encoded and the next one. `area` lies in the picture and in both tiles; several tiles
    /// may take from each other where no area is written that another reads.
    ///
    /// # Errors
    /// The two are no tiles of one picture, or not of the same frame; the area lies beyond one of them.
    pub fn take_margin(&self, encoder: &mut wgpu::CommandEncoder, neighbour: &Self, area: Area) -> Result<(), Error> {
        let (own, other) = (self.place(area)?, neighbour.place(area)?);
        let is_alike = self.tile.map(|t| t.whole) == neighbour.tile.map(|t| t.whole)
            && self.ledger == neighbour.ledger
            && self.program.2.resources == neighbour.program.2.resources
            && self.options.storage == neighbour.options.storage;
        if !is_alike {
            return Err(Error::Neighbour);
        }
        for resource in self.program.2.resources.iter().filter(|r| r.role == Role::Persistent) {
            let views = [neighbour.plane(resource.slot), self.plane(resource.slot)];
            let [Some(from), Some(to)] = views.map(|view| view.map(|v| v.texture().as_image_copy())) else { continue };
            let from = wgpu::TexelCopyTextureInfo { origin: other, ..from };
            let to = wgpu::TexelCopyTextureInfo { origin: own, ..to };
            encoder.copy_texture_to_texture(from, to, extent_of(area.size));
        }
        Ok(())
    }

    /// Where an area of the picture begins in this tile.
    fn place(&self, area: Area) -> Result<wgpu::Origin3d, Error> {
        let (Some(tile), Some(size)) = (self.tile, self.last_size()) else { return Err(Error::Neighbour) };
        let along = |k: usize, extent: usize, wanted: usize| {
            let begin = area.origin[k].checked_sub(tile.origin[k])?;
            (begin as usize).checked_add(wanted).is_some_and(|end| end <= extent).then_some(begin)
        };
        let [x, y] = [along(0, size.width, area.size.width), along(1, size.height, area.size.height)];
        match (x, y) {
            (Some(x), Some(y)) => Ok(wgpu::Origin3d { x, y, z: 0 }),
            _ => Err(Error::Tile { origin: area.origin, size: area.size, whole: tile.whole }),
        }
    }
}

/// How far from a pixel its results depend on images of the same frame, in pixels along an axis, for a picture of
/// `rows` rows: what the stages say, added up ([`Plan::reach_px`]), and what `changed_light` sees of history around the
/// pixel's own place. History where motion leads is not in it.
pub fn reach_px(settings: &Settings, rows: usize) -> usize {
    let seen = Signal::ALL.map(|signal| settings.changed_light.reach_px(signal));
    Plan::new(settings, Inputs::ALL).reach_px(settings, rows) + seen[0].max(seen[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_lie_in_their_picture_on_the_patterns_grid() {
        let whole = Size::new(100, 50);
        let check = |origin, width, height| Tile { origin, whole }.check(Size::new(width, height)).is_ok();
        assert!(check([0, 0], 100, 50) && check([60, 24], 40, 26));
        assert!(!check([60, 24], 41, 26) && !check([60, 24], 40, 27) && !check([62, 24], 8, 8));
        assert!(!check([u32::MAX - 3, 0], usize::MAX, 1));
        let large = Tile { origin: [0; 2], whole: Size::new(MAX_EXTENT + 1, 4) };
        assert!(large.check(Size::new(4, 4)).is_err());
    }
}
