//! What the doctor says: findings, what passed, what could not be examined.

use crate::image::Window;
use quell::{Plane, Rgb};

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Good to know; quell copes with it, or it costs nothing that is seen.
    Note,
    /// The result is less good than it could be.
    Warning,
    /// The result is spoilt: render again, or name the option. Exit status 4.
    Fault,
}

impl Severity {
    /// `note`, `warning`, `fault`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Fault => "fault",
        }
    }
}

/// A measured number.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What was measured.
    pub name: &'static str,
    /// How much.
    pub value: f64,
    /// Its unit; empty for ratios and counts.
    pub unit: &'static str,
}

impl Figure {
    /// A number with its unit.
    pub const fn new(name: &'static str, value: f64, unit: &'static str) -> Self {
        Self { name, value, unit }
    }
}

/// Something that is wrong, or odd.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Which check found it, such as `motion.sign`: the names stand in docs/doctor.md and do not change.
    pub check: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// The view layer and stereo view, where there are several.
    pub layer: String,
    /// The frame that shows it, the first of several.
    pub frame: Option<i64>,
    /// The pass or channel; empty where it is the whole file.
    pub channel: String,
    /// What is wrong, in a sentence.
    pub what: String,
    /// Why that is believed: figures with their units.
    pub evidence: String,
    /// The same figures as numbers.
    pub figures: Vec<Figure>,
    /// What becomes of the picture.
    pub spoils: String,
    /// The option or the renderer's setting that helps.
    pub remedy: String,
}

impl Finding {
    /// A finding without frame, channel and figures.
    pub fn new(check: &'static str, severity: Severity, what: impl Into<String>) -> Self {
        Self {
            check,
            severity,
            layer: String::new(),
            frame: None,
            channel: String::new(),
            what: what.into(),
            evidence: String::new(),
            figures: Vec::new(),
            spoils: String::new(),
            remedy: String::new(),
        }
    }

    /// In this frame.
    #[must_use]
    pub fn frame(mut self, number: i64) -> Self {
        self.frame = Some(number);
        self
    }

    /// In this pass or channel.
    #[must_use]
    pub fn channel(mut self, name: impl Into<String>) -> Self {
        self.channel = name.into();
        self
    }

    /// Because of this.
    #[must_use]
    pub fn evidence(mut self, text: impl Into<String>, figures: Vec<Figure>) -> Self {
        self.evidence = text.into();
        self.figures = figures;
        self
    }

    /// With this effect and this cure.
    #[must_use]
    pub fn cure(mut self, spoils: impl Into<String>, remedy: impl Into<String>) -> Self {
        self.spoils = spoils.into();
        self.remedy = remedy.into();
        self
    }
}

/// A check that found nothing, with what it measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Passed {
    /// The check, or the family of checks.
    pub check: &'static str,
    /// What was measured.
    pub text: String,
}

/// What could not be looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotExamined {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
}

/// How much noise a pass has.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The pass.
    pub pass: String,
    /// Standard deviation over the mean, median over pixels; estimated from differences in space and time, the lesser.
    pub relative: f64,
}

/// Two neighbouring frames as a page shows them; all planes are of one extent.
#[derive(Clone, Debug)]
pub struct Exhibit {
    /// The view layer and stereo view, where there are several.
    pub layer: String,
    /// Frame number of the neighbour.
    pub earlier: i64,
    /// Frame number of the current frame.
    pub later: i64,
    /// The picture of the current frame, scene-linear.
    pub current: Plane<Rgb>,
    /// The neighbour's.
    pub neighbour: Plane<Rgb>,
    /// The neighbour's brought to the current frame along the motion; NaN where there is none.
    pub warped: Option<Plane<Rgb>>,
    /// Surfaces without noise (albedo, normals or depth as colours, 0..1): current, neighbour, neighbour warped.
    pub surfaces: Option<(&'static str, [Plane<Rgb>; 3])>,
    /// previous = current + motion, in pixels.
    pub motion: Option<Plane<[f32; 2]>>,
}

/// All that was found out.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// Numbers of the frames that there are.
    pub frames: Vec<i64>,
    /// Those whose pixels were looked at.
    pub examined: Vec<i64>,
    /// Extent of the pictures.
    pub display: Option<Window>,
    /// What each pass was taken for, and why.
    pub mapping: String,
    /// The renderer and how it was recognised.
    pub renderer: String,
    /// What is wrong, most severe first.
    pub findings: Vec<Finding>,
    /// What is not.
    pub passed: Vec<Passed>,
    /// What could not be looked at.
    pub not_examined: Vec<NotExamined>,
    /// Pairs of frames to be shown.
    pub exhibits: Vec<Exhibit>,
    /// How much noise was found, the picture first.
    pub noise: Vec<Level>,
}

impl Diagnosis {
    /// How many findings are of that severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|f| f.severity == severity).count()
    }

    /// The most severe finding.
    pub fn worst(&self) -> Option<Severity> {
        self.findings.iter().map(|f| f.severity).max()
    }

    pub(super) fn pass(&mut self, check: &'static str, text: impl Into<String>) {
        self.passed.push(Passed { check, text: text.into() });
    }

    pub(super) fn cannot(&mut self, what: impl Into<String>, why: impl Into<String>) {
        let new = NotExamined { what: what.into(), why: why.into() };
        if !self.not_examined.contains(&new) {
            self.not_examined.push(new);
        }
    }

    /// True where a check of that name, or of that family (`motion.`), found something.
    pub(super) fn has(&self, prefix: &str) -> bool {
        self.findings.iter().any(|f| f.check.starts_with(prefix))
    }
}

/// The names of all checks.
pub const CHECKS: [&str; 42] = [
    "albedo.above_one",
    "codec.lossy",
    "codec.rounded",
    "depth.kind",
    "depth.ray",
    "emission.changes",
    "filter.splatted",
    "frames.incomplete",
    "frames.layout",
    "frames.missing",
    "frames.mixed",
    "frames.on_twos",
    "frames.repeated",
    "frames.size",
    "frames.step",
    "frames.unreadable",
    "guides.jitter",
    "input.denoised",
    "input.denoised_beside",
    "light.changes",
    "light.colour",
    "motion.axis",
    "motion.direction",
    "motion.missing",
    "motion.scale",
    "motion.sign",
    "motion.unexplained",
    "motion.unit",
    "motion.zero",
    "normal.encoded",
    "normal.length",
    "normal.space",
    "passes.composite",
    "passes.missing",
    "passes.renamed",
    "passes.sum",
    "passes.unknown",
    "seed.repeated",
    "values.fireflies",
    "values.infinite",
    "values.nan",
    "values.negative",
];
