//! The order of the stages, their switches, what each reads and writes. No other file knows it: back ends walk the
//! [`Plan`] that is made here, so that it can be printed, timed stage by stage, bisected and ablated.

use crate::camera::Camera;
use crate::frame::{Frame, Signal};
use crate::reach::{Reach, listing};
use crate::settings::{Feedback, FireflyInput, Settings};
use crate::stages::glossy_bilateral::Axis;
use crate::stages::{
    antialiasing, composite, direct_taa, disocclusion, firefly, glossy_bilateral, glossy_temporal, matte_bilateral,
    matte_prefilter, matte_temporal, young_filter,
};

/// One stage of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Stage 3.
    MatteTemporal,
    /// Level 0 of the filter of young history, matte signal; no stage of the paper.
    MatteYoung1,
    /// Its level 1, of taps 3 pixels apart.
    MatteYoung3,
    /// Its level 2, of taps 9 pixels apart.
    MatteYoung9,
    /// Its level 3, of taps 27 pixels apart.
    MatteYoung27,
    /// Stage 4.
    MattePrefilter,
    /// Stage 5.
    Disocclusion,
    /// Stage 6.
    Firefly,
    /// Stage 7.
    MatteBilateral,
    /// Stage 8.
    GlossyTemporal,
    /// Level 0 of the filter of young history, glossy signal; no stage of the paper.
    GlossyYoung1,
    /// Its level 1, of taps 3 pixels apart.
    GlossyYoung3,
    /// Its level 2, of taps 9 pixels apart.
    GlossyYoung9,
    /// Stage 9.
    GlossyHorizontal,
    /// Stage 10.
    GlossyVertical,
    /// Stage 11.
    DirectTaa,
    /// The sum.
    Composite,
    /// Temporal anti-aliasing of the sum; no stage of the paper.
    Antialiasing,
}

impl Stage {
    /// All stages in the order of the paper.
    pub const ALL: [Self; 18] = [
        Self::MatteTemporal,
        Self::MatteYoung1,
        Self::MatteYoung3,
        Self::MatteYoung9,
        Self::MatteYoung27,
        Self::MattePrefilter,
        Self::Disocclusion,
        Self::Firefly,
        Self::MatteBilateral,
        Self::GlossyTemporal,
        Self::GlossyYoung1,
        Self::GlossyYoung3,
        Self::GlossyYoung9,
        Self::GlossyHorizontal,
        Self::GlossyVertical,
        Self::DirectTaa,
        Self::Composite,
        Self::Antialiasing,
    ];

