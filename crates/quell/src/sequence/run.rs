//! The walk along the plan: stages of one frame on one back end.

use super::accelerator::{self, Accelerator, WaveletJob};
use super::finish::Finish;
use super::pipeline::{SequencePlan, SequenceStage};
use super::settings::{self, Gather, Reflections, SequenceSettings, Stabilise, Variance, Wavelet};
use crate::denoiser::Backend;
use crate::error::Error;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::stages::blend::{Blend, BlendFrame, Steady};
use crate::stages::gather::{self, Gathered};
use crate::stages::reflection_motion::ReflectionMotion;
use crate::stages::stabilise::{Likeness, StabiliseFrame};
use crate::window::{Features, HalfRows, LightSlot, LocalFeatures, PreparedFrame, Rows, Sparse, Vectors};

/// Of each light the variance that the renderer gave, NaN where it is unknown.
pub(crate) type GivenVariance = [Option<Plane<f32>>];
/// A picture and its coverage, where it has one.
pub(crate) type SteadyPicture = (Plane<Rgb>, Option<Plane<f32>>);
/// Of each light of a frame its colour planes.
pub(crate) type Passes = Vec<Vec<Plane<Rgb>>>;

/// Arguments and result of `recombine`'s `rescale`.
type Rescale = fn(&PreparedFrame, &[LightSlot], &Rows, [&Plane<Rgb>; 2], Option<&Blend>) -> Passes;
/// Arguments and result of what is found along trajectories.
type AlongStage = fn(&[BlendFrame<'_>], usize, &Gather) -> Rows;
/// Arguments and result of `blend`.
type BlendStage = fn(&[BlendFrame<'_>], usize, Steady<'_>, (&Gather, &Stabilise), &settings::Blend) -> Blend;

/// The stages of the sequence filter on one back end: functions with the contracts of the stages' `reference.rs`.
pub(crate) struct SequenceStages {
    pub reflection_motion: fn(&Features, &Features, &Reflections) -> Option<ReflectionMotion>,
    pub gather: fn(&[&PreparedFrame], usize, &Gather) -> Gathered,
    pub feature_noise: fn(&Features) -> LocalFeatures,
    pub variance: fn(&LocalFeatures, &Gathered, &GivenVariance, &Variance, &Wavelet) -> Rows,
    pub wavelet: fn(&LocalFeatures, &[LightSlot], Rows, Rows, &Wavelet) -> Rows,
    pub residual: fn(&PreparedFrame, &[LightSlot], Rows, &settings::Residual) -> Rows,
    pub sum: fn(&PreparedFrame, &[LightSlot], &Rows) -> Plane<Rgb>,
    pub input: fn(&PreparedFrame, &[LightSlot], &Rows) -> Plane<Rgb>,
    pub likeness: fn(&Plane<Rgb>, &Plane<Rgb>, &Stabilise) -> Likeness,
    pub picture_residual: fn(usize, &Plane<Rgb>, Plane<Rgb>, &settings::Residual) -> Plane<Rgb>,
    pub signature: fn(&Features, &Plane<Rgb>) -> Rows,
    pub stabilise: fn(&[StabiliseFrame<'_>], usize, &Gather, &Stabilise) -> SteadyPicture,
    /// What `stabilise` and `blend` both ask of the trajectories, found once for both; `None`: each finds it for itself.
    pub along: Option<AlongStage>,
    pub blend: BlendStage,
    pub rescale: Rescale,
}

/// The stages on a back end; without the feature `cpu` the reference's.
pub(crate) fn stages_of(backend: Backend) -> &'static SequenceStages {
    match backend {
        #[cfg(feature = "cpu")]
        Backend::Cpu => &crate::cpu::sequence::STAGES,
        _ => &crate::reference::sequence::STAGES,
    }
}

/// A frame after the stages within its own window.
pub(crate) struct Estimate {
    pub slots: Vec<LightSlot>,
    /// Filtered light.
    pub colours: Rows,
    /// The sum of the beauty's lights.
    pub picture: Plane<Rgb>,
    /// The same of the lights as they came.
    pub input: Plane<Rgb>,
    /// The largest number of samples that a light's mean is worth.
    pub samples: Plane<f32>,
    /// It was estimated on a device, and shaders can be trusted with its pictures.
    pub fits_device: bool,
    /// What `stabilise` compares pixels by, where it does: made by hand, or for its net.
    pub likeness: Option<Likeness>,
    pub signature: Option<HalfRows>,
}

/// How long each stage took, by a clock of the caller's.
#[derive(Debug, Default)]
pub(crate) struct StageTimes {
    pub clock: Option<fn() -> f64>,
    /// In the order in which they ran first: name, seconds, calls.
    pub taken: Vec<(&'static str, f64, usize)>,
}

impl StageTimes {
    /// Runs `work`, a stage or a part of one.
    pub(crate) fn during<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let Some(clock) = self.clock else { return work() };
        let begin = clock();
        let result = work();
        let seconds = clock() - begin;
        match self.taken.iter_mut().find(|taken| taken.0 == name) {
            Some(taken) => (taken.1, taken.2) = (taken.1 + seconds, taken.2 + 1),
            None => self.taken.push((name, seconds, 1)),
        }
        result
    }
}

/// What the stages of one frame hand on to each other.
struct Work<'w> {
    stages: &'static SequenceStages,
    window: &'w [&'w PreparedFrame],
    centre: usize,
    settings: &'w SequenceSettings,
    gathered: Gathered,
    local: Option<LocalFeatures>,
    variance: Rows,
    picture: Plane<Rgb>,
    input: Plane<Rgb>,
    samples: Plane<f32>,
}

/// Runs the plan's stages up to [`SequenceStage::Sum`] for `window[centre]`.
///
/// # Errors
/// [`Error::Accelerator`].
pub(crate) fn estimate(
    stages: &'static SequenceStages,
    plan: &SequencePlan,
    window: &[&PreparedFrame],
    centre: usize,
    settings: &SequenceSettings,
    (accelerator, times): (Option<&dyn Accelerator>, &mut StageTimes),
) -> Result<Estimate, Error> {
    let empty = Size::new(0, 0);
    let mut work = Work {
        stages,
        window,
        centre,
        settings,
        gathered: Gathered { slots: Vec::new(), colours: Rows::empty(), moments: Rows::empty() },
        local: None,
        variance: Rows::empty(),
        picture: Plane::filled(empty, [0.0; 3]),
        input: Plane::filled(empty, [0.0; 3]),
        samples: Plane::filled(empty, 0.0),
    };
    for stage in plan.stages().filter(|stage| within_window(*stage)) {
        times.during(stage.name(), || work.run(stage, accelerator))?;
    }
    let Work { gathered: Gathered { slots, colours, .. }, picture, input, samples, .. } = work;
    Ok(Estimate { slots, colours, picture, input, samples, fits_device: false, likeness: None, signature: None })
}

/// True where shaders can be trusted with a frame's pictures and its coverage.
pub(super) fn fits_device(pictures: [&Plane<Rgb>; 2], alpha: Option<&Plane<f32>>) -> bool {
    // NaN is within nothing.
    let fits = |v: &f32| v.abs() <= accelerator::MOST_COLOUR;
    let beyond = |plane: &Plane<Rgb>| par::any(plane.data(), |colour| !colour.iter().all(fits));
    !pictures.into_iter().any(beyond) && !alpha.is_some_and(|alpha| par::any(alpha.data(), |v| !fits(v)))
}

/// True for the stages of [`estimate`]. A stage is timed where it runs alone: its calls are counted.
fn within_window(stage: SequenceStage) -> bool {
    use SequenceStage::{FeatureNoise, Gather, Residual, Sum, Variance, Wavelet};
    matches!(stage, Gather | FeatureNoise | Variance | Wavelet | Residual | Sum)
}

impl Work<'_> {
    fn run(&mut self, stage: SequenceStage, accelerator: Option<&dyn Accelerator>) -> Result<(), Error> {
        let (frame, s) = (self.window[self.centre], self.settings);
        match (stage, &self.local) {
            (SequenceStage::Gather, _) => {
                let gather = gather::settings_of(&s.gather, &frame.features);
                self.gathered = (self.stages.gather)(self.window, self.centre, &gather);
                self.samples = most_samples(frame.features.size, &self.gathered.moments);
            }
            (SequenceStage::FeatureNoise, _) => self.local = Some((self.stages.feature_noise)(&frame.features)),
            (SequenceStage::Variance, Some(local)) => {
                let slots = &self.gathered.slots;
                let given: Vec<_> = slots.iter().map(|slot| frame.given_variance(slot)).collect();
                self.variance = (self.stages.variance)(local, &self.gathered, &given, &s.variance, &s.wavelet);
                self.gathered.moments = Rows::empty();
            }
            (SequenceStage::Wavelet, Some(local)) => {
                let colours = std::mem::replace(&mut self.gathered.colours, Rows::empty());
                let variance = std::mem::replace(&mut self.variance, Rows::empty());
                let slots = &self.gathered.slots;
                self.gathered.colours = match accelerator {
                    None => (self.stages.wavelet)(local, slots, colours, variance, &s.wavelet),
                    Some(accelerator) => WaveletJob::new(frame, local, slots, &colours, &variance, &s.wavelet)
                        .and_then(|mut job| accelerator.wavelet(&mut job).map(|()| job.filtered()))
                        .map_err(|reason| accelerator::failed(accelerator, reason))?,
                };
                self.local = None;
            }
            (SequenceStage::Residual, _) => {
                let colours = std::mem::replace(&mut self.gathered.colours, Rows::empty());
                self.gathered.colours = (self.stages.residual)(frame, &self.gathered.slots, colours, &s.residual);
            }
            (SequenceStage::Sum, _) => {
                let (slots, colours) = (&self.gathered.slots, &self.gathered.colours);
                self.picture = (self.stages.sum)(frame, slots, colours);
                self.input = (self.stages.input)(frame, slots, colours);
            }
            _ => {} // of pairs of frames, or done by `finish`
        }
        Ok(())
    }
}

/// Finds what a pair of neighbouring frames shows, where the plan says so: the motion of what mirrors show.
pub(crate) fn link(
    stages: &SequenceStages,
    plan: &SequencePlan,
    previous: &mut Features,
    next: &mut Features,
    s: &SequenceSettings,
    times: &mut StageTimes,
) {
    for stage in plan.stages() {
        if stage == SequenceStage::ReflectionMotion
            && let Some(found) =
                times.during(stage.name(), || (stages.reflection_motion)(previous, next, &s.reflections))
        {
            // Kept where it is not the surface's: mirrors are few.
            let departing = |found: Option<Plane<[f32; 2]>>, surface: Option<&Vectors>| {
                let (found, surface) = (found?, surface?);
                Some(Sparse::new(found.size().pixels(), |p| found.data()[p], |p| surface.at(p)))
            };
            previous.motion.reflection_to_next = departing(found.to_next, previous.motion.to_next.as_ref());
            next.motion.reflection_to_previous = departing(found.to_previous, next.motion.to_previous.as_ref());
        }
    }
}

/// What comes out of a frame: its passes, without weights, and its coverage.
pub(crate) struct Finished {
    pub passes: Passes,
    pub alpha: Option<Plane<f32>>,
    /// Expected error of the picture, where the stage `blend` runs.
    pub noise: Option<Plane<f32>>,
}

/// Runs the plan's stages after [`SequenceStage::Sum`] for `frames[centre]`. `made`: what a device made of those before the last.
pub(crate) fn finish(
    stages: &SequenceStages,
    plan: &SequencePlan,
    frames: &[(&PreparedFrame, &Estimate)],
    centre: usize,
    s: &SequenceSettings,
    (made, times): (Option<Finish>, &mut StageTimes),
) -> Finished {
    let (frame, estimate) = frames[centre];
    let mut finished = Finished { passes: Vec::new(), alpha: frame.alpha.clone(), noise: None };
    // A stage that does not run hands its input on.
    let (mut steady, mut blend) = (None, None);
    let on_device = made.is_some();
    if let Some(Finish { steady: picture, blend: mut found }) = made {
        (finished.alpha, finished.noise) = (found.alpha.take(), Some(take(&mut found.noise)));
        (steady, blend) = (Some(picture), Some(found));
    }
    let gather = gather::settings_of(&s.gather, &frame.features);
    let asked = !on_device && plan.runs(SequenceStage::Blend);
    let along = stages
        .along
        .filter(|_| asked)
        .map(|along| times.during("blend: trajectories", || along(&blend_window(frames, None), centre, &gather)));
    let along = along.as_ref().map(|along| (centre, along));
    for stage in plan.stages().filter(|stage| !within_window(*stage)) {
        if stage == SequenceStage::ReflectionMotion || (on_device && stage != SequenceStage::Rescale) {
            continue;
        }
        times.during(stage.name(), || match stage {
            SequenceStage::Stabilise => {
                let (picture, alpha) =
                    (stages.stabilise)(&stabilise_window(frames, along), centre, &gather, &s.stabilise);
                (steady, finished.alpha) = (Some(picture), alpha);
            }
            SequenceStage::PictureResidual => {
                let correct = |picture| {
                    (stages.picture_residual)(frame.features.first_row, &estimate.input, picture, &s.residual)
                };
                steady = steady.take().map(correct);
            }
            SequenceStage::Blend => {
                let after = steady.as_ref().unwrap_or(&estimate.picture);
                let after = (after, finished.alpha.as_ref());
                let mut found =
                    (stages.blend)(&blend_window(frames, along), centre, after, (&gather, &s.stabilise), &s.blend);
                finished.alpha = found.alpha.take();
                finished.noise = Some(take(&mut found.noise));
                blend = Some(found);
            }
            SequenceStage::Rescale => {
                let pictures = [&estimate.picture, steady.as_ref().unwrap_or(&estimate.picture)];
                finished.passes = (stages.rescale)(frame, &estimate.slots, &estimate.colours, pictures, blend.as_ref());
            }
            _ => {} // of pairs of frames, or done by `estimate`
        });
    }
    finished
}

/// Leaves an empty plane.
fn take(plane: &mut Plane<f32>) -> Plane<f32> {
    std::mem::replace(plane, Plane::filled(Size::new(0, 0), 0.0))
}

/// Of one frame of a window what its trajectories show: [`BlendFrame::along`].
type Along<'a> = Option<(usize, &'a Rows)>;

