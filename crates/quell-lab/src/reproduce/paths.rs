//! The talk's introduction: 16 and 256 paths a pixel beside the denoised 2 and the reference.

use super::{Part, View, Workshop, options, three};
use crate::compare::sequence::default_choice;
use crate::error::Error;
use crate::methods::external::Competitor;
use crate::metrics::{Exposures, FrameScores};
use crate::report::document::{Figure, Section};
use crate::report::table::Table;
use quell_trace::{Control, Scene};
use serde::Serialize;

const DENOISED: &str = "quell:paper";
/// Paths a pixel without a filter; half of them are samples (one matte and one glossy path each).
const PATHS: [u32; 3] = [2, 16, 256];

/// One picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The scene's name.
    pub scene: String,
    /// What was done: `16 paths`, `2 paths, quell:paper`.
    pub what: String,
    /// Trimmed relMSE.
    pub rel_mse_trimmed: Option<f64>,
    /// HDR-FLIP.
    pub hdr_flip: Option<f64>,
}

/// The last of `frames` of each scene. The denoised picture is the one that `ablations` made of the same frames.
///
/// # Errors
/// Scenes that cannot be traced, files that cannot be written, a stop.
pub fn paths(shop: &Workshop<'_>, scenes: &[Scene], view: &View, frames: &[i64]) -> Result<Part<Row>, Error> {
    let mut rows = Vec::new();
    let last = *frames.last().ok_or_else(|| Error::Empty { what: "there are no frames".to_owned() })?;
    let mut section = Section {
        heading: "More paths, or a filter".to_owned(),
        text: vec![format!(
            "Frame {last}, camera {}, {}. The denoised picture has 2 paths a pixel and {} frames before it.",
            view.camera,
            view.size,
            frames.len() - 1
        )],
        ..Section::default()
    };
    let mut table = Table::new(["scene", "picture", "relMSE (trimmed)", "HDR-FLIP"]);
    for scene in scenes {
        let folder = shop.folder.join("ablations").join(&scene.name);
        let sequence = shop.sequence(scene, view, 1, frames.to_vec(), default_choice(frames), &folder)?;
        let reference = sequence.reference(last);
        let index = sequence.numbers.len() - 1;
        let depth = sequence.frame(index)?.frame.view_depth.clone();
        let exposures = match reference {
            Some(reference) => Some(Exposures::from_reference([(&reference.mean, depth.as_ref())])?),
            None => None,
        };
        let tracer = shop.on.tracer(scene, last, view.camera)?;
        let mut pictures = Vec::new();
        for paths in PATHS {
            (shop.notify)(&format!("{}: {paths} paths", scene.name));
            let samples = (paths / 2).max(1);
            let options = options(view, samples);
            let control = Control { cancel: shop.cancel, progress: None };
            pictures.push((format!("{paths} paths"), tracer.render(&options, &control)?.frame.composite()));
        }
        let competitor = Competitor::Method { name: DENOISED.to_owned() };
        let finished = shop.runner(&folder).run(&sequence, &competitor, &|_| ())?;
        pictures.insert(1, (format!("2 paths, {DENOISED}"), finished.picture(index)?));
        for (what, picture) in pictures {
            let scores = match (reference, &exposures) {
                (Some(reference), Some(exposures)) => {
                    Some(FrameScores::measure(&picture, &reference.mean, sequence.tone, exposures)?.0)
                }
                _ => None,
            };
            let row = Row {
                scene: scene.name.clone(),
                what: what.clone(),
                rel_mse_trimmed: scores.map(|s| s.rel_mse_trimmed),
                hdr_flip: scores.map(|s| s.hdr_flip),
            };
            table.push([scene.name.clone(), what.clone(), three(row.rel_mse_trimmed), three(row.hdr_flip)]);
            section.figures.push(Figure {
                title: format!("{}: {what}", scene.name),
                caption: format!("HDR-FLIP {}", three(row.hdr_flip)),
                picture: sequence.tone.picture(&picture),
            });
            rows.push(row);
        }
        if let Some(reference) = reference {
            section.figures.push(Figure {
                title: format!("{}: reference", scene.name),
                caption: format!("its own trimmed relMSE {}", three(reference.own_error)),
                picture: sequence.tone.picture(&reference.mean),
            });
        }
    }
    section.tables.push(("Against the reference.".to_owned(), table));
    Ok(Part { section, rows })
}
