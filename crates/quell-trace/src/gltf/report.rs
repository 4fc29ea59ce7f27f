//! What a file held, what was made of it, what was left out and why.

use super::error::Place;

/// What a file held and what was made of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadReport {
    /// The program that wrote the file, as it says.
    pub generator: Option<String>,
    /// The owner of the rights, as the file says.
    pub copyright: Option<String>,
    /// Names of the scenes in the file; the chosen one's number, from 0.
    pub scenes: Vec<String>,
    /// Which of them was loaded; `None` where the file has none and all nodes are shown.
    pub scene: Option<usize>,
    /// Nodes of the chosen scene.
    pub nodes: usize,
    /// Meshes with at least one triangle.
    pub meshes: usize,
    /// Meshes that skins or morph targets move.
    pub deforming_meshes: usize,
    /// Placed meshes, part by part.
    pub instances: usize,
    /// Triangles in the world, each instance counted.
    pub triangles: usize,
    /// Of those, the ones without area.
    pub degenerate_triangles: usize,
    /// Materials in the file.
    pub materials: usize,
    /// Textures that are used.
    pub textures: usize,
    /// Images that were decoded.
    pub images: usize,
    /// Lights without extent that shine in the scene.
    pub lights: usize,
    /// Surfaces that emit: instances whose material does.
    pub emitters: usize,
    /// Cameras, in the order of [`crate::Scene::cameras`].
    pub cameras: Vec<CameraInfo>,
    /// Clips of animation.
    pub clips: Vec<ClipInfo>,
    /// Length of the clips that play, in seconds.
    pub seconds: f64,
    /// What was left out or replaced, and why.
    pub warnings: Vec<Warning>,
    /// Warnings beyond [`WARNING_LIMIT`], counted only.
    pub further_warnings: usize,
    /// What is not used on purpose, and why; [`WARNING_LIMIT`] of them at most.
    pub ignored: Vec<Warning>,
    /// What the loader decided where the file is silent, in sentences.
    pub notes: Vec<String>,
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfo {
    /// Name of its node, else its own, else its number.
    pub name: String,
    /// Its own name, where that differs.
    pub other_name: Option<String>,
    /// False for orthographic cameras.
    pub perspective: bool,
    /// Width over height that the file suggests. Pictures keep the vertical angle whatever their shape.
    pub aspect: Option<f32>,
    /// Whether it moves.
    pub moves: bool,
}

/// A clip of animation.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipInfo {
    /// Its name, or its number.
    pub name: String,
    /// Time of its last key.
    pub seconds: f64,
    /// Channels that can be played.
    pub channels: usize,
    /// Whether it plays; if not, because of which clip (`None`: another was chosen).
    pub plays: Plays,
}

/// Whether a clip plays.
#[derive(Clone, Debug, PartialEq)]
pub enum Plays {
    /// It does.
    Yes,
    /// Another one was chosen.
    NotChosen,
    /// It drives what this clip before it drives already.
    SharesChannels(String),
    /// It has no channel that can be played.
    Empty,
}

/// Something that was left out or replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where in the JSON.
    pub place: String,
    /// What was done and why.
    pub message: String,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.place, self.message)
    }
}

/// Warnings that are kept with their words: a file that is wrong a million times says so a few times.
pub const WARNING_LIMIT: usize = 100;

/// Collects warnings.
#[derive(Clone, Debug, Default)]
pub(super) struct Warnings {
    list: Vec<Warning>,
    further: usize,
    ignored: Vec<Warning>,
}

impl Warnings {
    /// Something that is not used on purpose.
    pub(super) fn ignore(&mut self, place: &Place<'_>, message: &str) {
        if self.ignored.len() < WARNING_LIMIT {
            self.ignored.push(Warning { place: place.to_string(), message: message.to_owned() });
        }
    }

    pub(super) fn push(&mut self, place: &Place<'_>, message: impl Into<String>) {
        self.at(place.to_string(), message);
    }

    pub(super) fn at(&mut self, place: String, message: impl Into<String>) {
        if self.list.len() < WARNING_LIMIT {
            self.list.push(Warning { place, message: message.into() });
        } else {
            self.further += 1;
        }
    }

    pub(super) fn append(&mut self, other: Self) {
        self.further += other.further;
        self.ignored.extend(other.ignored);
        for warning in other.list {
            self.at(warning.place, warning.message);
        }
    }

    pub(super) fn into_report(self, report: &mut LoadReport) {
        report.warnings = self.list;
        report.further_warnings = self.further;
        report.ignored = self.ignored;
    }
}
