//! The back end that is the specification: it runs every stage's `reference.rs` on whole images, and allocates as it
//! likes. The others must agree with it.

pub(crate) mod sequence;

use crate::border::{Guides, PlaneName, Sanitised, copy_colour};
use crate::error::Error;
use crate::frame::{Frame, Rgb, Signal};
use crate::history::Validity;
use crate::pipeline::{Image, Plan, Stage, Step};
use crate::plane::{Plane, Size};
use crate::report::StageTimes;
use crate::settings::Settings;
use crate::stages::antialiasing::reference::Accumulated;
use crate::stages::glossy_bilateral::Axis;
use crate::stages::matte_temporal::reference::{Remembered, Temporal};
use crate::stages::{
    antialiasing, composite, direct_taa, disocclusion, firefly, glossy_bilateral, glossy_temporal, matte_bilateral,
    matte_prefilter, matte_temporal, young_filter,
};
use std::collections::HashMap;

/// A signal's history and its length.
#[derive(Clone, Debug, Default)]
struct History {
    planes: Vec<Plane<Rgb>>,
    length: Option<Plane<f32>>,
    fast: Option<Plane<f32>>,
}

/// What another back end made of a stage.
#[derive(Clone, Debug)]
pub struct Given {
    /// [`Step::output`].
    pub output: Plane<Rgb>,
    /// [`Image::MatteFloored`], of stage 5.
    pub floored: Option<Plane<Rgb>>,
    /// Confidence and history length, of stages 3 and 8.
    pub state: Option<[Plane<f32>; 2]>,
    /// The fast history, of stages 3 and 8 where light's changes are looked for.
    pub fast: Option<Plane<f32>>,
}

/// The reference back end for one image size.
#[derive(Clone, Debug)]
pub struct Reference {
    size: Size,
    images: HashMap<Image, Vec<Plane<Rgb>>>,
    temporal: [Option<Temporal>; 2],
    /// Variance of luminance, from one level of `young_filter` to the next.
    noise: [Option<Plane<f32>>; 2],
    guides: Option<Guides>,
    previous_guides: Option<Guides>,
    matte_history: History,
    glossy_history: History,
    direct_history: Option<Plane<Rgb>>,
    /// Of this frame, then of the one before.
    picture: Option<Accumulated>,
    picture_history: Option<Accumulated>,
    weights: [Plane<Rgb>; 2],
    noisy_direct: [Option<Plane<Rgb>>; 2],
}

impl Reference {
    /// Room for frames of `size`.
    pub fn new(size: Size) -> Self {
        let black = Plane::filled(size, [0.0; 3]);
        Self {
            size,
            images: HashMap::new(),
            temporal: [None, None],
            noise: [None, None],
            guides: None,
            previous_guides: None,
            matte_history: History::default(),
            glossy_history: History::default(),
            direct_history: None,
            picture: None,
            picture_history: None,
            weights: [black.clone(), black],
            noisy_direct: [None, None],
        }
    }

    /// Runs one frame that has been checked.
    pub fn run(
        &mut self,
        frame: &Frame<'_>,
        settings: &Settings,
        plan: &Plan,
        valid: Validity,
        sanitised: &mut Sanitised,
        times: &mut StageTimes,
    ) -> Result<(), Error> {
        self.run_with(frame, settings, plan, valid, sanitised, times, |_| None)
    }

    /// As [`Reference::run`], but a stage for which `given` has what another back end made of it is not run: its images are taken as
    /// they are. For bisecting: "the GPU up to stage k, then the reference".
    ///
    /// # Errors
    /// As [`Reference::run`].
    #[expect(clippy::too_many_arguments, reason = "those of `run`, and one")]
    pub fn run_with(
        &mut self,
        frame: &Frame<'_>,
        settings: &Settings,
        plan: &Plan,
        valid: Validity,
        sanitised: &mut Sanitised,
        times: &mut StageTimes,
        mut given: impl FnMut(&Step) -> Option<Given>,
    ) -> Result<(), Error> {
        self.read(frame, sanitised)?;
        for step in &plan.steps {
            match given(step) {
                Some(given) => {
                    // What a level leaves for the next beside its image.
                    if step.stage.young_level().is_some() {
                        self.step(step, frame, settings, valid)?;
                    }
                    self.take(step, given);
                }
                None => times.measure(step.stage, || self.step(step, frame, settings, valid))?,
            }
        }
        let remember = |image: Option<Image>, images: &HashMap<Image, Vec<Plane<Rgb>>>| {
            image.and_then(|i| images.get(&i).cloned()).unwrap_or_default()
        };
        self.matte_history.planes = remember(plan.matte_feedback, &self.images);
        self.matte_history.length = self.temporal[0].as_ref().map(|t| t.length.clone());
        self.matte_history.fast = self.temporal[0].as_ref().and_then(|t| t.fast.clone());
        self.glossy_history.planes = remember(plan.glossy_feedback, &self.images);
        self.glossy_history.length = self.temporal[1].as_ref().map(|t| t.length.clone());
        self.glossy_history.fast = self.temporal[1].as_ref().and_then(|t| t.fast.clone());
        self.direct_history =
            plan.runs(Stage::DirectTaa).then(|| self.images.get(&plan.direct_output).map(|p| p[0].clone())).flatten();
        self.picture_history = self.picture.take();
        self.previous_guides = self.guides.clone();
        Ok(())
    }

