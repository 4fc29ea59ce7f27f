//! "The GPU up to stage k, then the reference": where the two part company.

use super::agreement::{SEQUENCE, SIZE};
use super::device::{Gpu, gpu};
use super::sequence::{Uploaded, colours, exact};
use crate::suite::frames::{Noise, box_before_wall, moving, with_radius};
use quell::border::Sanitised;
use quell::gpu::{self, Slot, Storage};
use quell::history::Validity;
use quell::pipeline::{Image, Inputs, Plan, Stage, Step};
use quell::reference::{Given, Reference};
use quell::report::StageTimes;
use quell::{FrameBuf, Plane, Rgb, Settings};

/// How far the composite lies from the reference's where the GPU ran every stage up to this one: the share of values
/// beyond the bound of sequences.
pub type Departure = (Stage, f64);

/// Runs `frames` on both, then the last one once for every stage. `spoil` may change what the GPU made of a stage.
pub fn bisect(
    gpu: &Gpu,
    settings: &Settings,
    frames: &[FrameBuf],
    spoil: impl Fn(Stage, &mut Plane<Rgb>),
) -> Vec<Departure> {
    let last = frames.last().unwrap();
    let mut options = exact(settings);
    // Every stage its pass, and every image its texture.
    (options.fuse, options.share_planes) = (false, false);
    let mut denoiser = gpu::Denoiser::new(&gpu.device, last.size, &options).unwrap();
    let mut reference = Reference::new(last.size);
    let mut before = None;
    for (i, frame) in frames.iter().enumerate() {
        before = Some(reference.clone());
        run(&mut reference, settings, frame, i > 0, |_| None);
        let uploaded = Uploaded::new(gpu, frame, Storage::Float);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        denoiser.encode(&gpu.device, &mut encoder, &uploaded.frame()).unwrap();
        gpu.queue.submit([encoder.finish()]);
    }
    let plan = Plan::new(settings, Inputs::of(&last.frame(&[])));
    let wanted = reference.image(plan.picture_output).unwrap()[0].clone();
    let mut departures = Vec::new();
    for upto in 0..plan.steps.len() {
        let mut mixed = before.clone().unwrap();
        let done: Vec<Stage> = plan.steps[..=upto].iter().map(|s| s.stage).collect();
        run(&mut mixed, settings, last, frames.len() > 1, |step| {
            done.contains(&step.stage).then(|| {
                let mut given = made(gpu, &denoiser, &plan, step, last);
                spoil(step.stage, &mut given.output);
                given
            })
        });
        let found = &mixed.image(plan.picture_output).unwrap()[0];
        let mean =
            wanted.data().iter().flatten().map(|v| f64::from(v.abs())).sum::<f64>() / 3.0 / wanted.data().len() as f64;
        let apart = wanted.data().iter().flatten().zip(found.data().iter().flatten());
        let apart = apart.filter(|(p, q)| f64::from((*p - *q).abs()) > SEQUENCE.relative * (f64::from(p.abs()) + mean));
        let share = apart.count() as f64 / (3 * wanted.data().len()) as f64;
        println!("the GPU up to {:<20} {share:.5} of the composite departs", plan.steps[upto].stage.name());
        departures.push((plan.steps[upto].stage, share));
    }
    departures
}

fn run(
    reference: &mut Reference,
    settings: &Settings,
    frame: &FrameBuf,
    continues: bool,
    given: impl FnMut(&Step) -> Option<Given>,
) {
    let plan = Plan::new(settings, Inputs::of(&frame.frame(&[])));
    let valid = Validity { matte: continues, glossy: continues, direct: continues, picture: continues };
    let (mut sanitised, mut times) = (Sanitised::default(), StageTimes::default());
    let frame = frame.frame(&[]);
    reference.run_with(&frame, settings, &plan, valid, &mut sanitised, &mut times, given).unwrap();
}

/// What the GPU's last frame made of a stage.
fn made(gpu: &Gpu, denoiser: &gpu::Denoiser, plan: &Plan, step: &Step, frame: &FrameBuf) -> Given {
    // What is remembered lies in the history's plane.
    let slot = |image: Image| {
        Slot::Image(match image {
            image if plan.matte_feedback == Some(image) => Image::MatteHistory,
            image if plan.glossy_feedback == Some(image) => Image::GlossyHistory,
            Image::DirectAntialiased => Image::DirectHistory,
            image => image,
        })
    };
    let read = |slot: Slot| gpu.read(frame.size, &[denoiser.plane(slot).unwrap()]).remove(0);
    let output = read(slot(step.output));
    let length = match step.stage {
        Stage::MatteTemporal => Some(Slot::MatteLength),
        Stage::GlossyTemporal => Some(Slot::GlossyLength),
        _ => None,
    };
    let plane = |values: Vec<f32>| Plane::from_vec(frame.size, values).unwrap();
    Given {
        output: colours(frame.size, &output),
        floored: step
            .also_writes
            .contains(&Image::MatteFloored)
            .then(|| colours(frame.size, &read(slot(Image::MatteFloored)))),
        state: length
            .map(|slot| [plane(output.iter().skip(3).step_by(4).map(|a| a.abs()).collect()), plane(read(slot))]),
        fast: None,
    }
}

/// The first stage with which more than the bound's share departs.
fn culprit(departures: &[Departure]) -> Option<Stage> {
    departures.iter().find(|(_, share)| *share > SEQUENCE.flips).map(|(stage, _)| *stage)
}

#[test]
fn bisecting_names_the_stage_that_departs() {
    let Some(gpu) = gpu() else { return };
    let scene = box_before_wall(moving, Noise::Sparse(0.4));
    let settings = with_radius(Settings::default(), SIZE, 12.0);
    let frames: Vec<FrameBuf> = (0..3).map(|i| scene.frame(SIZE, i)).collect();
    assert_eq!(culprit(&bisect(gpu, &settings, &frames, |_, _| ())), None);
    for wrong in [Stage::MatteTemporal, Stage::Firefly, Stage::GlossyVertical] {
        let departures = bisect(gpu, &settings, &frames, |stage, plane| {
            if stage == wrong {
                plane.data_mut().iter_mut().flatten().for_each(|v| *v *= 1.05);
            }
        });
        assert_eq!(culprit(&departures), Some(wrong), "{departures:?}");
    }
}
