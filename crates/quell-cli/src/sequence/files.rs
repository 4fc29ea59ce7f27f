//! What is written of a frame, and where: `DIR/noisy/noisy.0012.exr`, `DIR/denoised/denoised.0012.png` and so on.

use crate::failure::Failure;
use crate::output;
use quell::{Frame, Output, Plane, Rgb};
use quell_frames::{Content, FrameToWrite, Half, Metadata, Precision, WriteOptions, frame_path, write_frame};
use quell_lab::tone::{Picture, Tone};
use quell_trace::{HalfSignals, Reference};
use std::path::{Path, PathBuf};

pub const NOISY: &str = "noisy";
pub const DENOISED: &str = "denoised";
pub const REFERENCE: &str = "reference";

/// What a player shows; built-in scenes are made for it.
pub const FRAMES_PER_SECOND: f32 = 24.0;

/// Where files go and which are written.
pub struct Files {
    pub folder: PathBuf,
    /// Every frame with all its planes.
    pub exr: bool,
    /// Every frame as a picture.
    pub png: bool,
    pub colours: Precision,
    /// Also replace EXR files that quell did not write.
    pub overwrite: bool,
}

/// What headers say.
pub struct Labels {
    pub scene: String,
    pub scene_hash: String,
    pub sampling: String,
    /// TOML.
    pub settings: String,
    /// Brightness of pictures.
    pub exposure: f32,
}

impl Files {
    /// Tries the folder before work begins.
    pub fn check(&self) -> Result<(), Failure> {
        output::check_folder(&self.folder)?;
        output::check_page(&self.page())
    }

    /// The player page.
    pub fn page(&self) -> PathBuf {
        self.folder.join("index.html")
    }

    /// A frame's EXR file.
    pub fn path(&self, kind: &str, frame: i64) -> PathBuf {
        frame_path(&self.folder.join(kind), kind, frame)
    }

    fn options(&self) -> WriteOptions {
        WriteOptions { colours: self.colours, overwrite: self.overwrite }
    }

    fn write(&self, kind: &str, frame: &FrameToWrite<'_>) -> Result<usize, quell_frames::Error> {
        if !self.exr {
            return Ok(0);
        }
        let path = self.path(kind, frame.frame.index);
        Ok(write_frame(&path, frame, &self.options())?.clamped_to_half)
    }

    /// The picture for the screen, written where pictures are.
    pub fn picture(
        &self,
        kind: &str,
        frame: i64,
        plane: &Plane<Rgb>,
        tone: Tone,
    ) -> Result<Option<Picture>, quell_lab::Error> {
        let picture = tone.picture(plane);
        if self.png {
            picture.write_png(&self.path(kind, frame).with_extension("png"))?;
        }
        Ok(Some(picture))
    }

    /// The frame as traced, with the two halves of its samples where there are any. Returns how many colours did not
    /// fit half float, here and below.
    pub fn noisy(
        &self,
        frame: Frame<'_>,
        composite: &Plane<Rgb>,
        halves: Option<&[HalfSignals; 2]>,
        labels: &Labels,
    ) -> Result<usize, quell_frames::Error> {
        let metadata = labels.metadata(Content::Noisy);
        let halves = halves.map_or([Half::default(); 2], |halves| {
            halves.each_ref().map(|h| Half {
                composite: None,
                matte: Some(h.matte.view()),
                glossy: Some(h.glossy.view()),
            })
        });
        self.write(
            NOISY,
            &FrameToWrite { composite: Some(composite.view()), halves, metadata, ..FrameToWrite::new(frame) },
        )
    }

    /// The filtered frame: guides as they were, signals and picture filtered.
    pub fn denoised(
        &self,
        frame: Frame<'_>,
        output: &Output<'_>,
        labels: &Labels,
    ) -> Result<usize, quell_frames::Error> {
        let frame = Frame {
            direct: Some(output.direct.view()),
            matte: output.matte.map(Plane::view),
            glossy: output.glossy.map(Plane::view),
            ..frame
        };
        let mut metadata = labels.metadata(Content::Denoised);
        metadata.settings.clone_from(&labels.settings);
        self.write(
            DENOISED,
            &FrameToWrite {
                composite: Some(output.composite.view()),
                confidence: Some(output.confidence.view()),
                history_length: Some(output.history_length.view()),
                metadata,
                ..FrameToWrite::new(frame)
            },
        )
    }

    /// The converged frame: the mean of both halves, and each half.
    pub fn reference(
        &self,
        frame: Frame<'_>,
        halves: &super::references::Halves,
        labels: &Labels,
    ) -> Result<usize, quell_frames::Error> {
        let mean = &halves.mean;
        let frame = Frame {
            direct: Some(mean.direct.view()),
            matte: Some(mean.matte.view()),
            glossy: Some(mean.glossy.view()),
            matte_variance: None,
            glossy_variance: None,
            ..frame
        };
        let mut metadata = labels.metadata(Content::Reference);
        metadata.sampling = format!("{}; reference of 2 x {} samples a pixel", labels.sampling, halves.pair.a.samples);
        let halves = [half(&halves.pair.a), half(&halves.pair.b)];
        self.write(
            REFERENCE,
            &FrameToWrite { composite: Some(mean.beauty.view()), halves, metadata, ..FrameToWrite::new(frame) },
        )
    }
}

fn half(reference: &Reference) -> Half<'_> {
    Half {
        composite: Some(reference.beauty.view()),
        matte: Some(reference.matte.view()),
        glossy: Some(reference.glossy.view()),
    }
}

impl Labels {
    fn metadata(&self, content: Content) -> Metadata {
        Metadata {
            content,
            scene: self.scene.clone(),
            scene_hash: self.scene_hash.clone(),
            sampling: self.sampling.clone(),
            frames_per_second: FRAMES_PER_SECOND,
            exposure: self.exposure,
            ..Metadata::default()
        }
    }
}

/// Reads the picture of a file of quell.
pub fn composite_of(path: &Path) -> Result<Plane<Rgb>, quell_frames::Error> {
    let file = quell_frames::read_frame(path)?;
    Ok(file.composite.unwrap_or_else(|| file.frame.composite()))
}