    fn take(&mut self, step: &Step, given: Given) {
        let signal = match step.stage {
            Stage::MatteTemporal => Some(Signal::Matte),
            Stage::GlossyTemporal => Some(Signal::Glossy),
            _ => None,
        };
        if let (Some(signal), Some([confidence, length])) = (signal, given.state) {
            self.temporal[signal as usize] =
                Some(Temporal { planes: vec![given.output.clone()], confidence, length, fast: given.fast });
        }
        self.images.insert(step.output, vec![given.output]);
        if let Some(floored) = given.floored {
            self.images.insert(Image::MatteFloored, vec![floored]);
        }
    }

    /// An image of the last frame: the signal, then its passes. What bisecting and the tests of single stages look at.
    pub fn image(&self, image: Image) -> Option<&[Plane<Rgb>]> {
        self.images.get(&image).map(Vec::as_slice)
    }

    /// The guides of the last frame, as every stage saw them.
    pub fn guides(&self) -> Option<&Guides> {
        self.guides.as_ref()
    }

    /// Confidence and history length of a signal in the last frame.
    pub fn temporal(&self, signal: Signal) -> Option<&Temporal> {
        self.temporal[signal as usize].as_ref()
    }

    fn read(&mut self, frame: &Frame<'_>, sanitised: &mut Sanitised) -> Result<(), Error> {
        let view = frame.camera.projection(self.size).ok_or(Error::Camera { which: "camera" })?;
        let mut guides = Guides::new(self.size, view);
        guides.read(frame, sanitised)?;
        self.guides = Some(guides);
        self.images.clear();
        self.temporal = [None, None];
        self.noise = [None, None];
        let mut copy = |source, absent, name| {
            let mut plane = Plane::filled(frame.size, [0.0; 3]);
            copy_colour(source, absent, &mut plane, name, sanitised);
            plane
        };
        self.images.insert(Image::DirectInput, vec![copy(frame.direct, 0.0, PlaneName::Direct)]);
        for (signal, image, name) in [
            (Signal::Matte, Image::MatteInput, PlaneName::Matte),
            (Signal::Glossy, Image::GlossyInput, PlaneName::Glossy),
        ] {
            if let Some(source) = frame.signal(signal) {
                let mut planes = vec![copy(Some(source), 0.0, name)];
                for pass in frame.passes.iter().filter(|p| p.signal == signal) {
                    planes.push(copy(Some(pass.plane), 0.0, PlaneName::Passes));
                }
                self.images.insert(image, planes);
            }
        }
        self.weights = [
            copy(frame.matte_weight, 1.0, PlaneName::MatteWeight),
            copy(frame.glossy_weight, 1.0, PlaneName::GlossyWeight),
        ];
        self.noisy_direct = [
            frame.direct_matte.map(|p| copy(Some(p), 0.0, PlaneName::DirectMatte)),
            frame.direct_glossy.map(|p| copy(Some(p), 0.0, PlaneName::DirectGlossy)),
        ];
        Ok(())
    }

