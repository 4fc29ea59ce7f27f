//! A scene traced, denoised, scored and shown, frame by frame: what `demo` and `render` share.
//!
//! ```text
//! mod.rs         the loop over frames, and what becomes of each
//! files.rs       what is written of a frame, and where
//! references.rs  converged frames: traced and kept in the cache, or given
//! scores.rs      metrics of the frames that have a reference
//! page.rs        the player page
//! times.rs       stage times over frames
//! ```

pub mod files;
mod page;
pub mod references;
mod scores;
pub mod times;

use crate::context::Context;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Progress;
use files::Files;
use quell::{Plane, Rgb, Size};
use quell_lab::backend::{Denoiser, DeviceMemory};
use quell_lab::report::{FrameStatus, Status};
use quell_lab::tone::{Picture, Tone};
use quell_lab::tracer::TraceOn;
use quell_trace::{Control, PrimaryReplacement, RayCounts, RenderOptions, Scene};
use references::{ReferencePicture, ReferenceSource};
use scores::Scores;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::time::Instant;
use times::StageClock;

/// First frame of a scene's own sequence.
pub const FIRST_FRAME: i64 = 0;
/// Pictures that are kept for the page may take so many bytes; beyond, every n-th frame is kept.
const MOST_PICTURE_BYTES: usize = 1 << 30;

/// What is to be done.
pub struct Job {
    /// The scene, with the exposure that shall hold.
    pub scene: Scene,
    /// Number of the camera, from 1.
    pub camera: usize,
    /// Ascending.
    pub frames: Vec<i64>,
    pub options: RenderOptions,
    pub denoise: bool,
    pub references: ReferenceSource,
    pub files: Files,
}

/// What came of it.
struct Run {
    statuses: Vec<FrameStatus>,
    clock: StageClock,
    trace_seconds: f64,
    denoise_seconds: f64,
    rays: RayCounts,
    /// Values repaired, by plane and kind.
    sanitised: BTreeMap<(&'static str, &'static str), u64>,
    clamped_to_half: usize,
    noisy: Vec<Option<Picture>>,
    denoised: Vec<Option<Picture>>,
    reference: Vec<Option<Picture>>,
    scores: Scores,
    /// On a GPU.
    device_memory: Option<DeviceMemory>,
    notes: Vec<String>,
}

/// Why a frame has not become a file.
enum FrameFailure {
    /// This frame cannot be had; others may.
    This(Failure),
    /// It makes no sense to go on: the disk is full, the user has had enough.
    All(Failure),
}

impl From<quell_trace::TraceError> for FrameFailure {
    fn from(error: quell_trace::TraceError) -> Self {
        match error {
            quell_trace::TraceError::Cancelled => Self::All(error.into()),
            error => Self::This(error.into()),
        }
    }
}

impl From<quell_frames::Error> for FrameFailure {
    fn from(error: quell_frames::Error) -> Self {
        Self::All(error.into())
    }
}

impl From<quell_lab::Error> for FrameFailure {
    fn from(error: quell_lab::Error) -> Self {
        match error {
            quell_lab::Error::Quell(error) => error.into(),
            quell_lab::Error::Trace(error) => error.into(),
            error => Self::All(error.into()),
        }
    }
}

impl From<quell_trace::SceneError> for FrameFailure {
    fn from(error: quell_trace::SceneError) -> Self {
        Self::This(error.into())
    }
}

impl From<quell::Error> for FrameFailure {
    fn from(error: quell::Error) -> Self {
        Self::This(error.into())
    }
}

impl Job {
    fn size(&self) -> Size {
        self.options.size
    }

