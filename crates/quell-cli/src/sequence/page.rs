//! The player page of a run.

use super::scores::Metrics;
use super::{Job, Run, files};
use crate::context::Context;
use crate::failure::Failure;
use quell::Plane;
use quell_lab::report::player::{self, PlayerData, PlayerSequence};
use quell_lab::report::table::{metrics_table, stage_table};
use quell_lab::tone::Picture;
use std::path::Path;

/// Everything that the page is made from.
pub struct Page<'a> {
    pub job: &'a Job,
    pub context: &'a Context,
    pub run: &'a Run,
    pub metrics: &'a Metrics,
}

impl Page<'_> {
    /// Writes the page; what had to be left out is returned in a sentence.
    pub fn write(&self, path: &Path) -> Result<Option<String>, Failure> {
        let (job, run) = (self.job, self.run);
        let kept: Vec<usize> = (0..job.frames.len()).filter(|&i| run.noisy[i].is_some()).collect();
        let sequence = |name: &str, description: String, all: &[Option<Picture>], maps: &[(usize, Plane<f32>)]| {
            let map = |i: &usize| maps.iter().find(|(index, _)| index == i).map(|(_, map)| map.clone());
            PlayerSequence {
                name: name.to_owned(),
                description,
                pictures: kept.iter().map(|&i| all[i].clone()).collect(),
                error_maps: if maps.is_empty() { Vec::new() } else { kept.iter().map(map).collect() },
            }
        };
        let has = |all: &[Option<Picture>]| all.iter().any(Option::is_some);
        let mut sequences = vec![sequence(files::NOISY, job.sampling(), &run.noisy, &self.metrics.noisy_maps)];
        if has(&run.denoised) {
            let preset = format!("preset {}", self.context.preset.name());
            sequences.push(sequence(files::DENOISED, preset, &run.denoised, &self.metrics.denoised_maps));
        }
        if has(&run.reference) {
            let converged = "converged, from the same sample positions".to_owned();
            sequences.push(sequence(files::REFERENCE, converged, &run.reference, &[]));
        }
        let mut notes = run.notes.clone();
        if kept.len() < job.frames.len() {
            notes.push(format!("Of {} frames {} are shown here.", job.frames.len(), kept.len()));
        }
        notes.extend(run.warnings());
        let stages = run.clock.stages();
        let data = PlayerData {
            title: job.scene.name.clone(),
            subtitle: format!("{}, {} frames, camera {}; {}", job.size(), job.frames.len(), job.camera, job.sampling()),
            frame_numbers: kept.iter().map(|&i| job.frames[i]).collect(),
            frames_per_second: f64::from(files::FRAMES_PER_SECOND),
            sequences,
            metrics: if self.metrics.methods.is_empty() {
                Default::default()
            } else {
                metrics_table(&self.metrics.methods)
            },
            stages: if stages.is_empty() { Default::default() } else { stage_table(&stages) },
            notes,
            command: self.context.command.clone(),
        };
        Ok(player::write(path, &data)?.reduced)
    }
}
