//! The order of the sequence filter's stages, what each reads and writes, and how far it looks. No other file knows it: back
//! ends are walked along the [`SequencePlan`] that is made here.
//!
//! Stages of a frame run in order once the frames that they read are there: [`SequenceDenoiser`](super::SequenceDenoiser) holds the window.

use super::settings::SequenceSettings;
use crate::reach::{Reach, listing};
use crate::stages::{
    blend, feature_noise, gather, recombine, reflection_motion, residual, stabilise, variance, wavelet,
};

/// One stage of the sequence filter; its folder in `stages/` has its name, but for `recombine` and `residual`, which run twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SequenceStage {
    /// `reflection_motion`, for a pair of neighbouring frames, before all others.
    ReflectionMotion,
    /// `gather`.
    Gather,
    /// `feature_noise`.
    FeatureNoise,
    /// `variance`.
    Variance,
    /// `wavelet`.
    Wavelet,
    /// `residual`: of the filtered light.
    Residual,
    /// `recombine`: light * weight, added up.
    Sum,
    /// `stabilise`.
    Stabilise,
    /// `residual`: of the stabilised picture.
    PictureResidual,
    /// `blend`.
    Blend,
    /// `recombine`: passes of the blended picture.
    Rescale,
}

impl SequenceStage {
    /// All stages in order.
    pub const ALL: [Self; 11] = [
        Self::ReflectionMotion,
        Self::Gather,
        Self::FeatureNoise,
        Self::Variance,
        Self::Wavelet,
        Self::Residual,
        Self::Sum,
        Self::Stabilise,
        Self::PictureResidual,
        Self::Blend,
        Self::Rescale,
    ];

    /// For listings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ReflectionMotion => "reflection_motion",
            Self::Gather => "gather",
            Self::FeatureNoise => "feature_noise",
            Self::Variance => "variance",
            Self::Wavelet => "wavelet",
            Self::Residual => "residual",
            Self::PictureResidual => "residual: picture",
            Self::Sum => "recombine: sum",
            Self::Stabilise => "stabilise",
            Self::Blend => "blend",
            Self::Rescale => "recombine: rescale",
        }
    }

    /// What it reads.
    pub const fn reads(self) -> &'static [&'static str] {
        match self {
            Self::ReflectionMotion => &["features of two frames", "motion"],
            Self::Gather => &["light of the window", "features of the window", "motion", "reflection motion"],
            Self::FeatureNoise => &["features"],
            Self::Variance => &["means", "moments", "local features", "given variance"],
            Self::Wavelet => &["means", "variance", "local features"],
            Self::Residual => &["light", "filtered light"],
            Self::PictureResidual => &["input", "steadier picture"],
            Self::Sum => &["light", "filtered light", "weights"],
            Self::Stabilise => {
                &["pictures around", "coverage around", "features around", "motion", "reflection motion"]
            }
            Self::Blend => &[
                "input",
                "picture",
                "steadier picture",
                "inputs around",
                "pictures around",
                "features around",
                "motion",
            ],
            Self::Rescale => &["light", "filtered light", "picture", "steadier picture", "shares"],
        }
    }

    /// What it writes.
    pub const fn writes(self) -> &'static [&'static str] {
        match self {
            Self::ReflectionMotion => &["reflection motion"],
            Self::Gather => &["means", "moments"],
            Self::FeatureNoise => &["local features"],
            Self::Variance => &["variance"],
            Self::Wavelet | Self::Residual => &["filtered light"],
            Self::Sum => &["picture", "input"],
            Self::Stabilise => &["steadier picture", "coverage"],
            Self::PictureResidual => &["steadier picture"],
            Self::Blend => &["shares", "expected error"],
            Self::Rescale => &["passes"],
        }
    }

    /// How far it looks.
    pub fn reach(self, s: &SequenceSettings) -> Reach {
        match self {
            Self::ReflectionMotion => reflection_motion::reach(),
            Self::Gather => gather::reach(&s.gather),
            Self::FeatureNoise => feature_noise::reach(),
            Self::Variance => variance::reach(&s.variance),
            Self::Wavelet => wavelet::reach(&s.wavelet),
            Self::Residual => residual::reach(),
            Self::PictureResidual => residual::picture_reach(),
            Self::Sum => recombine::sum_reach(),
            Self::Rescale => recombine::rescale_reach(),
            Self::Stabilise => stabilise::reach(&s.stabilise),
            Self::Blend => blend::reach(),
        }
    }

    pub(super) fn runs(self, s: &SequenceSettings) -> bool {
        match self {
            Self::ReflectionMotion => s.gather.frames > 0 || s.stabilise.frames > 0,
            Self::Stabilise => s.stabilise.frames > 0,
            Self::Residual => s.residual.correct,
            Self::PictureResidual => s.stabilise.frames > 0 && s.residual.correct && s.residual.picture,
            Self::Blend => s.blend.choose,
            _ => true,
        }
    }
}