pub(super) fn stabilise_window<'a>(
    frames: &'a [(&PreparedFrame, &Estimate)],
    along: Along<'a>,
) -> Vec<StabiliseFrame<'a>> {
    let one = |(i, (frame, estimate)): (usize, &(&'a PreparedFrame, &'a Estimate))| StabiliseFrame {
        features: &frame.features,
        picture: &estimate.picture,
        input: &estimate.input,
        likeness: estimate.likeness.as_ref(),
        signature: estimate.signature.as_ref(),
        alpha: frame.alpha.as_ref(),
        along: along.and_then(|(of, along)| (of == i).then_some(along)),
    };
    frames.iter().enumerate().map(one).collect()
}

fn blend_window<'a>(frames: &'a [(&PreparedFrame, &Estimate)], along: Along<'a>) -> Vec<BlendFrame<'a>> {
    let one = |(i, (frame, estimate)): (usize, &(&'a PreparedFrame, &'a Estimate))| BlendFrame {
        features: &frame.features,
        input: &estimate.input,
        picture: &estimate.picture,
        alpha: frame.alpha.as_ref(),
        along: along.and_then(|(of, along)| (of == i).then_some(along)),
    };
    frames.iter().enumerate().map(one).collect()
}

/// What `blend` chooses from and by.
#[cfg(all(feature = "internals", feature = "cpu"))]
#[derive(Clone, Debug)]
pub struct BlendView {
    /// Frame number.
    pub number: i64,
    /// Input, wavelet's picture, stabilised picture.
    pub candidates: [Plane<Rgb>; 3],
    /// What the net reads.
    pub inputs: Plane<crate::stages::blend::Read>,
    /// Noise of the input, squared, mean of the channels.
    pub noise: Plane<f32>,
    /// The same as `stabilise` finds it.
    pub own_noise: Plane<f32>,
    /// What the net of `stabilise` reads, and more.
    pub before: Plane<crate::stages::blend::Inputs>,
    /// Pixels whose taps are here: column and row.
    pub chosen: Vec<(usize, usize)>,
    /// What `stabilise` averages there, and one over the brightness that it is relative to.
    pub taps: Vec<half::f16>,
    /// See `taps`.
    pub inverse: Vec<f32>,
}

