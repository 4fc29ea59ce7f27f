//! What a GPU denoiser is made with.

use super::storage::Storage;
use crate::settings::Settings;

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
    /// Begins the label of every resource and pass.
    pub label: String,
}

impl Options {
    /// Half storage, fused.
    pub fn new(settings: &Settings) -> Self {
        Self { settings: settings.clone(), storage: Storage::default(), fuse: true, label: "quell".to_owned() }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self::new(&Settings::default())
    }
}