/// The stages that will run, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SequencePlan {
    steps: Vec<(SequenceStage, Reach)>,
}

impl SequencePlan {
    /// Makes the plan.
    pub fn new(settings: &SequenceSettings) -> Self {
        let runs = SequenceStage::ALL.into_iter().filter(|stage| stage.runs(settings));
        Self { steps: runs.map(|stage| (stage, stage.reach(settings))).collect() }
    }

    /// The stages, in order.
    pub fn stages(&self) -> impl Iterator<Item = SequenceStage> + '_ {
        self.steps.iter().map(|(stage, _)| *stage)
    }

    /// True where a stage will run.
    pub fn runs(&self, stage: SequenceStage) -> bool {
        self.stages().any(|other| other == stage)
    }

    /// Frames on each side of a frame that decide it.
    pub fn frames(&self) -> usize {
        self.steps.iter().map(|(_, reach)| reach.frames as usize).sum()
    }

    /// Rows above and below a band that decide it, where motion leads up or down by at most `moved` rows a frame, and
    /// by at most `farthest` rows in all.
    pub fn rows(&self, moved: f32, farthest: f32) -> usize {
        self.steps.iter().map(|(_, reach)| reach.rows(moved, farthest)).sum()
    }
}

impl std::fmt::Display for SequencePlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for stage in SequenceStage::ALL {
            let step = self.steps.iter().find(|(other, _)| *other == stage);
            let step = step.map(|(stage, reach)| (stage.reads().join(", "), stage.writes().join(", "), *reach));
            writeln!(f, "{}", listing(stage.name(), step))?;
        }
        write!(f, "a frame depends on {} frames before and after it", self.frames())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_stage_reads_was_written_before() {
        let given = [
            "features of two frames",
            "features of the window",
            "features around",
            "features",
            "light of the window",
            "light",
            "motion",
            "given variance",
            "weights",
            "coverage around",
            "inputs around",   // `input` of the frames around
            "pictures around", // `picture` of the frames around
        ];
        let mut known: Vec<&str> = given.to_vec();
        for stage in SequenceStage::ALL {
            for read in stage.reads() {
                assert!(known.contains(read), "{read} in {stage:?}");
            }
            known.extend(stage.writes());
        }
    }

    #[test]
    fn reach_adds_up() {
        let mut s = SequenceSettings::default();
        let plan = SequencePlan::new(&s);
        assert_eq!(plan.frames(), 9);
        // Five levels: 31 + 5; variance 2, feature noise 2, the windows of stabilise and blend: 10 each, the net of blend: 20, its
        // guards 2 each and its kernel 1; residual 52, and 61; the light around black pixels 1; two footprints of 2.
        assert_eq!(plan.rows(0.0, 100.0), 36 + 2 + 2 + 10 + 10 + 20 + 2 * 2 + 1 + 52 + 61 + 1 + 2 * 2);
        assert_eq!(plan.rows(1.5, 100.0), plan.rows(0.0, 100.0) + 9 + 5);
        assert_eq!(plan.rows(1000.0, 30.0), plan.rows(0.0, 100.0) + 30 + 30);
        s.stabilise.frames = 0;
        s.blend.choose = false;
        s.residual.correct = false;
        s.wavelet.levels = 0;
        s.wavelet.transmission_levels = 1;
        let plan = SequencePlan::new(&s);
        assert!(!plan.runs(SequenceStage::Stabilise) && plan.to_string().contains("does not run"));
        assert_eq!((plan.frames(), plan.rows(0.0, 1.0)), (6, 2 + 2 + 2 + 1 + 2));
    }
}