#[cfg(all(feature = "internals", feature = "cpu"))]
pub(crate) fn blend_view(
    stages: &SequenceStages,
    frames: &[(&PreparedFrame, &Estimate)],
    centre: usize,
    every: usize,
    s: &SequenceSettings,
) -> BlendView {
    let (frame, estimate) = frames[centre];
    let around = stabilise_window(frames, None);
    let gather = gather::settings_of(&s.gather, &frame.features);
    let (mut steady, _) = (stages.stabilise)(&around, centre, &gather, &s.stabilise);
    if s.residual.correct && s.residual.picture {
        steady = (stages.picture_residual)(frame.features.first_row, &estimate.input, steady, &s.residual);
    }
    let window = blend_window(frames, None);
    let of = |steady: &Plane<Rgb>| crate::stages::blend::cpu::inputs(&window, centre, steady, (&gather, &s.stabilise));
    let ((_, noise), (before, own_noise)) = (of(&steady), of(&estimate.picture));
    let inputs = crate::stages::blend::cpu::read_by_net(&window, centre, &steady, (&gather, &s.stabilise));
    let chosen: Vec<_> = (0..noise.size().pixels())
        .filter(|i| every > 0 && (i.wrapping_mul(0x9e37_79b9) >> 16) % every == 0)
        .map(|i| (i % noise.size().width, i / noise.size().width))
        .collect();
    let rows = 0..noise.size().height;
    let fronts = crate::stages::stabilise::joint::fronts(&around, &s.stabilise);
    let joint = crate::stages::stabilise::joint::Joint::new((&around, &fronts), centre, &gather, &s.stabilise, rows);
    let (taps, inverse) = crate::stages::stabilise::joint::training_taps(&joint, &chosen);
    let candidates = [estimate.input.clone(), estimate.picture.clone(), steady];
    BlendView { number: frame.number, candidates, inputs, noise, own_noise, inverse, before, chosen, taps }
}

