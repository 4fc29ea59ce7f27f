//! The one JSON type. Fields may be added, never renamed.

use crate::error::Error;
use crate::metrics::FrameScores;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the layout.
pub const FORMAT: u32 = 1;

/// Everything that a command reports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of quell.
    pub quell: String,
    /// The command line as it was typed.
    pub command: String,
    /// Every setting in force, by name: scene, size, preset, seed and each parameter.
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Where it ran.
    pub machine: Machine,
    /// Every frame with its fate.
    pub frames: Vec<FrameStatus>,
    /// Time of each stage.
    pub stages: Vec<StageTime>,
    /// Scores of each method, first the noisy input.
    pub metrics: Vec<MethodScores>,
    /// The methods of a comparison with all their figures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub methods: Vec<crate::report::figures::ComparedMethod>,
    /// What was repaired in the input.
    pub sanitised: Vec<Sanitised>,
    /// Sentences that a user should read.
    pub warnings: Vec<String>,
}

impl Report {
    /// An empty report of this version, on this machine's cores.
    pub fn new(command: impl Into<String>) -> Self {
        Self {
            format: FORMAT,
            quell: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.into(),
            settings: BTreeMap::new(),
            machine: Machine {
                cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
                threads: rayon::current_num_threads(),
                instruction_set: std::env::consts::ARCH.to_owned(),
                adapter: None,
            },
            frames: Vec::new(),
            stages: Vec::new(),
            metrics: Vec::new(),
            methods: Vec::new(),
            sanitised: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// As indented JSON, with a line break at the end.
    ///
    /// # Errors
    /// [`Error::Json`].
    pub fn to_json(&self) -> Result<String, Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Writes the JSON file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Json`], [`Error::File`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        Ok(quell_frames::files::write_bytes(path, self.to_json()?.as_bytes())?)
    }
}

/// Where a command ran.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Logical cores.
    pub cores: usize,
    /// Threads that were used.
    pub threads: usize,
    /// Architecture or SIMD level, such as `x86_64` or `avx2`.
    pub instruction_set: String,
    /// The GPU, where one was used.
    pub adapter: Option<String>,
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Written.
    Done,
    /// Left as it was.
    Skipped,
    /// Not written; the reason is given.
    Failed,
}

/// One frame with its fate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameStatus {
    /// Its number.
    pub frame: i64,
    /// What became of it.
    pub status: Status,
    /// Why, where it is not done.
    pub reason: Option<String>,
}

/// Median and extremes over frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The middle value (the mean of the two in the middle).
    pub median: f64,
    /// The least.
    pub min: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// Of any values; `None` of none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let middle = sorted.len() / 2;
        let median = if sorted.len() % 2 == 1 { sorted[middle] } else { (sorted[middle - 1] + sorted[middle]) * 0.5 };
        Some(Self { median, min, max })
    }
}

/// Time of one stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// Its folder's name.
    pub name: String,
    /// Number of the stage in the paper; none for what the paper does not count.
    pub paper_stage: Option<u32>,
    /// Over the measured frames.
    pub milliseconds: Spread,
    /// Bytes that it must move a pixel.
    pub bytes_per_pixel: Option<f64>,
    /// The time that moving these bytes takes on this machine.
    pub floor_ms: Option<f64>,
}

/// Scores of one method on one sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodScores {
    /// `noisy`, `quell:paper` and so on.
    pub method: String,
    /// Means over the steady frames that have a reference.
    pub mean: Option<FrameScores>,
    /// Each frame that has a reference.
    pub frames: Vec<NumberedScores>,
}

/// Scores of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NumberedScores {
    /// The frame's number.
    pub frame: i64,
    /// Its scores.
    #[serde(flatten)]
    pub scores: FrameScores,
}

/// What was repaired in one input plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sanitised {
    /// Its name.
    pub plane: String,
    /// `NaN`, `infinite`, `not unit length` and so on.
    pub kind: String,
    /// Values repaired.
    pub count: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_names_are_those_of_the_interface_and_values_survive() {
        let mut report = Report::new("quell demo");
        report.settings.insert("seed".to_owned(), 1.into());
        report.frames.push(FrameStatus { frame: -3, status: Status::Failed, reason: Some("why".to_owned()) });
        report.stages.push(StageTime {
            name: "matte_temporal".to_owned(),
            paper_stage: Some(3),
            milliseconds: Spread::of([3.0, 1.0, 2.0, 10.0]).unwrap(),
            bytes_per_pixel: Some(40.0),
            floor_ms: None,
        });
        let scores = FrameScores {
            rel_mse: 0.5,
            rel_mse_trimmed: 0.25,
            fireflies: 0.0,
            psnr: f64::INFINITY,
            energy: 1.0,
            ssim: 0.9,
            ldr_flip: 0.1,
            hdr_flip: 0.1,
        };
        report.metrics.push(MethodScores {
            method: "noisy".to_owned(),
            mean: Some(scores),
            frames: vec![NumberedScores { frame: 7, scores }],
        });
        report.sanitised.push(Sanitised { plane: "normal".to_owned(), kind: "NaN".to_owned(), count: 2 });
        let json = report.to_json().unwrap();
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        for name in [
            "format",
            "quell",
            "command",
            "settings",
            "machine",
            "frames",
            "stages",
            "metrics",
            "sanitised",
            "warnings",
        ] {
            assert!(value.get(name).is_some(), "{name}");
        }
        assert_eq!(value["stages"][0]["milliseconds"]["median"], 2.5);
        assert_eq!(value["frames"][0]["status"], "failed");
        assert_eq!(value["metrics"][0]["frames"][0]["psnr"], serde_json::Value::Null);
        assert_eq!(serde_json::from_str::<Report>(&json).unwrap(), report);
    }
}
