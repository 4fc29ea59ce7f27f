//! What survives a frame, and when it does not.
//!
//! | what | reset when |
//! |---|---|
//! | matte history, its length, its fast history | a cut; `Denoiser::reset`; the signal, its passes (by name and order) or the stage's switch come or go |
//! | glossy history, its length, its fast history | the same of the glossy signal |
//! | direct history | a cut; `Denoiser::reset`; a frame without jitter, or whose whole picture is anti-aliased |
//! | picture history and its length | a cut; `Denoiser::reset`; a frame without jitter; the switch of `antialiasing` |
//! | guides of the frame before | a cut; `Denoiser::reset` |
//! | everything | `Denoiser::resize` |
//! | single pixels | no surface match, unknown motion, off screen; `confidence_in` = 0 |
//!
//! A cut is a frame whose index does not differ from its predecessor's by exactly 1, in either direction. Other
//! settings may change at every frame: history is kept.

use crate::frame::{Frame, Signal};
use crate::pipeline::{Inputs, Plan, Stage};
use crate::settings::Settings;

/// What the back ends must know about history before they run a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Validity {
    /// The previous guides and the matte history can be used.
    pub matte: bool,
    /// The glossy history can be used.
    pub glossy: bool,
    /// The direct history can be used.
    pub direct: bool,
    /// The history of the picture can be used.
    pub picture: bool,
}

/// What the frame before looked like, and what it left behind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    last_index: Option<i64>,
    passes: [u64; 2],
    left: Validity,
}

impl Ledger {
    /// What this frame may use.
    pub fn open(&self, frame: &Frame<'_>) -> Validity {
        self.open_keyed(frame.index, keys(frame))
    }

    /// The same from the frame's index and what [`passes_key`] makes of the passes tied to each signal.
    pub(crate) fn open_keyed(&self, index: i64, passes: [u64; 2]) -> Validity {
        let consecutive = self.last_index.is_some_and(|i| index.checked_sub(i).is_some_and(|d| d.abs() == 1));
        if !consecutive {
            return Validity::default();
        }
        let same = |signal: Signal| passes[signal as usize] == self.passes[signal as usize];
        Validity {
            matte: self.left.matte && same(Signal::Matte),
            glossy: self.left.glossy && same(Signal::Glossy),
            direct: self.left.direct,
            picture: self.left.picture,
        }
    }

    /// Notes what this frame leaves behind.
    pub fn close(&mut self, frame: &Frame<'_>, plan: &Plan) {
        self.close_keyed(frame.index, keys(frame), plan);
    }

    pub(crate) fn close_keyed(&mut self, index: i64, passes: [u64; 2], plan: &Plan) {
        self.last_index = Some(index);
        self.passes = passes;
        self.left = Validity {
            matte: plan.matte_feedback.is_some(),
            glossy: plan.glossy_feedback.is_some(),
            direct: plan.runs(Stage::DirectTaa),
            picture: plan.runs(Stage::Antialiasing),
        };
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

fn keys(frame: &Frame<'_>) -> [u64; 2] {
    Signal::ALL.map(|signal| passes_key(frame.passes.iter().filter(|p| p.signal == signal).map(|p| p.name)))
}

/// The names of passes in order as one number (FNV-1a): comparing it allocates nothing.
pub(crate) fn passes_key<'a>(names: impl Iterator<Item = &'a str>) -> u64 {
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    // A byte that UTF-8 never has ends every name.
    let bytes = names.flat_map(|name| name.bytes().chain(std::iter::once(0xff)));
    bytes.fold(BASIS, |key, byte| (key ^ u64::from(byte)).wrapping_mul(PRIME))
}

/// A plan and what it was made from, so that it is made anew only when that changes.
#[derive(Clone, Debug)]
pub(crate) struct PlanCache {
    settings: Settings,
    inputs: Inputs,
    plan: Plan,
}

impl PlanCache {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self { settings: settings.clone(), inputs: Inputs::ALL, plan: Plan::new(settings, Inputs::ALL) }
    }

    pub(crate) fn get(&mut self, settings: &Settings, inputs: Inputs) -> &Plan {
        if self.inputs != inputs || self.settings != *settings {
            *self = Self { settings: settings.clone(), inputs, plan: Plan::new(settings, inputs) };
        }
        &self.plan
    }
}