pub(super) fn most_samples(size: Size, moments: &Rows) -> Plane<f32> {
    par::plane(size, |x, y| (0..moments.channels() / 2).map(|l| moments.row(y, 2 * l + 1)[x]).fold(1.0, f32::max))
}

#[cfg(test)]
mod tests {
    use crate::plane::Size;
    use crate::sequence::testing::frame;
    use crate::sequence::{SequenceDenoiser, SequenceSettings};

    /// What divides a stage's time: calls in which it did nothing are none.
    #[test]
    fn stages_count_how_often_they_ran() {
        let mut denoiser = SequenceDenoiser::new(SequenceSettings::default()).unwrap();
        denoiser.time_stages(|| 0.0);
        for t in 0..6 {
            denoiser.push(frame(t, Size::new(24, 16)), t == 3).unwrap();
        }
        assert_eq!(denoiser.finish().unwrap().len(), 1);
        let taken = denoiser.take_stage_times();
        let calls = |name: &str| taken.iter().find(|taken| taken.0 == name).map_or(0, |taken| taken.2);
        // Of all six the picture is needed around the one that comes out.
        assert_eq!(["gather", "variance", "wavelet"].map(calls), [6, 6, 6], "{taken:?}");
        assert_eq!(["stabilise", "blend", "recombine: rescale"].map(calls), [1, 1, 1], "{taken:?}");
        assert_eq!(calls("reflection_motion"), 5, "{taken:?}");
    }
}