    /// The folder's name (the two glossy passes share one, as do the levels of `young_filter`).
    pub const fn name(self) -> &'static str {
        match self {
            Self::MatteTemporal => "matte_temporal",
            Self::MatteYoung1 => "matte_young_1",
            Self::MatteYoung3 => "matte_young_3",
            Self::MatteYoung9 => "matte_young_9",
            Self::MatteYoung27 => "matte_young_27",
            Self::MattePrefilter => "matte_prefilter",
            Self::Disocclusion => "disocclusion",
            Self::Firefly => "firefly",
            Self::MatteBilateral => "matte_bilateral",
            Self::GlossyTemporal => "glossy_temporal",
            Self::GlossyYoung1 => "glossy_young_1",
            Self::GlossyYoung3 => "glossy_young_3",
            Self::GlossyYoung9 => "glossy_young_9",
            Self::GlossyHorizontal => "glossy_bilateral_h",
            Self::GlossyVertical => "glossy_bilateral_v",
            Self::DirectTaa => "direct_taa",
            Self::Composite => "composite",
            Self::Antialiasing => "antialiasing",
        }
    }

    /// The name and number that the paper's talk gives it; those of our own have no number.
    pub const fn paper_stage(self) -> &'static str {
        match self {
            Self::MatteTemporal => "3 Matte Temporal",
            Self::MatteYoung1 => "Young Matte, 1 px",
            Self::MatteYoung3 => "Young Matte, 3 px",
            Self::MatteYoung9 => "Young Matte, 9 px",
            Self::MatteYoung27 => "Young Matte, 27 px",
            Self::GlossyYoung1 => "Young Glossy, 1 px",
            Self::GlossyYoung3 => "Young Glossy, 3 px",
            Self::GlossyYoung9 => "Young Glossy, 9 px",
            Self::MattePrefilter => "4 Matte Pre-Bilateral",
            Self::Disocclusion => "5 Disocclusion Detection",
            Self::Firefly => "6 Firefly Suppression",
            Self::MatteBilateral => "7 Matte Bilateral",
            Self::GlossyTemporal => "8 Glossy Temporal",
            Self::GlossyHorizontal => "9 Glossy H. Bilateral",
            Self::GlossyVertical => "10 Glossy V. Bilateral",
            Self::DirectTaa => "11 TAA of direct light",
            Self::Composite => "Composite",
            Self::Antialiasing => "TAA of the picture",
        }
    }

    /// How far it looks in a picture of `rows` rows. Of history, which the frame before has filtered: one frame.
    pub fn reach(self, s: &Settings, rows: usize) -> Reach {
        match self {
            Self::MatteTemporal => matte_temporal::reach(s),
            Self::MatteYoung1 => young_filter::reach(&s.edge, Signal::Matte, 0),
            Self::GlossyYoung1 => young_filter::reach(&s.edge, Signal::Glossy, 0),
            Self::MatteYoung3 => young_filter::reach(&s.edge, Signal::Matte, 1),
            Self::GlossyYoung3 => young_filter::reach(&s.edge, Signal::Glossy, 1),
            Self::MatteYoung9 => young_filter::reach(&s.edge, Signal::Matte, 2),
            Self::MatteYoung27 => young_filter::reach(&s.edge, Signal::Matte, 3),
            Self::GlossyYoung9 => young_filter::reach(&s.edge, Signal::Glossy, 2),
            Self::MattePrefilter => matte_prefilter::reach(s, rows),
            Self::Disocclusion => disocclusion::reach(&s.disocclusion),
            Self::Firefly => firefly::reach(),
            Self::MatteBilateral => matte_bilateral::reach(s, rows),
            Self::GlossyTemporal => glossy_temporal::reach(s),
            Self::GlossyHorizontal => glossy_bilateral::reach(&s.glossy_bilateral, Axis::Horizontal, rows),
            Self::GlossyVertical => glossy_bilateral::reach(&s.glossy_bilateral, Axis::Vertical, rows),
            Self::DirectTaa => direct_taa::reach(),
            Self::Composite => composite::reach(),
            Self::Antialiasing => antialiasing::reach(&s.antialiasing),
        }
    }

    /// Milliseconds at 1280x720 that the talk's table states, on its GPU of 2017.
    pub const fn paper_milliseconds(self) -> Option<f32> {
        match self {
            Self::MatteTemporal => Some(0.18),
            Self::MattePrefilter => Some(3.32),
            Self::Disocclusion => Some(0.76),
            Self::Firefly => Some(0.55),
            Self::MatteBilateral => Some(3.36),
            Self::GlossyTemporal => Some(0.23),
            Self::GlossyHorizontal => Some(0.34),
            Self::GlossyVertical => Some(0.43),
            Self::MatteYoung1
            | Self::MatteYoung3
            | Self::MatteYoung9
            | Self::MatteYoung27
            | Self::GlossyYoung1
            | Self::GlossyYoung3
            | Self::GlossyYoung9
            | Self::DirectTaa
            | Self::Composite
            | Self::Antialiasing => None,
        }
    }

    /// The signal and the level of a stage of `young_filter`.
    pub(crate) const fn young_level(self) -> Option<(Signal, u32)> {
        match self {
            Self::MatteYoung1 => Some((Signal::Matte, 0)),
            Self::MatteYoung3 => Some((Signal::Matte, 1)),
            Self::MatteYoung9 => Some((Signal::Matte, 2)),
            Self::MatteYoung27 => Some((Signal::Matte, 3)),
            Self::GlossyYoung1 => Some((Signal::Glossy, 0)),
            Self::GlossyYoung3 => Some((Signal::Glossy, 1)),
            Self::GlossyYoung9 => Some((Signal::Glossy, 2)),
            _ => None,
        }
    }
}

