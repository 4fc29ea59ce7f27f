//! `quell bench --sequence --backend gpu`: what each pass of the sequence filter takes on the device, with its bytes and its floor.

use super::sequence::{Cost, steady};
use super::{Bandwidth, cycles};
use crate::args::BenchArgs;
use crate::failure::Failure;
use quell::Size;
use quell::sequence::{SequenceDenoiser, SequenceSettings};
use quell_lab::backend::Backend;
use quell_lab::report::table::Table;
use serde_json::{Map, Value, json};
use std::fmt;

/// A pass, of one frame.
struct Pass {
    name: &'static str,
    milliseconds: f64,
    dispatches: f64,
    bytes: Option<usize>,
}

/// Frames on a device.
pub(super) struct Measured {
    size: Size,
    adapter: String,
    is_software: bool,
    /// Of a frame, what the CPU does besides included.
    cost: Cost,
    passes: Vec<Pass>,
    /// Why stages ran on the CPU.
    notes: Vec<String>,
    gigabytes_a_second: f64,
}

/// What a frame takes whose window is whole. `None`: the back end is the CPU.
pub(super) fn measure(
    backend: &Backend,
    size: Size,
    settings: &SequenceSettings,
    args: &BenchArgs,
) -> Result<Option<Measured>, Failure> {
    let Some(accelerator) = backend.timed_accelerator()? else { return Ok(None) };
    let count = (args.count as usize).max(1);
    let denoiser = SequenceDenoiser::with_accelerator(settings.clone(), accelerator.clone())?;
    let mut counted = 0;
    let cost = steady(denoiser, settings, (size, count), |_| {
        // Those of frames before do not count.
        if counted == 0 {
            accelerator.take_times();
        }
        counted += 1;
        Ok(())
    })?;
    let pass = |(name, milliseconds, dispatches): (&'static str, f64, usize)| Pass {
        name,
        milliseconds: milliseconds / count as f64,
        dispatches: dispatches as f64 / count as f64,
        bytes: bytes_per_pixel(name, settings),
    };
    Ok(Some(Measured {
        size,
        adapter: backend.adapter().unwrap_or_default(),
        is_software: backend.is_software(),
        cost,
        passes: accelerator.take_times().into_iter().map(pass).collect(),
        notes: accelerator.notes(false),
        gigabytes_a_second: Bandwidth::of(backend, args.bandwidth)?.gigabytes_a_second,
    }))
}

impl Measured {
    fn floor(&self, bytes: usize) -> f64 {
        bytes as f64 * self.size.pixels() as f64 / (self.gigabytes_a_second * 1e6)
    }

    pub(super) fn json(&self) -> Value {
        let pass = |pass: &Pass| {
            let floor = pass.bytes.map(|bytes| self.floor(bytes));
            let values = json!({ "ms": pass.milliseconds, "dispatches": pass.dispatches, "bytes_per_pixel": pass.bytes,
                                 "floor_ms": floor });
            (pass.name.to_owned(), values)
        };
        json!({
            "adapter": self.adapter,
            "clock_ms": self.cost.clock * 1e3,
            "processor_ms": self.cost.processor * 1e3,
            "passes": self.passes.iter().map(pass).collect::<Map<_, _>>(),
        })
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (clock, processor) = (self.cost.clock * 1e3, self.cost.processor * 1e3);
        writeln!(f, "on {}: {clock:.1} ms a frame by the clock, {processor:.1} processor ms\n", self.adapter)?;
        self.notes.iter().try_for_each(|note| writeln!(f, "{note}\n"))?;
        if self.passes.is_empty() {
            return writeln!(f, "no pass was timed: the device has no timestamps, or nothing ran there");
        }
        if self.is_software {
            writeln!(
                f,
                "timestamps of a device in software do not wait for its threads: passes take longer than they say\n"
            )?;
        }
        let mut table = Table::new(["pass", "ms a frame", "dispatches", "bytes/pixel", "floor ms"]);
        for pass in &self.passes {
            table.push([
                pass.name.to_owned(),
                format!("{:.3}", pass.milliseconds),
                format!("{:.0}", pass.dispatches),
                pass.bytes.map_or("-".to_owned(), |bytes| bytes.to_string()),
                pass.bytes.map_or("-".to_owned(), |bytes| format!("{:.3}", self.floor(bytes))),
            ]);
        }
        let sum: f64 = self.passes.iter().map(|pass| pass.milliseconds).sum();
        let bytes: usize = self.passes.iter().filter_map(|pass| pass.bytes).sum();
        let floor = format!("{:.3}", self.floor(bytes));
        table.push(["sum".to_owned(), format!("{sum:.3}"), String::new(), bytes.to_string(), floor]);
        writeln!(
            f,
            "{table}\nbytes: each plane once for every dispatch that reads or writes it; floor: at the {:.0} GB/s that copying reaches there",
            self.gigabytes_a_second
        )
    }
}

