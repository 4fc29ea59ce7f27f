//! What the talk's slides show, made anew: the offline table, the ablations as pictures and scorecard, 16 and 256 paths
//! beside the denoised picture and the reference. Each part gives a [`Section`] of the page and rows for JSON.
//!
//! ```text
//! offline.rs    one frame, 16 paths a pixel: NLM, WLR, NFOR and quell; time beside quality
//! ablations.rs  sequences with one part of the algorithm left out
//! paths.rs      more paths, or a filter
//! ```

pub mod ablations;
pub mod offline;
pub mod paths;

use crate::backend::Backend;
use crate::cache::Cache;
use crate::compare::memory::Memory;
use crate::compare::{Runner, SceneSource, Sequence};
use crate::error::Error;
use crate::references::ReferenceTarget;
use crate::report::document::Section;
use crate::report::table::significant;
use crate::tracer::TraceOn;
use quell::Size;
use quell_trace::{PrimaryReplacement, RenderOptions, Scene};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// What all parts share.
#[derive(Clone, Copy)]
pub struct Workshop<'a> {
    /// Where noisy frames and finished pictures are kept.
    pub folder: &'a Path,
    /// Where references are kept.
    pub cache: Option<&'a Cache>,
    /// Stands for the program's version.
    pub program: &'a str,
    /// What quell runs on.
    pub backend: &'a Backend,
    /// What traces frames and references.
    pub on: &'a TraceOn,
    /// Measures memory.
    pub memory: &'a dyn Memory,
    /// Work ends soon after this turns true.
    pub cancel: Option<&'a AtomicBool>,
    /// Hears what is being done.
    pub notify: &'a (dyn Fn(&str) + Sync),
}

/// How a scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Extent of the pictures.
    pub size: Size,
    /// Camera, from 1.
    pub camera: usize,
    /// Seed of the noisy frames.
    pub seed: u64,
    /// Samples a pixel of each half of a reference; 0: no references, so no figures of quality.
    pub reference_samples: u32,
}

/// A part of the page, and the same as rows.
#[derive(Clone, Debug)]
pub struct Part<R> {
    /// For the page.
    pub section: Section,
    /// For JSON.
    pub rows: Vec<R>,
}

/// How a view is traced. Mirrors are surfaces, as the paper's filter has them.
fn options(view: &View, samples: u32) -> RenderOptions {
    let primary_replacement = PrimaryReplacement::Glass;
    RenderOptions { samples, seed: view.seed, primary_replacement, ..RenderOptions::new(view.size) }
}

impl Workshop<'_> {
    /// Renders `frames` of a scene; `references` of them with references.
    fn sequence(
        &self,
        scene: &Scene,
        view: &View,
        samples: u32,
        frames: Vec<i64>,
        references: Vec<i64>,
        folder: &Path,
    ) -> Result<Sequence, Error> {
        let source = SceneSource {
            scene,
            camera: view.camera,
            frames,
            options: options(view, samples),
            target: ReferenceTarget { samples: view.reference_samples.max(1), ..ReferenceTarget::default() },
            references: if view.reference_samples == 0 { Vec::new() } else { references },
            on: self.on,
            cache: self.cache,
            folder: Some(folder),
        };
        let name = &scene.name;
        source.load(self.cancel, &|p| (self.notify)(&format!("{name}: {} ({:.0} %)", p.note, 100.0 * p.share)))
    }

    fn runner<'b>(&'b self, folder: &'b Path) -> Runner<'b> {
        Runner { folder, program: self.program, backend: self.backend, memory: self.memory, cancel: self.cancel }
    }
}

/// A stop is passed on; anything else fails one method alone, and is reported.
fn stopped(error: Error) -> Result<String, Error> {
    if matches!(error, Error::Trace(quell_trace::TraceError::Cancelled)) { Err(error) } else { Ok(error.to_string()) }
}

/// A figure with three digits, or a dash.
fn three(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), significant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits() {
        let cases = [(0.0123456, "0.0123"), (1.0, "1.00"), (123.4, "123"), (98765.0, "9.88e4"), (1e-9, "1.00e-9")];
        for (value, text) in cases {
            assert_eq!(three(Some(value)), text);
        }
        assert_eq!(three(None), "-");
    }
}
