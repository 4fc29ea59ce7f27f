//! What the passes of a program read besides planes: settings that fit its frames, and tables of taps.

use super::guides::pack_spiral;
use super::program::Contents;
use super::slot::Slot;
use super::uniforms::SettingsUniforms;
use crate::kernels::spiral::{PHASES, Spiral, SpiralShape};
use crate::plane::Size;
use crate::settings::Settings;

/// Frames after which tables of taps repeat themselves.
pub const TAP_FRAMES: usize = PHASES;

impl SettingsUniforms {
    /// For images of `size` that have these contents.
    pub fn of(settings: &Settings, size: Size, contents: Contents) -> Self {
        let [matte, glossy] = [contents.matte, contents.glossy];
        let there = |of: fn(super::SignalContents) -> bool| [matte.is_some_and(of), glossy.is_some_and(of)];
        let ([matte_direct, glossy_direct], [matte_weight, glossy_weight]) = (there(|s| s.direct), there(|s| s.weight));
        Self::new(settings, size)
            .with_terms(matte.is_some(), glossy.is_some(), matte_direct, glossy_direct)
            .with_weights(matte_weight, glossy_weight)
            .with_direct(contents.direct)
    }
}

/// The table of a slot whose role is [`super::Role::Taps`], for images of `rows` rows, in a frame: what its storage buffer
/// holds.
pub fn pack_taps(settings: &Settings, slot: Slot, rows: usize, frame: i64) -> Vec<u8> {
    let shape = match slot {
        Slot::PrefilterTaps => SpiralShape::prefilter(&settings.matte_prefilter, rows, frame),
        _ => SpiralShape::bilateral(&settings.matte_bilateral, rows, frame),
    };
    pack_spiral(&Spiral::new(&shape))
}
