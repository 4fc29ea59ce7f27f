//! The talk's ablations: the same sequence with one part of the algorithm left out, as pictures and scorecard.

use super::{Part, View, Workshop, three};
use crate::compare::sequence::default_choice;
use crate::compare::{Judge, Sequence, Verdict};
use crate::error::Error;
use crate::methods::external::Competitor;
use crate::methods::quell::ABLATIONS;
use crate::report::document::{Figure, Section};
use crate::report::table::Table;
use crate::scorecard::Scores;
use crate::tone::Picture;
use quell::{Plane, Rgb, Size};
use quell_trace::Scene;
use serde::Serialize;

const FULL: &str = "quell:paper";
/// Target 4: an ablation is worse in its artefact by this factor on at least one sequence.
pub const WORSE_BY: f64 = 1.5;

/// Which artefacts show that a part is missing: the first that is measured on a sequence counts.
const SHOWN_BY: [(&str, &[&str]); 5] = [
    ("no-denoising", &["noise"]),
    ("no-spatial", &["noise"]),
    ("no-temporal", &["flicker", "boiling"]),
    ("no-disocclusion", &["fresh_noise"]),
    ("no-virtual", &["ghosting", "smearing", "blur"]),
];

/// One ablation on one sequence.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene's name.
    pub scene: String,
    /// `quell:paper+no-virtual`.
    pub method: String,
    /// HDR-FLIP, mean over the scored frames.
    pub hdr_flip: Option<f64>,
    /// Trimmed relMSE of the same frames.
    pub rel_mse_trimmed: Option<f64>,
    /// Sum of the picture over sum of the reference.
    pub energy: Option<f64>,
    /// The scorecard.
    pub scorecard: Scores,
}

/// Runs every ablation and the whole algorithm over `count` frames of each scene.
///
/// # Errors
/// Scenes that cannot be traced, files that cannot be written, a stop.
pub fn ablations(shop: &Workshop<'_>, scenes: &[Scene], view: &View, frames: &[i64]) -> Result<Part<Row>, Error> {
    let mut rows: Vec<Row> = Vec::new();
    let mut section = Section {
        heading: "Ablations".to_owned(),
        text: vec![format!(
            "Frames {} to {}, camera {}, {}, one sample a pixel (2 paths). Pictures: the last frame; below it one row of \
             pixels over all frames, time downwards, where flicker is salt, boiling clouds and ghosting tails.",
            frames.first().unwrap_or(&0),
            frames.last().unwrap_or(&0),
            view.camera,
            view.size
        )],
        ..Section::default()
    };
    for scene in scenes {
        let folder = shop.folder.join("ablations").join(&scene.name);
        let sequence = shop.sequence(scene, view, 1, frames.to_vec(), default_choice(frames), &folder)?;
        let judge = if view.reference_samples == 0 { None } else { Some(Judge::new(&sequence)?) };
        let mut table = Table::new(["method", "HDR-FLIP", "relMSE (trimmed)", "energy"]);
        table.head.extend(Scores::NAMES.map(|n| n.replace('_', " ")));
        let names = ABLATIONS.iter().map(|a| (a.title, format!("{FULL}+{}", a.name)));
        for (title, method) in names.chain([("Full", FULL.to_owned())]) {
            (shop.notify)(&format!("{}: {method}", scene.name));
            let competitor = Competitor::Method { name: method.clone() };
            let finished = shop.runner(&folder).run(&sequence, &competitor, &|_| ())?;
            let verdict = match &judge {
                Some(judge) => Some(judge.measure(&finished, &|_| ())?),
                None => None,
            };
            let row = row(scene, &method, verdict);
            let mut cells = vec![method.clone(), three(row.hdr_flip), three(row.rel_mse_trimmed), three(row.energy)];
            cells.extend(row.scorecard.iter().map(|(_, score)| three(score.value)));
            table.rows.push(cells);
            let last = sequence.numbers.len().saturating_sub(1);
            let slice = slice(&sequence, |index| finished.picture(index))?;
            section.figures.push(Figure {
                title: format!("{}: {title}", scene.name),
                caption: format!("HDR-FLIP {}", three(row.hdr_flip)),
                picture: above(&sequence.tone.picture(&finished.picture(last)?), &slice),
            });
            rows.push(row);
        }
        if let Some(reference) = sequence.numbers.last().and_then(|n| sequence.reference(*n)) {
            section.figures.push(Figure {
                title: format!("{}: reference", scene.name),
                caption: format!("its own trimmed relMSE {}", three(reference.own_error)),
                picture: sequence.tone.picture(&reference.mean),
            });
        }
        section.tables.push((format!("{}; 0 is best, energy 1; - cannot be measured here", scene.name), table));
    }
    if view.reference_samples > 0 {
        section.tables.insert(0, ("Target: each ablation is worse in its artefact than the whole by at least 1.5 times on at least one sequence.".to_owned(), target(&rows)));
    }
    Ok(Part { section, rows })
}

