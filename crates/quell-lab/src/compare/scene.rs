//! A sequence from a scene: noisy frames and references rendered, kept, continued where they stopped.

use super::folder::noisy_frame;
use super::sequence::{NoisyFrame, ReferenceHalf, Sequence, SequenceReference, Stored, scored_of};
use crate::cache::Cache;
use crate::error::Error;
use crate::references::{ReferenceOf, ReferencePair, ReferenceTarget, converge_on};
use crate::tone::Tone;
use crate::tracer::TraceOn;
use quell_frames::{Content, FrameToWrite, Half, Metadata, WriteOptions, frame_path, read_frame, write_frame};
use quell_trace::{Control, Estimator, PrimaryReplacement, RenderOptions, Scene, scene_hash};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Frames kept in memory may take so many bytes where they lie in files as well.
const MOST_FRAME_BYTES: usize = 3 << 29;
/// Cost of a noisy frame's guides and direct light, in samples of a reference; for the time that is left.
const FRAME_COST: f32 = 4.0;
/// Subfolder and stem of the noisy frames, as `quell render` names them.
pub const NOISY: &str = "noisy";

/// What is rendered.
pub struct SceneSource<'a> {
    /// The scene, with the exposure that shall hold.
    pub scene: &'a Scene,
    /// Camera, from 1.
    pub camera: usize,
    /// Frame numbers, ascending, at least one.
    pub frames: Vec<i64>,
    /// How the noisy frames are sampled. From two samples a pixel on they come in two halves, with variances.
    pub options: RenderOptions,
    /// How far references converge. Their light is always sampled by the exact estimator without a clamp, and from
    /// one seed, so that noisy frames of all seeds share them.
    pub target: ReferenceTarget,
    /// Frames that get references, ascending.
    pub references: Vec<i64>,
    /// What traces frames and references. Those of another tracer are not taken from `folder` or `cache`.
    pub on: &'a TraceOn,
    /// Where references are kept.
    pub cache: Option<&'a Cache>,
    /// Where noisy frames are kept, as `noisy/noisy.0012.exr`; without it, in memory.
    pub folder: Option<&'a Path>,
}

/// How far a sequence has come.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceProgress {
    /// Share of the work, 0..1.
    pub share: f32,
    /// What is being done.
    pub note: String,
}

impl SceneSource<'_> {
    /// Renders what is not kept yet. `notify` hears of progress, often.
    ///
    /// # Errors
    /// [`Error::Trace`] ([`quell_trace::TraceError::Cancelled`] after a stop; what was finished is kept), files that cannot be
    /// written, [`Error::Empty`] without frames.
    pub fn load(
        &self,
        cancel: Option<&std::sync::atomic::AtomicBool>,
        notify: &(dyn Fn(&SequenceProgress) + Sync),
    ) -> Result<Sequence, Error> {
        if self.frames.is_empty() {
            return Err(Error::Empty { what: "a sequence needs at least one frame".to_owned() });
        }
        let options = self.noisy_options();
        let reference_options =
            RenderOptions { seed: 0, estimator: Estimator::Exact, indirect_clamp: 0.0, ..self.options };
        let work = Work {
            noisy: FRAME_COST + self.options.samples as f32,
            reference: 2.0 * self.target.samples.max(1) as f32,
            total: 0.0,
        };
        let work = Work {
            total: work.noisy * self.frames.len() as f32 + work.reference * self.references.len() as f32,
            ..work
        };
        let mut sequence = Sequence {
            name: self.scene.name.clone(),
            description: format!("camera {}; {}", self.camera, self.sampling(&options)),
            size: options.size,
            numbers: self.frames.clone(),
            scored: scored_of(&self.frames, &self.references),
            tone: Tone { exposure: self.scene.exposure },
            identity: format!(
                "{} camera {}, {}, exposure {}",
                scene_hash(self.scene, &options),
                self.camera,
                self.sampling(&options),
                self.scene.exposure
            ),
            notes: Vec::new(),
            stored: Vec::new(),
            references: BTreeMap::new(),
        };
        let mut bytes_in_memory = 0;
        for (index, &number) in self.frames.iter().enumerate() {
            let before = work.noisy * index as f32;
            let tell = |share: f32| {
                let share = (before + share * work.noisy) / work.total;
                let note = format!("noisy frame {number} ({} of {})", index + 1, self.frames.len());
                notify(&SequenceProgress { share, note });
            };
            tell(0.0);
            let control = Control { cancel, progress: Some(&tell) };
            let (frame, path) = self.noisy(number, &options, &control, &mut sequence.notes)?;
            let bytes = bytes_of(&frame);
            let stored = match path {
                Some(path) if bytes_in_memory + bytes > MOST_FRAME_BYTES => Stored::File(path),
                path => {
                    bytes_in_memory += bytes;
                    Stored::Memory(Box::new(frame), path)
                }
            };
            sequence.stored.push(stored);
        }
        let noisy_done = work.noisy * self.frames.len() as f32;
        for (index, &number) in self.references.iter().enumerate() {
            let what =
                ReferenceOf { scene: self.scene, camera: self.camera, frame: number, options: &reference_options };
            let before = noisy_done + work.reference * index as f32;
            let control = Control { cancel, progress: None };
            let pair = converge_on(self.on, self.cache, &what, &self.target, &control, |p| {
                let part = p.samples as f32 / p.of.max(1) as f32;
                let share = (before + part.min(1.0) * work.reference) / work.total;
                let note = format!(
                    "reference of frame {number} ({} of {}), {} of 2 x {} samples",
                    index + 1,
                    self.references.len(),
                    2 * p.samples.min(p.of),
                    p.of
                );
                notify(&SequenceProgress { share, note });
            })?;
            sequence.references.insert(number, reference_of(pair)?);
        }
        Ok(sequence)
    }

    /// How light was sampled, and by which tracer where that is not the CPU's.
    fn sampling(&self, options: &RenderOptions) -> String {
        sampling(options) + self.on.label()
    }

    /// As the noisy frames are traced.
    fn noisy_options(&self) -> RenderOptions {
        let several = self.options.samples > 1;
        RenderOptions { halves: several, variances: several, ..self.options }
    }

    fn noisy(
        &self,
        number: i64,
        options: &RenderOptions,
        control: &Control<'_>,
        notes: &mut Vec<String>,
    ) -> Result<(NoisyFrame, Option<PathBuf>), Error> {
        let metadata = Metadata {
            content: Content::Noisy,
            scene: format!("{} camera {}", self.scene.name, self.camera),
            scene_hash: scene_hash(self.scene, options),
            sampling: self.sampling(options),
            exposure: self.scene.exposure,
            ..Metadata::default()
        };
        let path = self.folder.map(|folder| frame_path(&folder.join(NOISY), NOISY, number));
        if let Some(path) = path.as_deref().filter(|path| path.is_file())
            && let Ok(file) = read_frame(path)
        {
            let m = &file.metadata;
            let same = (&m.scene, &m.scene_hash, &m.sampling)
                == (&metadata.scene, &metadata.scene_hash, &metadata.sampling)
                && (file.frame.index, file.frame.size) == (number, options.size);
            if same {
                return Ok((noisy_frame(file), Some(path.to_owned())));
            }
        }
        let rendered = self.on.tracer(self.scene, number, self.camera)?.render(options, control)?;
        for note in rendered.notes {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        let noisy = NoisyFrame { frame: rendered.frame, halves: rendered.halves };
        if let Some(path) = &path {
            write_noisy(path, &noisy, metadata)?;
        }
        Ok((noisy, path))
    }
}

