//! Traces a built-in scene, denoises it and makes a page to look at, all by the libraries:
//! `cargo run --release -p quell-lab --example 01_trace_denoise_look -- [SCENE] [FOLDER] [FRAMES]`.
//!
//! The command `quell demo` does the same with settings, progress and messages.

use quell::{Denoiser, Frame, Preset, Settings, Size};
use quell_frames::{Content, FrameToWrite, Metadata, WriteOptions, frame_path, write_frame};
use quell_lab::metrics::{Exposures, FrameScores};
use quell_lab::references::{ReferenceOf, ReferenceTarget, converge};
use quell_lab::report::json::{MethodScores, NumberedScores, Spread, StageTime};
use quell_lab::report::player::{self, PlayerData, PlayerSequence};
use quell_lab::report::strip::{StripOptions, write_animation};
use quell_lab::report::table::{metrics_table, stage_table};
use quell_lab::tone::Tone;
use quell_trace::{Control, RenderOptions, Tracer, builtin};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = builtin(&arguments.next().unwrap_or("cornell-box".to_owned()))?;
    let folder = arguments.next().unwrap_or("quell-look".to_owned());
    let folder = Path::new(&folder);
    let frames: i64 = arguments.next().map_or(Ok(8), |n| n.parse())?;
    let size = Size::new(480, 270);
    let options = RenderOptions::new(size);

    // Trace, denoise, keep pictures and files.
    let mut denoiser = Denoiser::new(size, &Settings::preset(Preset::Quality))?;
    let (mut noisy, mut denoised, mut depths, mut stages) = (vec![], vec![], vec![], vec![]);
    for index in 0..frames {
        let traced = Tracer::new(&scene, index, 1)?.render(&options, &Control::default())?.frame;
        let output = denoiser.denoise(&traced.frame(&[]))?;
        let filtered = Frame {
            matte: output.matte.map(|p| p.view()),
            glossy: output.glossy.map(|p| p.view()),
            direct: Some(output.direct.view()),
            ..traced.frame(&[])
        };
        let file = FrameToWrite {
            composite: Some(output.composite.view()),
            confidence: Some(output.confidence.view()),
            history_length: Some(output.history_length.view()),
            metadata: Metadata {
                content: Content::Denoised,
                scene: scene.name.clone(),
                exposure: scene.exposure,
                ..Metadata::default()
            },
            ..FrameToWrite::new(filtered)
        };
        write_frame(&frame_path(folder, "denoised", index), &file, &WriteOptions::default())?;
        stages.push(output.report.times);
        noisy.push(traced.composite());
        denoised.push(output.composite.clone());
        depths.push(traced.view_depth.clone());
        eprintln!("frame {index}");
    }

    // One reference: of the last frame, which is the steadiest.
    let what = ReferenceOf { scene: &scene, camera: 1, frame: frames - 1, options: &options };
    let target = ReferenceTarget { samples: 48, ..ReferenceTarget::default() };
    let pair = converge(None, &what, &target, &Control::default(), |p| eprintln!("reference {}/{}", p.samples, p.of))?;
    let reference = pair.mean()?.beauty;
    let last = frames as usize - 1;
    let exposures = Exposures::from_reference([(&reference, depths[last].as_ref())])?;
    let tone = Tone::automatic([&reference]);

    let mut metrics = Vec::new();
    let mut sequences = Vec::new();
    for (name, description, pictures) in [
        ("noisy", "one matte and one glossy path a pixel", &noisy),
        ("denoised", "the same, filtered by preset `quality`", &denoised),
    ] {
        let (scores, flip) = FrameScores::measure(&pictures[last], &reference, tone, &exposures)?;
        let frames = vec![NumberedScores { frame: last as i64, scores }];
        metrics.push(MethodScores { method: name.to_owned(), mean: Some(scores), frames });
        let mut error_maps = vec![None; last];
        error_maps.push(Some(flip.map));
        sequences.push(PlayerSequence {
            name: name.to_owned(),
            description: description.to_owned(),
            pictures: pictures.iter().map(|p| Some(tone.picture(p))).collect(),
            error_maps,
        });
    }
    let mut pictures = vec![None; last];
    pictures.push(Some(tone.picture(&reference)));
    sequences.push(PlayerSequence {
        name: "reference".to_owned(),
        description: format!("{} paths of each kind a pixel", 2 * target.samples),
        pictures,
        error_maps: vec![],
    });
    let times = quell::pipeline::Stage::ALL.iter().filter_map(|&stage| {
        let milliseconds = stages.iter().filter_map(|t| t.get(stage)).map(|t| t.as_secs_f64() * 1e3);
        Some(StageTime {
            name: stage.name().to_owned(),
            paper_stage: stage.paper_stage().split(' ').next().and_then(|number| number.parse().ok()),
            milliseconds: Spread::of(milliseconds)?,
            bytes_per_pixel: None,
            floor_ms: None,
        })
    });
    let stages = stage_table(&times.collect::<Vec<_>>());
    println!("{}\n{stages}", metrics_table(&metrics));
    let strip = |i: usize| sequences[i].pictures.iter().flatten().cloned().collect::<Vec<_>>();
    let written =
        write_animation(&folder.join("strip.png"), &[&strip(0), &strip(1), &strip(2)], &StripOptions::default())?;
    println!("{written:?}");
    let data = PlayerData {
        title: scene.name.clone(),
        subtitle: format!("{size}, {frames} frames, 1 matte and 1 glossy path a pixel, preset quality"),
        frame_numbers: (0..frames).collect(),
        sequences,
        metrics: metrics_table(&metrics),
        stages,
        notes: vec![format!("Only frame {last} has a reference.")],
        command: std::env::args().collect::<Vec<_>>().join(" "),
        ..PlayerData::default()
    };
    println!("{:?}", player::write(&folder.join("index.html"), &data)?);
    Ok(())
}