/// An image that stages read and write. Signals carry their passes along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the name says which stage wrote it")]
pub enum Image {
    Guides,
    PreviousGuides,
    Weights,
    MatteInput,
    MatteHistory,
    MatteTemporal,
    MatteConfidence,
    MatteYoung1,
    MatteYoung3,
    MatteYoung9,
    MatteYoung27,
    MattePrefiltered,
    MatteBlended,
    MatteFloored,
    MatteMedian,
    MatteFiltered,
    GlossyInput,
    GlossyHistory,
    GlossyTemporal,
    GlossyConfidence,
    GlossyYoung1,
    GlossyYoung3,
    GlossyYoung9,
    GlossyHorizontal,
    GlossyFiltered,
    DirectInput,
    DirectHistory,
    DirectAntialiased,
    Composite,
    PictureHistory,
    Antialiased,
}

impl Image {
    /// For listings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Guides => "guides",
            Self::PreviousGuides => "previous guides",
            Self::Weights => "weights",
            Self::MatteInput => "matte input",
            Self::MatteHistory => "matte history",
            Self::MatteTemporal => "matte temporal",
            Self::MatteConfidence => "matte confidence, length",
            Self::MatteYoung1 => "matte young 1",
            Self::MatteYoung3 => "matte young 3",
            Self::MatteYoung9 => "matte young 9",
            Self::MatteYoung27 => "matte young 27",
            Self::MattePrefiltered => "matte prefiltered",
            Self::MatteBlended => "matte blended",
            Self::MatteFloored => "matte blended with floor",
            Self::MatteMedian => "matte median",
            Self::MatteFiltered => "matte filtered",
            Self::GlossyInput => "glossy input",
            Self::GlossyHistory => "glossy history",
            Self::GlossyTemporal => "glossy temporal",
            Self::GlossyConfidence => "glossy confidence, length",
            Self::GlossyYoung1 => "glossy young 1",
            Self::GlossyYoung3 => "glossy young 3",
            Self::GlossyYoung9 => "glossy young 9",
            Self::GlossyHorizontal => "glossy horizontal",
            Self::GlossyFiltered => "glossy filtered",
            Self::DirectInput => "direct input",
            Self::DirectHistory => "direct history",
            Self::DirectAntialiased => "direct anti-aliased",
            Self::Composite => "composite",
            Self::PictureHistory => "picture history",
            Self::Antialiased => "picture anti-aliased",
        }
    }
}

/// One stage as it will run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// Which.
    pub stage: Stage,
    /// Its input: the image that it filters.
    pub input: Image,
    /// What it writes first.
    pub output: Image,
    /// Everything else that it reads.
    pub also_reads: Vec<Image>,
    /// Everything else that it writes.
    pub also_writes: Vec<Image>,
}

impl Step {
    /// All that it reads.
    pub fn reads(&self) -> impl Iterator<Item = Image> + '_ {
        std::iter::once(self.input).chain(self.also_reads.iter().copied())
    }

    /// All that it writes.
    pub fn writes(&self) -> impl Iterator<Item = Image> + '_ {
        std::iter::once(self.output).chain(self.also_writes.iter().copied())
    }
}

/// What a frame brings along; the plan depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// It has the matte signal.
    pub matte: bool,
    /// It has the glossy signal.
    pub glossy: bool,
    /// It has direct light.
    pub direct: bool,
    /// Its samples are jittered, or those of the frame before were.
    pub jitter: bool,
}

/// Whether samples move within pixels: a pattern may hold the centre itself.
pub(crate) fn is_jittered(now: &Camera, before: &Camera) -> bool {
    now.jitter != [0.0; 2] || before.jitter != [0.0; 2]
}

impl Inputs {
    /// Of a frame.
    pub fn of(frame: &Frame<'_>) -> Self {
        Self {
            matte: frame.matte.is_some(),
            glossy: frame.glossy.is_some(),
            direct: frame.direct.is_some(),
            jitter: is_jittered(&frame.camera, &frame.previous_camera),
        }
    }

    /// A frame that has everything.
    pub const ALL: Self = Self { matte: true, glossy: true, direct: true, jitter: true };

    /// Whether a signal is there.
    pub fn has(&self, signal: Signal) -> bool {
        match signal {
            Signal::Matte => self.matte,
            Signal::Glossy => self.glossy,
        }
    }
}