fn row(scene: &Scene, method: &str, verdict: Option<Verdict>) -> Row {
    let mean = verdict.as_ref().and_then(|v| v.mean);
    Row {
        scene: scene.name.clone(),
        method: method.to_owned(),
        hdr_flip: mean.map(|m| m.hdr_flip),
        rel_mse_trimmed: mean.map(|m| m.rel_mse_trimmed),
        energy: mean.map(|m| m.energy),
        scorecard: verdict.map_or_else(|| Scores::all_null("there is no reference"), |v| v.scorecard),
    }
}

/// For each ablation and each artefact that should show it: the sequence where it is worst against the whole.
fn target(rows: &[Row]) -> Table {
    let mut table = Table::new(["ablation", "artefact", "sequence", "whole", "without", "times worse", "at least 1.5"]);
    let value = |scene: &str, method: &str, artefact: &str| {
        let row = rows.iter().find(|r| r.scene == scene && r.method == method)?;
        row.scorecard.get(artefact)?.value
    };
    let mut scenes: Vec<&str> = rows.iter().map(|r| r.scene.as_str()).collect();
    scenes.dedup();
    for (ablation, artefacts) in SHOWN_BY {
        for artefact in artefacts {
            let worst = scenes
                .iter()
                .filter_map(|&scene| {
                    let whole = value(scene, FULL, artefact)?;
                    let without = value(scene, &format!("{FULL}+{ablation}"), artefact)?;
                    Some((scene, whole, without, without / whole.max(1e-6)))
                })
                .max_by(|a, b| a.3.total_cmp(&b.3));
            let name = artefact.replace('_', " ");
            table.push(match worst {
                Some((scene, whole, without, ratio)) => [
                    ablation.to_owned(),
                    name,
                    scene.to_owned(),
                    three(Some(whole)),
                    three(Some(without)),
                    // Shares can be 0: then the ratio says no more than that.
                    if ratio > 100.0 { "> 100".to_owned() } else { three(Some(ratio)) },
                    if ratio >= WORSE_BY { "met" } else { "missed" }.to_owned(),
                ],
                None => {
                    let dash = || "-".to_owned();
                    [ablation.to_owned(), name, dash(), dash(), dash(), dash(), "not measured".to_owned()]
                }
            });
        }
    }
    table
}

/// One row of pixels, in the middle of the picture, over all frames.
fn slice(sequence: &Sequence, picture: impl Fn(usize) -> Result<Plane<Rgb>, Error>) -> Result<Picture, Error> {
    let mut rows = Vec::new();
    for index in 0..sequence.numbers.len() {
        rows.extend_from_slice(picture(index)?.row(sequence.size.height / 2));
    }
    let plane = Plane::from_vec(Size::new(sequence.size.width, sequence.numbers.len()), rows)?;
    Ok(sequence.tone.picture(&plane))
}

/// Two pictures of the same width, one above the other.
fn above(top: &Picture, below: &Picture) -> Picture {
    let size = Size::new(top.size.width, top.size.height + below.size.height);
    Picture { size, rgb: [top.rgb.as_slice(), below.rgb.as_slice()].concat() }
}
