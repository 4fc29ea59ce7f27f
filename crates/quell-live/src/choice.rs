//! What a frame is made with.

use crate::baselines::BaselineConstants;
use quell::gpu::DebugView;
use quell::pipeline::Image;
use quell::settings::ABLATIONS;
use quell::{Preset, Settings};

/// A picture beside others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pane {
    /// As traced.
    Noisy,
    /// By the edge-avoiding a-trous wavelet (Dammertz et al. 2010).
    Atrous,
    /// By spatiotemporal variance-guided filtering (Schied et al. 2017).
    Svgf,
    /// Denoised.
    Quell,
    /// The mean of all frames since something last moved: converges to the reference.
    Converged,
    /// The debug view that was chosen.
    Debug,
}

impl Pane {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Noisy, Self::Atrous, Self::Svgf, Self::Quell, Self::Converged, Self::Debug];

    /// As a user reads it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Noisy => "noisy",
            Self::Atrous => "a-trous",
            Self::Svgf => "SVGF",
            Self::Quell => "quell",
            Self::Converged => "converged",
            Self::Debug => "debug",
        }
    }

    /// Of `display.wgsl`.
    pub(crate) const fn number(self) -> u32 {
        match self {
            Self::Noisy => 0,
            Self::Quell => 1,
            Self::Converged => 2,
            Self::Debug => 3,
            Self::Atrous => 4,
            Self::Svgf => 5,
        }
    }
}

/// Debug views that are offered, by name.
pub const DEBUG_VIEWS: &[(&str, DebugView)] = &[
    ("matte, as traced", DebugView::Light(Image::MatteInput)),
    ("matte, filtered", DebugView::Light(Image::MatteFiltered)),
    ("glossy, as traced", DebugView::Light(Image::GlossyInput)),
    ("glossy, filtered", DebugView::Light(Image::GlossyFiltered)),
    ("direct", DebugView::Light(Image::DirectInput)),
    ("depth", DebugView::Depth),
    ("normal", DebugView::Normal),
    ("roughness", DebugView::Roughness),
    ("surface id", DebugView::SurfaceId),
    ("glossy hit distance", DebugView::GlossyHit),
    ("motion", DebugView::Motion),
    ("world grid", DebugView::WorldGrid),
    ("normal error", DebugView::NormalError),
    ("motion error", DebugView::MotionError),
    ("depth error", DebugView::DepthError),
    ("confidence", DebugView::Confidence),
    ("history length", DebugView::HistoryLength),
    ("rejection", DebugView::Rejection),
    ("weights around the pointer", DebugView::WeightsAround([0, 0])),
    ("sum of weights", DebugView::WeightSum),
];

/// How frames are traced. A change of any of these begins the converged picture anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracing {
    /// Samples a pixel, 1 to 16: one matte and one glossy path each.
    pub paths: u32,
    /// Scatterings after the primary surface, 0 to 8.
    pub bounces: u32,
    /// Shadow rays a pixel of the direct term, 1 to 64.
    pub direct_samples: u32,
    /// Sample positions move within pixels from frame to frame, for temporal anti-aliasing.
    pub jitter: bool,
}

impl Default for Tracing {
    fn default() -> Self {
        Self { paths: 1, bounces: 3, direct_samples: 16, jitter: true }
    }
}

impl Tracing {
    /// The same within their ranges.
    #[must_use]
    pub fn held(self) -> Self {
        Self {
            paths: self.paths.clamp(1, 16),
            bounces: self.bounces.min(8),
            direct_samples: self.direct_samples.clamp(1, 64),
            ..self
        }
    }
}

/// What a frame is made with and how it is shown.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Every parameter of every stage, before ablations.
    pub settings: Settings,
    /// Which of [`ABLATIONS`] are on, in their order.
    pub ablations: Vec<bool>,
    /// How frames are traced.
    pub tracing: Tracing,
    /// Multiplies light before the tone curve, in stops beside the scene's own exposure.
    pub stops: f32,
    /// Of a-trous and SVGF.
    pub baselines: BaselineConstants,
    /// Pictures from left to right, 1 to 6.
    pub panes: Vec<Pane>,
    /// Where the panes meet, as shares of the width; one fewer than panes count.
    pub splits: Vec<f32>,
    /// Number among [`DEBUG_VIEWS`], and the views' scale.
    pub debug: usize,
    /// Brightness or sensitivity of debug views.
    pub debug_scale: f32,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            settings: Settings::preset(Preset::default()),
            ablations: vec![false; ABLATIONS.len()],
            tracing: Tracing::default(),
            stops: 0.0,
            baselines: BaselineConstants::default(),
            panes: vec![Pane::Noisy, Pane::Quell],
            splits: vec![0.5],
            debug: 5,
            debug_scale: 1.0,
        }
    }
}

impl Choice {
    /// The settings with the ablations that are on.
    pub fn effective(&self) -> Settings {
        let on = ABLATIONS.iter().zip(&self.ablations).filter(|(_, on)| **on);
        on.fold(self.settings.clone(), |settings, (ablation, _)| (ablation.apply)(settings))
    }

    /// Makes `panes` and `splits` fit: one pane at least, splits in order within 0..1 and spread evenly where some are missing.
    pub fn tidy(&mut self) {
        self.panes.truncate(Pane::ALL.len());
        if self.panes.is_empty() {
            self.panes.push(Pane::Quell);
        }
        let wanted = self.panes.len() - 1;
        if self.splits.len() != wanted || self.splits.iter().any(|s| !s.is_finite()) {
            self.splits = (1..=wanted).map(|i| i as f32 / (wanted + 1) as f32).collect();
        }
        let mut last = 0.0;
        for split in &mut self.splits {
            *split = split.clamp(last, 1.0);
            last = *split;
        }
        self.tracing = self.tracing.held();
        self.baselines = self.baselines.held();
        self.ablations.resize(ABLATIONS.len(), false);
        self.debug = self.debug.min(DEBUG_VIEWS.len() - 1);
    }

    /// The pane that is shown at a share of the width.
    pub fn pane_at(&self, share: f32) -> Pane {
        let index = self.splits.iter().filter(|split| share >= **split).count();
        self.panes.get(index).copied().unwrap_or(Pane::Quell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_and_splits_are_made_to_fit() {
        let mut choice = Choice { panes: vec![], splits: vec![0.2, f32::NAN], ..Choice::default() };
        choice.tidy();
        assert_eq!((choice.panes.as_slice(), choice.splits.len()), (&[Pane::Quell][..], 0));
        choice.panes = Pane::ALL.to_vec();
        choice.splits = vec![0.9, 0.1, 7.0, 0.2, 0.3];
        choice.tracing.paths = 0;
        choice.tidy();
        assert_eq!(choice.splits, [0.9, 0.9, 1.0, 1.0, 1.0]);
        assert_eq!(choice.tracing.paths, 1);
        assert_eq!(choice.pane_at(0.5), Pane::Noisy);
        assert_eq!(choice.pane_at(0.95), Pane::Svgf);
    }

    #[test]
    fn ablations_add_up() {
        let mut choice = Choice::default();
        assert_eq!(choice.effective(), choice.settings);
        let on = |choice: &mut Choice, name| {
            let index = ABLATIONS.iter().position(|a| a.name == name).unwrap();
            choice.ablations[index] = true;
        };
        on(&mut choice, "no-firefly");
        on(&mut choice, "no-virtual");
        let settings = choice.effective();
        assert!(!settings.firefly.enabled && !settings.glossy_temporal.virtual_reprojection);
        assert!(choice.settings.firefly.enabled, "the sliders keep their values");
    }
}