/// The stages that will run, in order, and which images are shown and remembered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// In order.
    pub steps: Vec<Step>,
    /// The matte signal that is shown.
    pub matte_output: Image,
    /// The matte signal that is the next frame's history; `None`: there is none.
    pub matte_feedback: Option<Image>,
    /// The glossy signal that is shown.
    pub glossy_output: Image,
    /// The glossy signal that is the next frame's history.
    pub glossy_feedback: Option<Image>,
    /// The direct light that is shown, and remembered where it is anti-aliased.
    pub direct_output: Image,
    /// The picture that is shown, and remembered where it is anti-aliased.
    pub picture_output: Image,
    /// Stage 8 looks at the hit distances of the frame before.
    pub compares_hits: bool,
}

/// Steps in the making.
struct Steps(Vec<Step>);

impl Steps {
    /// Adds a step; gives its output.
    fn add(&mut self, stage: Stage, input: Image, output: Image, also_reads: &[Image], also_writes: &[Image]) -> Image {
        let (also_reads, also_writes) = (also_reads.to_vec(), also_writes.to_vec());
        self.0.push(Step { stage, input, output, also_reads, also_writes });
        output
    }
}

/// The levels of `young_filter` and what they write, finest first.
const MATTE_YOUNG: &[(Stage, Image)] = &[
    (Stage::MatteYoung1, Image::MatteYoung1),
    (Stage::MatteYoung3, Image::MatteYoung3),
    (Stage::MatteYoung9, Image::MatteYoung9),
    (Stage::MatteYoung27, Image::MatteYoung27),
];
const GLOSSY_YOUNG: &[(Stage, Image)] = &[
    (Stage::GlossyYoung1, Image::GlossyYoung1),
    (Stage::GlossyYoung3, Image::GlossyYoung3),
    (Stage::GlossyYoung9, Image::GlossyYoung9),
];

/// The levels that a history of one frame needs; the last one's output.
fn young_steps(steps: &mut Steps, settings: &Settings, signal: Signal, input: Image) -> Image {
    let (levels, length) = match signal {
        Signal::Matte => (MATTE_YOUNG, Image::MatteConfidence),
        Signal::Glossy => (GLOSSY_YOUNG, Image::GlossyConfidence),
    };
    let ends = young_filter::ends(&settings.young_filter, signal);
    let acting = levels.iter().zip(ends).filter(|(_, end)| *end > 1.0);
    acting.fold(input, |input, (&(stage, output), _)| steps.add(stage, input, output, &[length, Image::Guides], &[]))
}

/// Stages 3 to 7; the image that is shown, and the one that is the next frame's history.
fn matte_steps(steps: &mut Steps, settings: &Settings) -> (Image, Option<Image>) {
    let temporal = settings.matte_temporal.enabled;
    let accumulated = if temporal {
        steps.add(
            Stage::MatteTemporal,
            Image::MatteInput,
            Image::MatteTemporal,
            &[Image::MatteHistory, Image::Guides, Image::PreviousGuides],
            &[Image::MatteConfidence],
        )
    } else {
        Image::MatteInput
    };
    // As the next frame's history it stays as it is; every other stage sees the filtered one.
    let unfiltered = accumulated;
    let accumulated = if temporal && settings.young_filter.matte {
        young_steps(steps, settings, Signal::Matte, accumulated)
    } else {
        accumulated
    };
    // Work that nobody reads is left out.
    let prefilter_is_read =
        !temporal || settings.disocclusion.enabled || settings.pipeline.feedback == Feedback::Prefilter;
    let prefiltered = if settings.matte_prefilter.enabled && prefilter_is_read {
        steps.add(Stage::MattePrefilter, accumulated, Image::MattePrefiltered, &[Image::Guides], &[])
    } else {
        accumulated
    };
    let wants_floor = settings.pipeline.feedback == Feedback::Blend;
    // Without history everything is fresh: the blend would be the prefiltered image.
    let (blended, floored) = if !temporal {
        (prefiltered, prefiltered)
    } else if settings.disocclusion.enabled && prefiltered != accumulated {
        let floor: &[Image] = if wants_floor { &[Image::MatteFloored] } else { &[] };
        let blended = steps.add(
            Stage::Disocclusion,
            accumulated,
            Image::MatteBlended,
            &[prefiltered, Image::MatteConfidence],
            floor,
        );
        (blended, Image::MatteFloored)
    } else {
        (accumulated, accumulated)
    };
    let median_input = match settings.firefly.input {
        FireflyInput::Disocclusion => blended,
        FireflyInput::Temporal => accumulated,
    };
    let median = if settings.firefly.enabled {
        steps.add(Stage::Firefly, median_input, Image::MatteMedian, &[Image::Guides], &[])
    } else {
        blended
    };
    let filtered = if settings.matte_bilateral.enabled {
        steps.add(Stage::MatteBilateral, median, Image::MatteFiltered, &[Image::Guides], &[])
    } else {
        median
    };
    let feedback = match settings.pipeline.feedback {
        Feedback::Temporal => unfiltered,
        Feedback::Prefilter => prefiltered,
        Feedback::Blend => floored,
        Feedback::Firefly => median,
        Feedback::Bilateral => filtered,
    };
    (filtered, temporal.then_some(feedback))
}

