//! Metrics of the frames that have a reference.

use super::{Job, MOST_PICTURE_BYTES};
use crate::context::Context;
use crate::failure::Failure;
use quell::{Plane, Rgb};
use quell_lab::metrics::{Exposures, FrameScores, mean_scores};
use quell_lab::report::MethodScores;
use quell_lab::report::json::NumberedScores;
use quell_lab::tone::Tone;

/// Planes that wait to be scored may take so many bytes; beyond, every n-th frame is scored.
const MOST_PLANE_BYTES: usize = 3 << 29;
/// Bytes a pixel of what waits: three pictures and a depth.
const BYTES_PER_PIXEL: usize = 3 * 12 + 4;
/// The first frames of a run are the start, not the steady state.
const START_FRAMES: usize = 16;

/// Gathers frames; scores them when all references are known, because exposures are fixed once a sequence.
pub struct Scores {
    method: Option<String>,
    frame_step: usize,
    /// Every how many frames a picture is kept for the page.
    pub picture_step: usize,
    waiting: Vec<Waiting>,
    seen: usize,
    own_errors: Vec<f64>,
}

struct Waiting {
    index: usize,
    number: i64,
    noisy: Plane<Rgb>,
    denoised: Option<Plane<Rgb>>,
    reference: Plane<Rgb>,
    depth: Option<Plane<f32>>,
}

/// Scores and maps.
#[derive(Default)]
pub struct Metrics {
    /// Noisy first; empty without references.
    pub methods: Vec<MethodScores>,
    /// Error maps, by index of the frame.
    pub noisy_maps: Vec<(usize, Plane<f32>)>,
    pub denoised_maps: Vec<(usize, Plane<f32>)>,
}

impl Scores {
    pub fn new(job: &Job, context: &Context) -> Self {
        let pixels = job.options.size.pixels();
        let fitting = |most: usize, each: usize| job.frames.len().div_ceil((most / each.max(1)).max(1)).max(1);
        Self {
            method: job.denoise.then(|| context.method()),
            frame_step: fitting(MOST_PLANE_BYTES, pixels * BYTES_PER_PIXEL),
            picture_step: fitting(MOST_PICTURE_BYTES, pixels * 9),
            waiting: Vec::new(),
            seen: 0,
            own_errors: Vec::new(),
        }
    }

    /// One more frame with its reference.
    #[expect(clippy::too_many_arguments, reason = "one frame's planes, handed over once")]
    pub fn add(
        &mut self,
        index: usize,
        number: i64,
        noisy: Plane<Rgb>,
        denoised: Option<Plane<Rgb>>,
        reference: Plane<Rgb>,
        depth: Option<Plane<f32>>,
        own_error: Option<f64>,
    ) {
        self.own_errors.extend(own_error);
        if self.seen.is_multiple_of(self.frame_step) {
            self.waiting.push(Waiting { index, number, noisy, denoised, reference, depth });
        }
        self.seen += 1;
    }

    /// Measures what was gathered; says what a reader must know.
    pub fn measured(&self, tone: Tone, notes: &mut Vec<String>) -> Result<Metrics, Failure> {
        let mut metrics = Metrics::default();
        if self.waiting.is_empty() {
            return Ok(metrics);
        }
        if self.frame_step > 1 {
            notes.push(format!("Every {}th reference is scored: all of them do not fit memory.", self.frame_step));
        }
        if !self.own_errors.is_empty() {
            let mean = self.own_errors.iter().sum::<f64>() / self.own_errors.len() as f64;
            notes.push(format!("The references' own trimmed relMSE is {mean:.2e} (from their halves)."));
        }
        let exposures = Exposures::from_reference(self.waiting.iter().map(|w| (&w.reference, w.depth.as_ref())));
        let exposures = match exposures {
            Ok(exposures) => exposures,
            Err(quell_lab::Error::Empty { what }) => {
                notes.push(format!("No scores: {what}."));
                return Ok(metrics);
            }
            Err(error) => return Err(error.into()),
        };
        let mut methods = vec![("noisy".to_owned(), Vec::new())];
        methods.extend(self.method.clone().map(|name| (name, Vec::new())));
        for waiting in &self.waiting {
            let (scores, map) = FrameScores::measure(&waiting.noisy, &waiting.reference, tone, &exposures)?;
            methods[0].1.push((waiting.index, NumberedScores { frame: waiting.number, scores }));
            metrics.noisy_maps.push((waiting.index, map.map));
            if let (Some(denoised), Some(method)) = (&waiting.denoised, methods.get_mut(1)) {
                let (scores, map) = FrameScores::measure(denoised, &waiting.reference, tone, &exposures)?;
                method.1.push((waiting.index, NumberedScores { frame: waiting.number, scores }));
                metrics.denoised_maps.push((waiting.index, map.map));
            }
        }
        let steady = self.waiting.iter().filter(|w| w.index >= START_FRAMES).count();
        if steady == 0 {
            notes.push(format!("All scored frames are among the first {START_FRAMES}: no steady state yet."));
        } else if steady < self.waiting.len() {
            notes.push(format!("Means leave out the first {START_FRAMES} frames: the start is not the steady state."));
        }
        metrics.methods = methods
            .into_iter()
            .map(|(method, frames)| {
                let counted = |index: usize| steady == 0 || index >= START_FRAMES;
                let in_mean: Vec<FrameScores> =
                    frames.iter().filter(|(index, _)| counted(*index)).map(|(_, f)| f.scores).collect();
                MethodScores { method, mean: mean_scores(&in_mean), frames: frames.into_iter().map(|f| f.1).collect() }
            })
            .collect();
        Ok(metrics)
    }
}
