//! What a GPU denoiser is made with.

use super::storage::Storage;
use crate::settings::{Preset, Settings};

/// Options of [`super::Denoiser::new`]; made by [`Options::new`], then changed field by field.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Parameters of the stages; they can change at every frame.
    pub settings: Settings,
    /// How planes are stored.
    pub storage: Storage,
    /// Stages that can share a pass do. Off: one stage a pass, to bisect and to compare with.
    pub fuse: bool,
    /// Planes that are needed within a frame only share textures: the same bits in a sixth less memory (half storage, both
    /// signals, direct light and the sum). On by default. Off: [`super::Denoiser::plane`] and [`super::DebugView::Light`]
    /// have every intermediate image.
    pub share_planes: bool,
    /// The sum is made, and where the frame has jitter it is anti-aliased over time (`antialiasing`; without that stage its direct light,
    /// stage 11). Off by default: hosts have their own; then [`super::Output::composite`] is `None`.
    pub composite: bool,
    /// Repairs of colours are counted ([`super::Output::repairs`]), which reads every colour once more. Those of guides
    /// that come as textures always are.
    pub count_repairs: bool,
    /// Timestamps around every dispatch, where the device has the feature `TIMESTAMP_QUERY`: for
    /// [`super::Denoiser::resolve_timings`]. Off by default.
    pub timings: bool,
    /// Begins the label of every resource and pass.
    pub label: String,
}

impl Options {
    /// Half storage, fused, signals only.
    pub fn new(settings: &Settings) -> Self {
        Self {
            settings: settings.clone(),
            storage: Storage::default(),
            fuse: true,
            share_planes: true,
            composite: false,
            count_repairs: false,
            timings: false,
            label: "quell".to_owned(),
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self::new(&Settings::preset(Preset::default()))
    }
}
