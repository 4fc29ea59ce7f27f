//! What is dispatched for a frame and for a sample of a reference: one list, in the order of `tracer/unfiltered.rs`.

use super::layout::{self, Job};
use super::shader::{MAX_CHAIN, Variant};
use crate::integrator::Domain;
use crate::tracer::{Half, REFERENCE_DIRECT_SAMPLES, ReferenceKind, RenderOptions, SECOND_HALF_SEED};
use std::ops::Range;

/// Which kernel runs a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Primary,
    Direct,
    Paths,
    Accumulate,
}

pub(super) type Step = (Kernel, Job);

/// Both halves of a 64-bit number, low first.
pub(super) fn halves_of(n: u64) -> [u32; 2] {
    [n as u32, (n >> 32) as u32]
}

/// Any pixel, whatever its primary surface.
const ANY: u32 = layout::OCCUPIED | layout::ESCAPED;

/// The direct term of one sample: what `Tracer::unfiltered` adds up.
struct Unfiltered {
    variant: Variant,
    direct_samples: u32,
    pass: u32,
    /// Index of the sampler.
    sample: u32,
    seed: u64,
}

impl Unfiltered {
    fn job(&self) -> Job {
        Job {
            only: ANY,
            sample: self.sample,
            seed: halves_of(self.seed),
            pass: self.pass,
            direct_samples: self.direct_samples,
            ..Job::default()
        }
    }

    /// Paths of one kind from one slot.
    fn paths(&self, kind: u32, slot: u32, domain: u32) -> Step {
        let count = self.direct_samples.div_ceil(4).max(1);
        let first = self.pass.wrapping_mul(count);
        (Kernel::Paths, Job { kind, slot, domain, first, count, ..self.job() })
    }

    fn steps(&self) -> Vec<Step> {
        let v = self.variant;
        let behind_glass = Domain::BehindGlass as u32;
        let mut steps = vec![(Kernel::Direct, Job { flags: layout::IS_FIRST, ..self.job() })];
        if v.transmissive {
            steps.push(self.paths(layout::TRANSMISSION_PATH, 0, 0));
        }
        if v.looks_through {
            let (kernel, job) = self.paths(layout::GLOSSY_PATH, 0, behind_glass);
            steps.push((kernel, Job { only: layout::BEHIND_GLASS, ..job }));
        }
        if v.blends {
            for n in 0..MAX_CHAIN {
                let (slot, domain) = (v.veil_slot() + n, Domain::Veil as u32 + n);
                steps.push((Kernel::Direct, Job { slot, domain, ..self.job() }));
                // A veil's own light is not split.
                for kind in [layout::TRANSMISSION_PATH, layout::MATTE_PATH, layout::GLOSSY_PATH] {
                    steps.push(self.paths(kind, slot, domain));
                }
            }
            for n in 0..=MAX_CHAIN {
                steps.push(self.paths(layout::FULL_PATH, v.behind_slot() + n, Domain::BehindVeil as u32 + n));
            }
        }
        if v.looks_through {
            // Reflections of glass that no signal carries: all but the first, or all before a background.
            for n in 0..MAX_CHAIN {
                let (kernel, job) = self.paths(layout::GLOSSY_PATH, v.glass_slot() + n, behind_glass + 1 + n);
                steps.push((kernel, Job { only: if n == 0 { layout::ESCAPED } else { ANY }, ..job }));
            }
        }
        steps
    }
}

/// One of both signals: `count` paths from `first` on.
fn signal(kind: u32, first: u32, count: u32, seeds: [u64; 2], in_halves: bool) -> Step {
    let flags = layout::IS_SIGNAL | if in_halves { layout::IN_HALVES } else { 0 };
    let [seed, second_seed] = seeds.map(halves_of);
    (Kernel::Paths, Job { kind, only: ANY, first, count, flags, seed, second_seed, ..Job::default() })
}