/// Stages 8 to 10; the image that is shown, and the one that is the next frame's history.
fn glossy_steps(steps: &mut Steps, settings: &Settings) -> (Image, Option<Image>) {
    let (mut output, mut feedback) = (Image::GlossyInput, None);
    if settings.glossy_temporal.enabled {
        let reads = [Image::GlossyHistory, Image::Guides, Image::PreviousGuides];
        output = steps.add(Stage::GlossyTemporal, output, Image::GlossyTemporal, &reads, &[Image::GlossyConfidence]);
        feedback = Some(output);
        if settings.young_filter.glossy {
            output = young_steps(steps, settings, Signal::Glossy, output);
        }
    }
    if settings.glossy_bilateral.enabled {
        output = steps.add(Stage::GlossyHorizontal, output, Image::GlossyHorizontal, &[Image::Guides], &[]);
        output = steps.add(Stage::GlossyVertical, output, Image::GlossyFiltered, &[Image::Guides], &[]);
    }
    (output, feedback)
}

impl Plan {
    /// Makes the plan. A stage that is off hands its input on.
    pub fn new(settings: &Settings, inputs: Inputs) -> Self {
        let mut steps = Steps(Vec::new());
        let (matte_output, matte_feedback) =
            if inputs.matte { matte_steps(&mut steps, settings) } else { (Image::MatteInput, None) };
        let (glossy_output, glossy_feedback) =
            if inputs.glossy { glossy_steps(&mut steps, settings) } else { (Image::GlossyInput, None) };
        // The picture as a whole or its direct light alone.
        let antialiases = inputs.jitter && settings.antialiasing.enabled;
        let direct_output = if inputs.jitter && inputs.direct && settings.direct_taa.enabled && !antialiases {
            let reads = [Image::DirectHistory, Image::Guides];
            steps.add(Stage::DirectTaa, Image::DirectInput, Image::DirectAntialiased, &reads, &[])
        } else {
            Image::DirectInput
        };
        let mut also_reads = vec![Image::Weights];
        also_reads.extend(inputs.matte.then_some(matte_output));
        also_reads.extend(inputs.glossy.then_some(glossy_output));
        let mut picture_output = steps.add(Stage::Composite, direct_output, Image::Composite, &also_reads, &[]);
        if antialiases {
            let reads = [Image::PictureHistory, Image::Guides];
            picture_output = steps.add(Stage::Antialiasing, picture_output, Image::Antialiased, &reads, &[]);
        }
        let compares_hits = glossy_feedback.is_some() && settings.glossy_temporal.compares_hits();
        let steps = steps.0;
        Self {
            steps,
            matte_output,
            matte_feedback,
            glossy_output,
            glossy_feedback,
            direct_output,
            picture_output,
            compares_hits,
        }
    }

    /// True where a stage will run.
    pub fn runs(&self, stage: Stage) -> bool {
        self.steps.iter().any(|s| s.stage == stage)
    }
}

impl Plan {
    /// How far from a pixel what is shown depends on images of the same frame, in pixels along an axis, for a picture of
    /// `rows` rows. History is not in it. A stage looks around its input; what it reads beside that, at the pixel.
    pub fn reach_px(&self, settings: &Settings, rows: usize) -> usize {
        let mut reached: Vec<(Image, [usize; 2])> = Vec::new();
        for step in &self.steps {
            let of =
                |image: Image| reached.iter().rev().find(|(i, _)| *i == image).map_or([0; 2], |(_, pixels)| *pixels);
            let pixels = step.stage.reach(settings, rows).pixels;
            let around = [0, 1].map(|axis| of(step.input)[axis] + pixels[axis]);
            let all = step.also_reads.iter().fold(around, |all, image| [0, 1].map(|k| all[k].max(of(*image)[k])));
            reached.extend(step.writes().map(|image| (image, all)));
        }
        reached.iter().flat_map(|(_, pixels)| pixels).copied().max().unwrap_or(0)
    }