/// Matte lights of those frames.
const MATTE: usize = 2;

/// Bytes a pixel of a pass in one frame, each plane once for every dispatch that reads or writes it: of frames like those that are
/// measured, whose lights have a plane each.
fn bytes_per_pixel(pass: &str, s: &SequenceSettings) -> Option<usize> {
    const FOUR: usize = 16;
    let planes = cycles::LIT;
    let groups = planes.div_ceil(4);
    let window = |frames: usize| if s.gather.future { 2 * frames + 1 } else { frames + 1 };
    let (around, steady) = (window(s.gather.frames as usize), window(s.stabilise.frames as usize));
    // Frames along which noise is followed.
    let followed = window(2.min(s.stabilise.frames as usize));
    let levels = s.wavelet.levels as usize;
    // Surface and normal; motion both ways, in mirrors too; what these show.
    let (surface, motion, seen) = (2 * FOUR, 32, 16);
    let guides = 4 * FOUR;
    // Of all lights: those that mirrors show none of read half of the guides.
    let guides_of_all = (planes - MATTE) * guides + MATTE * guides / 2;
    // Numbers of cells of levels with such sides.
    let cells =
        |sides: &[usize], buffers: usize| sides.iter().map(|side| buffers * FOUR / (side * side)).sum::<usize>();
    let (of_lights, of_picture) = ([4, 2, 2].as_slice(), [4, 2].as_slice());
    Some(match pass {
        "feature_noise" => surface + seen + guides,
        "gather" => around * (groups * (surface + motion + seen) + 12 * planes) + planes * FOUR + groups * (FOUR + 8),
        "variance" => guides_of_all + planes * 3 * FOUR,
        "wavelet_compare" => levels * (guides_of_all + planes * 2 * FOUR),
        "wavelet" => levels * (guides_of_all + planes * 3 * FOUR),
        "residual_cells" => planes * (3 * (8 + FOUR) + cells(of_lights, 3)) + 2 * 2 * FOUR + cells(of_picture, 3),
        "residual_changes" => planes * cells(of_lights, 4) + cells(of_picture, 4),
        "residual_certainty" => cells(&[4], 5),
        "residual_around" => cells(&[4], 3),
        "residual_apply" => planes * (3 * (8 + 2 * FOUR) + cells(of_lights, 1)) + 2 * 3 * FOUR + cells(of_picture, 1),
        "signature" => FOUR + seen + 32,
        "follow" => followed * (surface + motion + 2 * FOUR) + 2 * FOUR,
        "brightness" => (FOUR + 4) + (2 * FOUR + 4),
        "stabilise" => steady * (FOUR + motion + 2 * FOUR + 32) + 4 * FOUR + 4,
        "blend_read" => surface + seen + 2 * FOUR + 3 * FOUR + 4 + FOUR + 4 * FOUR,
        "blend_net_full" => 8 * FOUR,
        "blend_net_half" => 4 * FOUR + 8 * FOUR / 4,
        "blend_net_quarter" => 8 * FOUR / 4 + 8 * FOUR / 16,
        "blend_net_deep" => 2 * 8 * FOUR / 16,
        "blend_net_up" => 2 * 8 * FOUR / 4 + 8 * FOUR / 16,
        "blend_outputs" => 8 * FOUR + 8 * FOUR / 4,
        "blend_mix" => 7 * FOUR,
        "blend_change" => 5 * FOUR,
        "blend_gain" => 4 * FOUR,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pass that a device may run has its bytes.
    #[cfg(feature = "gpu")]
    #[test]
    fn every_pass_is_counted() {
        let s = SequenceSettings::default();
        let passes =
            quell::gpu::Pass::SEQUENCE.into_iter().chain(quell::gpu::Pass::RESIDUAL).chain(quell::gpu::Pass::FINISH);
        for pass in passes.filter(|pass| pass.name != "residual_apply_joint") {
            assert!(bytes_per_pixel(pass.name, &s).is_some(), "{}", pass.name);
        }
    }
}