    fn step(&mut self, step: &Step, frame: &Frame<'_>, settings: &Settings, valid: Validity) -> Result<(), Error> {
        // The plan guarantees both; a mistake in it shows as a missing output, not as a panic.
        let (Some(guides), Some(input)) = (self.guides.as_ref(), self.images.get(&step.input)) else { return Ok(()) };
        let output = match step.stage {
            Stage::MatteTemporal => {
                let history = remembered(&self.matte_history, &self.previous_guides, valid.matte);
                let temporal = matte_temporal::reference::run(input, history, guides, settings);
                let planes = temporal.planes.clone();
                self.temporal[0] = Some(temporal);
                planes
            }
            Stage::MatteYoung1
            | Stage::MatteYoung3
            | Stage::MatteYoung9
            | Stage::MatteYoung27
            | Stage::GlossyYoung1
            | Stage::GlossyYoung3
            | Stage::GlossyYoung9 => {
                let Some((signal, level)) = step.stage.young_level() else { return Ok(()) };
                let Some(temporal) = self.temporal[signal as usize].as_ref() else { return Ok(()) };
                let noise = self.noise[signal as usize].take();
                let level_input =
                    young_filter::reference::Input { planes: input, length: &temporal.length, noise: noise.as_ref() };
                let filtered = young_filter::reference::run(level_input, guides, settings, signal, level);
                self.noise[signal as usize] = filtered.noise;
                filtered.planes
            }
            Stage::MattePrefilter => matte_prefilter::reference::run(input, guides, settings, frame.index),
            Stage::Disocclusion => {
                let prefiltered = step.also_reads.iter().find_map(|i| self.images.get(i));
                let (Some(prefiltered), Some(temporal)) = (prefiltered, self.temporal[0].as_ref()) else {
                    return Ok(());
                };
                let distrust = disocclusion::reference::distrust(&temporal.confidence, &settings.disocclusion);
                let floor = settings.disocclusion.floor;
                let blended = disocclusion::reference::run(input, prefiltered, &distrust, floor);
                if step.also_writes.contains(&Image::MatteFloored) {
                    let floor = floor.max(settings.disocclusion.feedback_floor);
                    let floored = disocclusion::reference::run(input, prefiltered, &distrust, floor);
                    self.images.insert(Image::MatteFloored, floored);
                }
                blended
            }
            Stage::Firefly => firefly::reference::run(input, guides, &settings.firefly),
            Stage::MatteBilateral => matte_bilateral::reference::run(input, guides, settings, frame.index),
            Stage::GlossyTemporal => {
                let history = remembered(&self.glossy_history, &self.previous_guides, valid.glossy);
                let temporal = glossy_temporal::reference::run(input, history, guides, settings);
                let planes = temporal.planes.clone();
                self.temporal[1] = Some(temporal);
                planes
            }
            Stage::GlossyHorizontal => glossy_bilateral::reference::run(input, guides, settings, Axis::Horizontal),
            Stage::GlossyVertical => glossy_bilateral::reference::run(input, guides, settings, Axis::Vertical),
            Stage::DirectTaa => {
                let history = self.direct_history.as_ref().filter(|_| valid.direct);
                vec![direct_taa::reference::run(&input[0], history, guides, &settings.direct_taa)]
            }
            Stage::Composite => {
                let signals = step.also_reads.iter().filter_map(|image| {
                    let weight = match image {
                        Image::GlossyInput
                        | Image::GlossyTemporal
                        | Image::GlossyYoung1
                        | Image::GlossyYoung3
                        | Image::GlossyYoung9
                        | Image::GlossyFiltered => &self.weights[1],
                        Image::Weights => return None,
                        _ => &self.weights[0],
                    };
                    self.images.get(image).map(|planes| (&planes[0], weight))
                });
                let noisy = self.noisy_direct.iter().zip(&self.weights).filter_map(|(p, w)| p.as_ref().map(|p| (p, w)));
                let terms: Vec<_> = signals.chain(noisy).collect();
                vec![composite::reference::run(&input[0], &terms)]
            }
            Stage::Antialiasing => {
                let history = self.picture_history.as_ref().filter(|_| valid.picture);
                let found = antialiasing::reference::run(&input[0], history, guides, &settings.antialiasing);
                let picture = found.picture.clone();
                self.picture = Some(found);
                vec![picture]
            }
        };
        self.images.insert(step.output, output);
        Ok(())
    }
}

fn remembered<'a>(history: &'a History, guides: &'a Option<Guides>, valid: bool) -> Option<Remembered<'a>> {
    let (Some(guides), Some(length), true) = (guides.as_ref(), history.length.as_ref(), valid) else { return None };
    Some(Remembered { planes: &history.planes, length, fast: history.fast.as_ref(), guides })
}