    /// A line for each stage: what it reads and writes, and how far it looks in a picture of `rows` rows; then what is
    /// shown and remembered.
    pub fn listing(&self, settings: &Settings, rows: usize) -> String {
        let list = |images: &[Image]| images.iter().map(|i| i.name()).collect::<Vec<_>>().join(", ");
        let mut lines: Vec<String> = Vec::new();
        for stage in Stage::ALL {
            let step = self.steps.iter().find(|s| s.stage == stage).map(|step| {
                let (reads, writes): (Vec<_>, Vec<_>) = (step.reads().collect(), step.writes().collect());
                (list(&reads), list(&writes), stage.reach(settings, rows))
            });
            lines.push(listing(stage.paper_stage(), step));
        }
        let shown = [self.matte_output, self.glossy_output, self.direct_output, self.picture_output];
        lines.push(format!("shown: {}", list(&shown)));
        let antialiased = [self.direct_output, self.picture_output];
        let antialiased =
            antialiased.into_iter().filter(|i| matches!(i, Image::DirectAntialiased | Image::Antialiased));
        let remembered: Vec<Image> =
            self.matte_feedback.into_iter().chain(self.glossy_feedback).chain(antialiased).collect();
        let remembered = if remembered.is_empty() { "nothing".to_owned() } else { list(&remembered) };
        lines.push(format!("remembered: {remembered}"));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_read_was_written_before() {
        let given = [
            Image::Guides,
            Image::PreviousGuides,
            Image::Weights,
            Image::MatteInput,
            Image::GlossyInput,
            Image::DirectInput,
            Image::MatteHistory,
            Image::GlossyHistory,
            Image::DirectHistory,
            Image::PictureHistory,
        ];
        let feedbacks = ["temporal", "prefilter", "blend", "firefly", "bilateral"];
        let switches = [
            "matte_temporal.enabled",
            "matte_prefilter.enabled",
            "disocclusion.enabled",
            "firefly.enabled",
            "matte_bilateral.enabled",
            "glossy_temporal.enabled",
            "glossy_bilateral.enabled",
            "direct_taa.enabled",
            "antialiasing.enabled",
        ];
        for feedback in feedbacks {
            for mask in 0..1u32 << switches.len() {
                let mut settings = Settings::default();
                settings.set("pipeline.feedback", feedback).unwrap();
                for (i, switch) in switches.iter().enumerate() {
                    settings.set(switch, if mask >> i & 1 == 1 { "on" } else { "off" }).unwrap();
                }
                let plan = Plan::new(&settings, Inputs::ALL);
                let mut known = given.to_vec();
                for step in &plan.steps {
                    for read in std::iter::once(&step.input).chain(&step.also_reads) {
                        assert!(known.contains(read), "{read:?} in {:?}\n{plan:?}", step.stage);
                    }
                    known.push(step.output);
                    known.extend(&step.also_writes);
                }
                for image in [plan.matte_output, plan.glossy_output, plan.direct_output, plan.picture_output] {
                    assert!(known.contains(&image));
                }
                for image in plan.matte_feedback.into_iter().chain(plan.glossy_feedback) {
                    assert!(known.contains(&image), "{image:?}\n{plan:?}");
                }
            }
        }
    }

    #[test]
    fn reach_grows_with_rows_and_radii() {
        let settings = Settings::default();
        let reach = |settings: &Settings, rows| Plan::new(settings, Inputs::ALL).reach_px(settings, rows);
        let [small, usual] = [90, 720].map(|rows| reach(&settings, rows));
        // Two spirals of 32 pixels, the median, a window of 4.
        assert!((60..=69).contains(&usual) && small < usual, "{small}, {usual}");
        let mut wide = settings.clone();
        wide.glossy_bilateral.max_radius = 64.0;
        wide.matte_bilateral.radius = 100.0;
        assert!(reach(&wide, 720) > usual + 60);
        assert_eq!(reach(&settings.without_denoising(), 720), 0, "the sum looks at the pixel alone");
    }
}
