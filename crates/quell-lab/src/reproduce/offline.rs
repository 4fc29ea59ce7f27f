//! The talk's offline table: one frame at 16 paths a pixel, filtered by NLM, WLR, NFOR and quell.

use super::{Part, View, Workshop, stopped, three};
use crate::compare::Judge;
use crate::error::Error;
use crate::methods::external::Competitor;
use crate::report::document::{Figure, Section};
use crate::report::table::Table;
use quell_trace::Scene;
use serde::Serialize;

/// In the order of the talk's table; quell last.
pub const METHODS: [&str; 4] = ["nlm", "wlr", "nfor", OURS];
const OURS: &str = "quell:paper";
/// Samples a pixel: each is one matte and one glossy path, 16 paths in all.
pub const SAMPLES: u32 = 8;

/// One method on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The scene's name.
    pub scene: String,
    /// The method's name; `none` is the noisy picture.
    pub method: String,
    /// Time of the frame.
    pub seconds: Option<f64>,
    /// The same a pixel.
    pub microseconds_per_pixel: Option<f64>,
    /// Against quell's time in the same run.
    pub times_slower_than_quell: Option<f64>,
    /// Trimmed relMSE.
    pub rel_mse_trimmed: Option<f64>,
    /// HDR-FLIP.
    pub hdr_flip: Option<f64>,
    /// Largest memory held.
    pub peak_bytes: Option<u64>,
    /// Why there are no figures.
    pub missing: Option<String>,
}

/// Filters frame `frame` of each scene.
///
/// # Errors
/// Scenes that cannot be traced, files that cannot be written, a stop. A method that fails is listed with its reason.
pub fn offline(shop: &Workshop<'_>, scenes: &[Scene], view: &View, frame: i64) -> Result<Part<Row>, Error> {
    let mut rows = Vec::new();
    let mut section = Section {
        heading: "Offline: one frame, 16 paths a pixel".to_owned(),
        text: vec![format!(
            "Frame {frame}, camera {}, {}, {SAMPLES} samples a pixel (one matte and one glossy path each) in two halves. Each \
             method sees this frame alone: quell has no history here. Times are of one frame on this machine's CPU, with \
             all threads, memory allocated anew; the talk's are of a GPU of 2017 at 5120x2880 (quell's) and of the other \
             methods' own programs.",
            view.camera, view.size
        )],
        ..Section::default()
    };
    let mut table =
        Table::new(["scene", "method", "s", "us/pixel", "x quell's time", "relMSE (trimmed)", "HDR-FLIP", "MiB"]);
    for scene in scenes {
        let folder = shop.folder.join("offline").join(&scene.name);
        let sequence = shop.sequence(scene, view, SAMPLES, vec![frame], vec![frame], &folder)?;
        let judge = if view.reference_samples == 0 { None } else { Some(Judge::new(&sequence)?) };
        let mut of_scene = Vec::new();
        for method in ["none"].into_iter().chain(METHODS) {
            (shop.notify)(&format!("{}: {method}", scene.name));
            let mut row = Row {
                scene: scene.name.clone(),
                method: method.to_owned(),
                seconds: None,
                microseconds_per_pixel: None,
                times_slower_than_quell: None,
                rel_mse_trimmed: None,
                hdr_flip: None,
                peak_bytes: None,
                missing: None,
            };
            let competitor = Competitor::Method { name: method.to_owned() };
            match shop.runner(&folder).run(&sequence, &competitor, &|_| ()) {
                Err(error) => row.missing = Some(stopped(error)?),
                Ok(finished) => {
                    if method != "none" {
                        row.seconds = finished.milliseconds.map(|m| m.median * 1e-3);
                        row.peak_bytes = finished.peak_bytes;
                    }
                    row.microseconds_per_pixel = row.seconds.map(|s| s * 1e6 / view.size.pixels() as f64);
                    let mean = match &judge {
                        Some(judge) => judge.measure(&finished, &|_| ())?.mean,
                        None => None,
                    };
                    row.rel_mse_trimmed = mean.map(|m| m.rel_mse_trimmed);
                    row.hdr_flip = mean.map(|m| m.hdr_flip);
                    section.figures.push(Figure {
                        title: format!("{}: {method}", scene.name),
                        caption: match row.seconds {
                            Some(_) => format!("HDR-FLIP {}, {} s", three(row.hdr_flip), three(row.seconds)),
                            None => format!("HDR-FLIP {}", three(row.hdr_flip)),
                        },
                        picture: sequence.tone.picture(&finished.picture(0)?),
                    });
                }
            }
            of_scene.push(row);
        }
        if let Some(reference) = sequence.reference(frame) {
            section.figures.push(Figure {
                title: format!("{}: reference", scene.name),
                caption: format!("its own trimmed relMSE {}", three(reference.own_error)),
                picture: sequence.tone.picture(&reference.mean),
            });
        }
        let ours = of_scene.iter().find(|r| r.method == OURS).and_then(|r| r.seconds);
        for mut row in of_scene {
            row.times_slower_than_quell = row.seconds.zip(ours).map(|(s, ours)| s / ours);
            if let Some(reason) = &row.missing {
                section.notes.push(format!("{}: {} is missing: {reason}", row.scene, row.method));
            }
            table.push([
                row.scene.clone(),
                row.method.clone(),
                three(row.seconds),
                three(row.microseconds_per_pixel),
                three(row.times_slower_than_quell),
                three(row.rel_mse_trimmed),
                three(row.hdr_flip),
                three(row.peak_bytes.map(|b| b as f64 / f64::from(1 << 20))),
            ]);
            rows.push(row);
        }
    }
    section.tables.push(("Time and quality of one frame.".to_owned(), table));
    Ok(Part { section, rows })
}
