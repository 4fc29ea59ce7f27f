//! What is wrong with a glTF file, where, and what to do about it.

use std::fmt;
use std::path::Path;

/// Why a file cannot be loaded: the file, the place in its JSON, and the problem with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{}{place}: {problem}", if place.is_empty() { "" } else { ": " })]
pub struct GltfError {
    /// The file that was to be loaded.
    pub file: String,
    /// Where in its JSON, such as `meshes[0].primitives[1].attributes.POSITION`; empty where the problem is the file's.
    pub place: String,
    /// What is wrong there.
    pub problem: Problem,
}

/// What is wrong at a place of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The system does not hand over the file.
    #[error("cannot be read: {0}")]
    Read(String),
    /// The file is no glTF.
    #[error("is no glTF file: {0}; export the scene as glTF 2.0, best as one .glb file")]
    NotGltf(String),
    /// The file ends too early.
    #[error("is cut off: {what} needs {needed} bytes, {found} are there; copy or export the file again")]
    Cut {
        /// What does not fit.
        what: &'static str,
        /// Bytes that it needs.
        needed: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// The JSON is broken, or not what glTF prescribes at this place.
    #[error("the JSON is not what glTF prescribes: {0}; repair it or export the file again")]
    Json(String),
    /// The file says that it cannot be shown without what quell lacks.
    #[error("requires {0}, which quell does not read; export the scene without")]
    Required(String),
    /// A number names nothing.
    #[error("names {what} {index}, but there are {count} (counted from 0); export the file again")]
    Index {
        /// What is named.
        what: &'static str,
        /// The number given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Numbers of a buffer, view or accessor that do not fit together or not the purpose.
    #[error("{0}; export the file again")]
    Data(String),
    /// An accessor with nothing in it.
    #[error("has a count of 0, where glTF demands at least 1; export the file again")]
    Empty,
    /// Nodes that are no tree.
    #[error("{0}; nodes must form a tree: repair the `children` or export the file again")]
    Hierarchy(String),
    /// A file beside this one that may not or cannot be used.
    #[error("the external file `{uri}` {reason}")]
    External {
        /// As the file names it.
        uri: String,
        /// Why it is not used, and what to do.
        reason: String,
    },
    /// More than the limits allow.
    #[error("{what}: {value} exceed the limit of {limit}; simplify the scene, or raise `Options::limits`")]
    Limit {
        /// What is too much.
        what: &'static str,
        /// How much there is.
        value: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// The user's choice names nothing.
    #[error("there is no {what} `{name}`; there are: {known}")]
    Choice {
        /// `scene` or `clip`.
        what: &'static str,
        /// The name given.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// There is nothing to see.
    #[error("{0}")]
    Nothing(String),
}

/// A problem and its place, before the file is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) place: String,
    pub(super) problem: Problem,
}

impl Fault {
    pub(super) fn new(place: &Place<'_>, problem: Problem) -> Self {
        Self { place: place.to_string(), problem }
    }

    /// A problem of the file as a whole.
    pub(super) fn whole(problem: Problem) -> Self {
        Self { place: String::new(), problem }
    }

    pub(super) fn data(place: &Place<'_>, problem: impl Into<String>) -> Self {
        Self::new(place, Problem::Data(problem.into()))
    }

    pub(super) fn in_file(self, file: &Path) -> GltfError {
        GltfError { file: file.display().to_string(), place: self.place, problem: self.problem }
    }
}

/// A place in the JSON: a list on the stack that costs nothing until it is printed.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    parent: Option<&'a Place<'a>>,
    step: Step<'a>,
}

#[derive(Clone, Copy)]
enum Step<'a> {
    Field(&'a str),
    Item(usize),
    /// What a number refers to.
    Refers(&'a str, usize),
}

impl<'a> Place<'a> {
    pub(super) fn root(field: &'a str) -> Self {
        Self { parent: None, step: Step::Field(field) }
    }

    pub(super) fn field(&'a self, name: &'a str) -> Self {
        Self { parent: Some(self), step: Step::Field(name) }
    }

    pub(super) fn item(&'a self, index: usize) -> Self {
        Self { parent: Some(self), step: Step::Item(index) }
    }

    pub(super) fn refers(&'a self, list: &'a str, index: usize) -> Self {
        Self { parent: Some(self), step: Step::Refers(list, index) }
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(parent) = self.parent {
            parent.fmt(f)?;
        }
        match self.step {
            Step::Field(name) if self.parent.is_none() => f.write_str(name),
            Step::Field(name) => write!(f, ".{name}"),
            Step::Item(index) => write!(f, "[{index}]"),
            Step::Refers(list, index) => write!(f, " -> {list}[{index}]"),
        }
    }
}

/// An item of a list of the file.
pub(super) fn item<'t, T>(list: &'t [T], index: usize, what: &'static str, place: &Place<'_>) -> Result<&'t T, Fault> {
    list.get(index).ok_or_else(|| Fault::new(place, Problem::Index { what, index, count: list.len() }))
}