/// A frame.
pub(super) fn frame_steps(options: &RenderOptions, variant: Variant) -> Vec<Step> {
    let &RenderOptions { samples, direct_samples, seed, .. } = options;
    let mut steps = vec![(Kernel::Primary, Job::default())];
    for kind in [layout::MATTE_PATH, layout::GLOSSY_PATH] {
        steps.push(signal(kind, 0, samples.max(1), [seed, seed ^ SECOND_HALF_SEED], options.separate_halves()));
    }
    steps.extend(Unfiltered { variant, direct_samples, pass: 0, sample: 0, seed }.steps());
    steps
}

/// Samples of one half of a reference.
pub(super) fn reference_steps(
    options: &RenderOptions,
    variant: Variant,
    kind: ReferenceKind,
    half: Half,
    samples: Range<u32>,
) -> Vec<Step> {
    let seed = options.seed ^ half.seed();
    let direct_samples = options.direct_samples.min(REFERENCE_DIRECT_SAMPLES);
    let mut steps = vec![(Kernel::Primary, Job::default())];
    let area = if options.jitter { layout::IN_AREA } else { 0 };
    for (count, sample) in (1..).zip(samples) {
        if options.jitter && kind == ReferenceKind::Factored {
            steps.push((Kernel::Primary, Job { flags: area, sample, seed: halves_of(seed), ..Job::default() }));
        }
        let done = match kind {
            ReferenceKind::FullIntegral => {
                let (kernel, job) = signal(layout::EYE_PATH, sample, 1, [seed; 2], false);
                steps.push((kernel, Job { flags: area, domain: Domain::Full as u32, ..job }));
                layout::EYE_PATH
            }
            ReferenceKind::Factored => {
                for kind in [layout::MATTE_PATH, layout::GLOSSY_PATH] {
                    steps.push(signal(kind, sample, 1, [seed; 2], false));
                }
                steps.extend(Unfiltered { variant, direct_samples, pass: sample, sample, seed }.steps());
                layout::MATTE_PATH
            }
        };
        steps.push((Kernel::Accumulate, Job { kind: done, count, ..Job::default() }));
    }
    steps
}

/// Bytes of a number in a plane.
const NUMBER: u32 = 4;
/// Planes of a colour.
const COLOUR: u32 = 3;
/// Planes of the guides, which the eye's ray fills: weights, normal, depth, roughness, motion, surface id.
const GUIDES: u32 = 2 * COLOUR + COLOUR + 1 + 1 + 2 + 1;
/// Planes that count rays.
const COUNTS: u32 = 2;

/// Bytes a pixel that a step reads and writes between the passes, at the least: where a surface is seen and nothing is in front of
/// it, each plane once. What a scene's buffers and textures give is not in it: how much of that comes from caches depends on the
/// scene.
pub(super) fn bytes_per_pixel((kernel, job): &Step, variant: Variant) -> u32 {
    let slot = layout::SLOT_BYTES as u32;
    let counted = 2 * COUNTS * NUMBER;
    let direct = COLOUR * NUMBER;
    match kernel {
        // Flags of further slots are cleared.
        Kernel::Primary => slot + (variant.slots() - 1) * NUMBER + (GUIDES + COUNTS) * NUMBER,
        Kernel::Paths if job.flags & layout::IS_SIGNAL != 0 => {
            let halves = if job.flags & layout::IN_HALVES != 0 { 2 * COLOUR } else { 0 };
            // Mean, hit distance, variance.
            slot + (COLOUR + 2 + halves) * NUMBER + counted
        }
        Kernel::Paths if job.slot == 0 && job.only == ANY => slot + 2 * direct + counted,
        // Flags of the first slot and of one that is empty.
        Kernel::Paths => 2 * NUMBER,
        Kernel::Direct if job.slot == 0 => slot + direct + counted,
        // Flags of a slot that is empty.
        Kernel::Direct => NUMBER,
        // Of references alone, which nobody counts.
        Kernel::Accumulate => 0,
    }
}

/// Of the passes from planes to textures: every plane that a denoiser reads, and `written` bytes a pixel of textures.
pub(super) const fn texture_bytes_per_pixel(written: u32) -> u32 {
    // Direct, matte and glossy light, guides, the glossy hit distance.
    (3 * COLOUR + GUIDES + 1) * NUMBER + written
}