    /// Renders, denoises and writes every frame, then the page; prints the table, and the page's address last.
    pub fn run(&self, context: &Context) -> Result<(), Failure> {
        self.files.check()?;
        if self.denoise && self.frames.windows(2).any(|w| w[1] != w[0] + 1) {
            context.note("note: the frames do not follow each other; the denoiser starts afresh at each gap");
        }
        let mut run = Run::new(self, context);
        let stopped = self.render(context, &mut run)?;
        let whole = run.statuses.iter().filter(|s| s.status == Status::Done).count();
        let summary = format!("{whole} of {} frames are whole in {}", self.frames.len(), self.files.folder.display());
        if let Some(Failure::Interrupted(_)) = stopped {
            self.report_only(context, &run)?;
            return Err(Failure::Interrupted(format!("{summary}; nothing there is half written")));
        }
        if whole == 0 {
            self.report_only(context, &run)?;
            let first = run.statuses.iter().find_map(|s| s.reason.clone()).unwrap_or_default();
            return Err(Failure::Failed(stopped.map_or(first, |f| f.message().to_owned())));
        }
        let metrics = run.scores.measured(self.tone(), &mut run.notes)?;
        let page = page::Page { job: self, context, run: &run, metrics: &metrics };
        let reduced = page.write(&self.files.page())?;
        run.notes.extend(reduced);
        let mut report = self.report(context, &run);
        report.metrics = metrics.methods;
        let text = self.text(context, &report, &run);
        let url = crate::output::file_url(&self.files.page());
        let mut further = self.further(&run);
        further.insert("page".to_owned(), url.clone().into());
        context.finish(&report, further, &format!("{text}\n{url}"))?;
        match stopped {
            Some(failure) => Err(Failure::SomeFrames(format!("{}; {summary}", failure.message()))),
            None if whole < self.frames.len() => {
                let failed = run.statuses.iter().find(|s| s.status == Status::Failed);
                let why = failed.and_then(|s| s.reason.clone()).unwrap_or_default();
                Err(Failure::SomeFrames(format!("{why}; {summary}")))
            }
            None => Ok(()),
        }
    }

    /// The pictures' tone curve.
    fn tone(&self) -> Tone {
        Tone { exposure: self.scene.exposure }
    }

    /// The loop over frames; `Some` where it ended before the last.
    fn render(&self, context: &Context, run: &mut Run) -> Result<Option<Failure>, Failure> {
        let progress = Progress::new("frame", self.frames.len(), context.quiet);
        let on = context.tracer()?;
        let mut denoiser =
            if self.denoise { Some(context.backend()?.denoiser(self.size(), &context.settings)?) } else { None };
        for (index, &frame) in self.frames.iter().enumerate() {
            let failure = match self.frame(context, &on, run, &progress, denoiser.as_mut(), index) {
                Ok(()) => {
                    run.status(frame, Status::Done, None);
                    progress.done(index);
                    continue;
                }
                Err(failure) => failure,
            };
            let (failure, stop) = match failure {
                // Where the very first frame fails, the others would for the same reason.
                FrameFailure::This(failure) => (failure, index == 0),
                FrameFailure::All(failure) => (failure, true),
            };
            let reason = format!("frame {frame}: {}", failure.message());
            if !stop {
                progress.say(&format!("warning: {reason}"));
                run.status(frame, Status::Failed, Some(reason));
                progress.done(index);
                continue;
            }
            let interrupted = matches!(failure, Failure::Interrupted(_));
            run.status(frame, if interrupted { Status::Skipped } else { Status::Failed }, Some(reason.clone()));
            for &left in &self.frames[index + 1..] {
                run.status(left, Status::Skipped, Some(format!("the run ended at frame {frame}")));
            }
            return match failure {
                Failure::Usage(_) if index == 0 => Err(failure),
                Failure::Interrupted(_) => Ok(Some(failure)),
                _ => Ok(Some(Failure::Failed(reason))),
            };
        }
        Ok(None)
    }

