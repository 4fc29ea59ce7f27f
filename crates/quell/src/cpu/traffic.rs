//! Bytes that the fast back end reads and writes a pixel, stage by stage: what the schedules in `passes/` move, each
//! plane once for every pass over it. The floor of a stage's time on a machine whose memory is the limit.

use crate::pipeline::{Image, Plan, Stage};
use crate::settings::{Feedback, Settings};

const SCALAR: u32 = 4;
const COLOUR: u32 = 3 * SCALAR;
/// Depth, normal, identity.
const SURFACE: u32 = 5 * SCALAR;
const ROUGHNESS: u32 = SCALAR;
const MOTION: u32 = 2 * SCALAR;
/// Confidence and length for the caller, length for the next frame.
const TEMPORAL: u32 = 3 * SCALAR;
/// The detector of changed light: history's colours; its luminance written and read, what changed too; length, fast history read, and
/// once more where it is blended; written. Cells are a 64th of a pixel.
const CHANGE: u32 = COLOUR + 8 * SCALAR;
/// A finished image from phase order into the host's: read and written.
const SHOWN: u32 = 2 * COLOUR;

/// Of a frame with all planes and no passes, in the steady state; `None`: the stage does not run.
pub fn bytes_per_pixel(plan: &Plan, settings: &Settings, stage: Stage) -> Option<u32> {
    let step = plan.steps.iter().find(|s| s.stage == stage)?;
    let shown =
        if [plan.matte_output, plan.glossy_output, plan.direct_output].contains(&step.output) { SHOWN } else { 0 };
    let shares = plan.runs(Stage::MatteTemporal)
        && plan.runs(Stage::GlossyTemporal)
        && settings.glossy_temporal.virtual_reprojection;
    let seen = if shares { SCALAR } else { 0 };
    // Current and historic colours and the result; the old length.
    let blended = 3 * COLOUR + SCALAR + TEMPORAL;
    let change = |is_on: bool| if is_on { CHANGE } else { 0 };
    let filtered = 2 * COLOUR + SURFACE + ROUGHNESS;
    let moved = match stage {
        Stage::MatteTemporal => {
            blended + 2 * SURFACE + ROUGHNESS + MOTION + seen + change(settings.changed_light.matte)
        }
        // Its own guides, the hit distance, the previous guides; motion only where stage 3 did not find the surfaces for it.
        Stage::GlossyTemporal => {
            let found = if shares { seen } else { MOTION };
            blended + 2 * (SURFACE + ROUGHNESS) + SCALAR + found + change(settings.changed_light.glossy)
        }
        Stage::MattePrefilter | Stage::MatteBilateral => filtered,
        // With the history length.
        Stage::MatteYoung1
        | Stage::MatteYoung3
        | Stage::MatteYoung9
        | Stage::MatteYoung27
        | Stage::GlossyYoung1
        | Stage::GlossyYoung3
        | Stage::GlossyYoung9 => filtered + SCALAR,
        // Maximum and blur along rows and down columns: four passes over scalars; then the blends.
        Stage::Disocclusion => {
            let floored = if settings.pipeline.feedback == Feedback::Blend { COLOUR } else { 0 };
            8 * SCALAR + 3 * COLOUR + SCALAR + floored
        }
        Stage::Firefly => 2 * COLOUR + SCALAR,
        // With both radii: nearness from depth and hit distance, then with it the surfaces and their roughness.
        Stage::GlossyHorizontal => filtered + SCALAR + 3 * SCALAR + SCALAR + SURFACE + ROUGHNESS + 2 * SCALAR,
        Stage::GlossyVertical => filtered + SCALAR,
        Stage::DirectTaa => 3 * COLOUR + SCALAR + MOTION,
        // The sum, the picture; history and how many frames it holds, read and written.
        Stage::Antialiasing => 2 * COLOUR + SCALAR + MOTION + 2 * (COLOUR + SCALAR),
        Stage::Composite => {
            // Signals, their weights, direct light, the sum; untouched direct light is copied on the way.
            let copied = if plan.direct_output == Image::DirectInput { 2 * COLOUR } else { 0 };
            6 * COLOUR + copied
        }
    };
    Some(moved + shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Inputs;

    #[test]
    fn bytes_are_those_of_the_plan() {
        let mut settings = Settings::default();
        settings.young_filter.matte = true;
        settings.young_filter.glossy = true;
        settings.young_filter.matte_levels = 4;
        let plan = Plan::new(&settings, Inputs::ALL);
        let of = |plan: &Plan, settings: &Settings, stage| bytes_per_pixel(plan, settings, stage);
        // Signal in and out, depth, normal, identity, roughness.
        assert_eq!(of(&plan, &settings, Stage::MattePrefilter), Some(48));
        assert_eq!(of(&plan, &settings, Stage::MatteBilateral), Some(48 + 24));
        assert!(Stage::ALL.into_iter().all(|s| of(&plan, &settings, s).is_some() || s == Stage::Antialiasing));
        let mut whole = settings.clone();
        whole.antialiasing.enabled = true;
        let whole_plan = Plan::new(&whole, Inputs::ALL);
        assert_eq!(of(&whole_plan, &whole, Stage::Antialiasing), Some(68));
        assert_eq!(of(&whole_plan, &whole, Stage::DirectTaa), None, "one takes the other's place");
        // Without stage 3, stage 8 reads motion, 8 bytes, not the surfaces that stage 3 found, 4.
        let shared = of(&plan, &settings, Stage::GlossyTemporal).unwrap();
        let mut looking = settings.clone();
        looking.changed_light.glossy = true;
        assert_eq!(of(&plan, &looking, Stage::GlossyTemporal), Some(shared + 44));
        settings.matte_temporal.enabled = false;
        let alone = Plan::new(&settings, Inputs::ALL);
        assert_eq!(of(&alone, &settings, Stage::GlossyTemporal), Some(shared + 4));
        assert_eq!(of(&alone, &settings, Stage::MatteTemporal), None);
    }
}
