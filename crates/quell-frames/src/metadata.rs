//! What a file says about a frame beside its planes.

/// What the colours of a file are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Content {
    /// As the renderer made them.
    #[default]
    Noisy,
    /// Filtered.
    Denoised,
    /// Converged.
    Reference,
}

impl Content {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Noisy, Self::Denoised, Self::Reference];

    /// The word in the header.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Noisy => "noisy",
            Self::Denoised => "denoised",
            Self::Reference => "reference",
        }
    }
}

/// Header attributes that are not part of a `Frame`. Texts may hold any characters; empty ones are not written.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// What the colours are.
    pub content: Content,
    /// Version of quell that wrote the file; filled in on writing.
    pub version: String,
    /// Scene, clip and camera, as the user named them.
    pub scene: String,
    /// Hash of scene, tracer and options, in hexadecimal: shows whether a stored reference still fits.
    pub scene_hash: String,
    /// How the light was sampled: estimator, samples a pixel, bounces, seed.
    pub sampling: String,
    /// Settings of the denoiser (TOML), on denoised files.
    pub settings: String,
    /// What was mapped to what, where the frame came from another file.
    pub mapping: String,
    /// Frames a second, 0: unknown.
    pub frames_per_second: f32,
    /// Brightness that the picture is meant for: viewers multiply light by it before a tone curve; > 0. No filter reads it.
    pub exposure: f32,
}

impl Default for Metadata {
    /// Noisy, without texts, exposure 1.
    fn default() -> Self {
        Self {
            content: Content::default(),
            version: String::new(),
            scene: String::new(),
            scene_hash: String::new(),
            sampling: String::new(),
            settings: String::new(),
            mapping: String::new(),
            frames_per_second: 0.0,
            exposure: 1.0,
        }
    }
}