    /// One frame: traced, written, denoised, written, compared.
    fn frame(
        &self,
        context: &Context,
        on: &TraceOn,
        run: &mut Run,
        progress: &Progress,
        denoiser: Option<&mut Denoiser>,
        index: usize,
    ) -> Result<(), FrameFailure> {
        let number = self.frames[index];
        if interrupt::asked() {
            return Err(FrameFailure::All(Failure::Interrupted("as asked".to_owned())));
        }
        let begin = Instant::now();
        let tracer = on.tracer(&self.scene, number, self.camera)?;
        // The noisy frame's share of the work, in samples.
        let reference_samples = self.references.samples_of(number);
        let part = self.options.samples as f32 / (self.options.samples as f32 + reference_samples as f32);
        let notify = |share: f32| progress.within(index, share * part, "tracing");
        let control = Control { cancel: Some(interrupt::flag()), progress: Some(&notify) };
        let rendered = tracer.render(&self.options, &control)?;
        run.trace_seconds += begin.elapsed().as_secs_f64();
        run.rays.closest += rendered.rays.closest;
        run.rays.shadow += rendered.rays.shadow;
        for note in rendered.notes {
            run.note(note);
        }
        let traced = &rendered.frame;
        let passes = traced.pass_views();
        let frame = traced.frame(&passes);
        let noisy = traced.composite();
        let kept = run.keeps(index);
        let tone = self.tone();
        let labels = self.labels(context, on);

        run.clamped_to_half += self.files.noisy(frame, &noisy, rendered.halves.as_ref(), &labels)?;
        let picture = self.files.picture(files::NOISY, number, &noisy, tone)?;
        run.noisy[index] = picture.filter(|_| kept);

        let mut shown: Option<Plane<Rgb>> = None;
        if let Some(denoiser) = denoiser {
            progress.within(index, part, "denoising");
            let begin = Instant::now();
            let output = denoiser.denoise(&frame)?;
            run.denoise_seconds += begin.elapsed().as_secs_f64();
            run.clock.add(&output.report.times);
            for (plane, repair, count) in output.report.sanitised.iter() {
                *run.sanitised.entry((plane.name(), repair.name())).or_default() += count;
            }
            run.clamped_to_half += self.files.denoised(frame, &output, &labels)?;
            let picture = self.files.picture(files::DENOISED, number, output.composite, tone)?;
            run.denoised[index] = picture.filter(|_| kept);
            if self.references.has(number) {
                shown = Some(output.composite.clone());
            }
            run.device_memory = denoiser.device_memory();
            denoiser.notes().into_iter().for_each(|note| run.note(note));
        }

        let notify = |share: f32| progress.within(index, part + share * (1.0 - part), "reference");
        let reference = self.references.of(on, &self.scene, &self.options, self.camera, number, &notify);
        if let Some(reference) = reference.map_err(FrameFailure::All)? {
            if let ReferencePicture::Traced(halves) = &reference {
                run.clamped_to_half += self.files.reference(frame, halves, &labels)?;
            }
            let own_error = reference.own_error();
            let beauty = reference.into_beauty();
            let picture = self.files.picture(files::REFERENCE, number, &beauty, tone)?;
            run.reference[index] = picture.filter(|_| kept);
            run.scores.add(index, number, noisy, shown, beauty, rendered.frame.view_depth, own_error);
        }
        Ok(())
    }

    /// What the headers of files say.
    fn labels(&self, context: &Context, on: &TraceOn) -> files::Labels {
        files::Labels {
            scene: format!("{} camera {}", self.scene.name, self.camera),
            scene_hash: quell_trace::scene_hash(&self.scene, &self.options),
            sampling: self.sampling() + on.label(),
            settings: crate::context::settings_toml(context.preset, &context.settings),
            exposure: self.scene.exposure,
        }
    }

    /// How light was sampled, in words.
    fn sampling(&self) -> String {
        let o = &self.options;
        let estimator = match o.estimator {
            quell_trace::Estimator::Exact => "exact",
            quell_trace::Estimator::Paper => "paper",
        };
        let s = if o.samples == 1 { "" } else { "s" };
        format!("{estimator} estimator, {} sample{s} a pixel, {} bounces, seed {}", o.samples, o.bounces, o.seed)
    }

    fn report(&self, context: &Context, run: &Run) -> quell_lab::report::Report {
        let mut report = context.report();
        let o = &self.options;
        let estimator = if o.estimator == quell_trace::Estimator::Paper { "paper" } else { "exact" };
        let replacement = match o.primary_replacement {
            PrimaryReplacement::Off => "off",
            PrimaryReplacement::Glass => "glass",
            PrimaryReplacement::GlassAndMirrors => "mirrors",
        };
        let own: [(&str, Value); 14] = [
            ("scene", self.scene.name.as_str().into()),
            ("scene_hash", quell_trace::scene_hash(&self.scene, o).into()),
            ("camera", self.camera.into()),
            ("size", self.size().to_string().into()),
            ("spp", o.samples.into()),
            ("bounces", o.bounces.into()),
            ("seed", o.seed.into()),
            ("estimator", estimator.into()),
            ("direct_samples", o.direct_samples.into()),
            ("jitter", o.jitter.into()),
            ("replacement", replacement.into()),
            ("indirect_clamp", f64::from(o.indirect_clamp).into()),
            ("exposure", f64::from(self.scene.exposure).into()),
            ("denoise", self.denoise.into()),
        ];
        report.settings.extend(own.map(|(name, value)| (name.to_owned(), value)));
        report.frames.clone_from(&run.statuses);
        report.stages = run.clock.stages();
        let repaired = run.sanitised.iter().map(|(&(plane, kind), &count)| quell_lab::report::Sanitised {
            plane: plane.to_owned(),
            kind: kind.to_owned(),
            count,
        });
        report.sanitised = repaired.collect();
        report.warnings = run.warnings();
        report
    }