/// Shares of the work, in samples of a reference frame.
struct Work {
    noisy: f32,
    reference: f32,
    total: f32,
}

/// Writes a noisy frame with its halves; an older one of quell's is replaced.
///
/// # Errors
/// Those of [`write_frame`].
pub fn write_noisy(path: &Path, noisy: &NoisyFrame, metadata: Metadata) -> Result<(), Error> {
    let passes = noisy.frame.pass_views();
    let half = |i: usize| {
        noisy.halves.as_ref().map_or(Half::default(), |h| Half {
            composite: None,
            matte: Some(h[i].matte.view()),
            glossy: Some(h[i].glossy.view()),
        })
    };
    let file = FrameToWrite { halves: [half(0), half(1)], metadata, ..FrameToWrite::new(noisy.frame.frame(&passes)) };
    write_frame(path, &file, &WriteOptions::default())?;
    Ok(())
}

fn reference_of(pair: ReferencePair) -> Result<SequenceReference, Error> {
    let mean = pair.mean()?.beauty;
    let own_error = Some(pair.rel_mse());
    let half = |r: quell_trace::Reference| ReferenceHalf {
        beauty: r.beauty,
        direct: Some(r.direct),
        matte: Some(r.matte),
        glossy: Some(r.glossy),
    };
    Ok(SequenceReference { mean, halves: Some([half(pair.a), half(pair.b)]), own_error })
}

/// How light was sampled, in words.
pub fn sampling(options: &RenderOptions) -> String {
    let estimator = match options.estimator {
        Estimator::Exact => "exact",
        Estimator::Paper => "paper",
    };
    let samples = match options.samples {
        1 => "1 sample a pixel".to_owned(),
        n if options.halves => format!("{n} samples a pixel in two halves"),
        n => format!("{n} samples a pixel"),
    };
    let mirrors = match options.primary_replacement {
        PrimaryReplacement::GlassAndMirrors => "",
        PrimaryReplacement::Glass => ", mirrors as surfaces",
        PrimaryReplacement::Off => ", mirrors and glass as surfaces",
    };
    format!("{estimator} estimator, {samples}, {} bounces, seed {}{mirrors}", options.bounces, options.seed)
}

/// Bytes that a frame takes, about.
fn bytes_of(noisy: &NoisyFrame) -> usize {
    let f = &noisy.frame;
    let colours =
        [&f.direct, &f.matte, &f.glossy, &f.direct_matte, &f.direct_glossy, &f.matte_weight, &f.glossy_weight];
    let colours = colours.into_iter().flatten().count() + f.passes.len() + usize::from(f.normal.is_some());
    let singles = [&f.view_depth, &f.roughness, &f.glossy_hit_distance, &f.matte_hit_distance, &f.alpha];
    let singles = singles.into_iter().flatten().count() + 3;
    let halves = if noisy.halves.is_some() { 4 } else { 0 };
    f.size.pixels() * (12 * (colours + halves) + 4 * singles + 8)
}