    /// A report of a run that ended early; a file only, and JSON where that was asked for.
    fn report_only(&self, context: &Context, run: &Run) -> Result<(), Failure> {
        if context.report_file.is_none() && !context.json {
            return Ok(());
        }
        let (report, further) = (self.report(context, run), self.further(run));
        context.finish(&report, further, "")
    }

    /// Fields beside those that every report has.
    fn further(&self, run: &Run) -> Map<String, Value> {
        let mut further = Map::new();
        let done = run.statuses.iter().filter(|s| s.status == Status::Done).count().max(1) as f64;
        further.insert("output".to_owned(), self.files.folder.to_string_lossy().into());
        further.insert("trace_ms_per_frame".to_owned(), (run.trace_seconds * 1e3 / done).into());
        further.insert("denoise_ms_per_frame".to_owned(), (run.denoise_seconds * 1e3 / done).into());
        further.insert("rays_per_second".to_owned(), run.rays_per_second().into());
        if let Some(memory) = &run.device_memory {
            further.insert("device_memory_bytes".to_owned(), memory.json());
        }
        further.insert("notes".to_owned(), run.notes.clone().into());
        further
    }

    /// Tables and sentences for a person.
    fn text(&self, context: &Context, report: &quell_lab::report::Report, run: &Run) -> String {
        use quell_lab::report::table::{metrics_table, stage_table};
        let done = run.statuses.iter().filter(|s| s.status == Status::Done).count().max(1) as f64;
        let mut text = String::new();
        if !report.metrics.is_empty() {
            text.push_str(&format!("{}\n", metrics_table(&report.metrics)));
        }
        if context.verbose && !report.stages.is_empty() {
            text.push_str(&format!("{}\n", stage_table(&report.stages)));
        }
        if context.verbose {
            if let Some(memory) = &run.device_memory {
                text.push_str(&format!("device memory: {memory}\n"));
            }
            for note in &run.notes {
                text.push_str(&format!("{note}\n"));
            }
        }
        for warning in &report.warnings {
            text.push_str(&format!("warning: {warning}\n"));
        }
        let ms = |seconds: f64| format!("{:.0} ms", seconds * 1e3 / done);
        text.push_str(&format!("a frame: {} to trace", ms(run.trace_seconds)));
        if self.denoise {
            text.push_str(&format!(", {} to denoise", ms(run.denoise_seconds)));
        }
        text.push_str(&format!("; files in {}", self.files.folder.display()));
        text
    }
}

impl Run {
    fn new(job: &Job, context: &Context) -> Self {
        let empty = || job.frames.iter().map(|_| None).collect::<Vec<_>>();
        Self {
            statuses: Vec::new(),
            clock: StageClock::default(),
            trace_seconds: 0.0,
            denoise_seconds: 0.0,
            rays: RayCounts::default(),
            sanitised: BTreeMap::new(),
            clamped_to_half: 0,
            noisy: empty(),
            denoised: empty(),
            reference: empty(),
            scores: Scores::new(job, context),
            device_memory: None,
            notes: Vec::new(),
        }
    }

    fn status(&mut self, frame: i64, status: Status, reason: Option<String>) {
        self.statuses.push(FrameStatus { frame, status, reason });
    }

    /// A sentence once.
    fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Whether the pictures of this frame are kept for the page.
    fn keeps(&self, index: usize) -> bool {
        (self.noisy.len() - 1 - index).is_multiple_of(self.scores.picture_step)
    }

    fn rays_per_second(&self) -> f64 {
        if self.trace_seconds > 0.0 { self.rays.total() as f64 / self.trace_seconds } else { 0.0 }
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for ((plane, kind), count) in &self.sanitised {
            warnings.push(format!("plane `{plane}`: {count} values {kind}"));
        }
        if self.clamped_to_half > 0 {
            warnings.push(format!(
                "{} colour values were beyond 65504 and are stored as that; leave --half away to keep them",
                self.clamped_to_half
            ));
        }
        warnings
    }
}
