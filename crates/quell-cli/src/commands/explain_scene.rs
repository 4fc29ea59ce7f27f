//! `quell explain SCENE`: what a scene holds, what of its file was left out, and why.

use crate::args::environment::EnvironmentArgs;
use crate::args::scene::SceneArgs;
use crate::context::Context;
use crate::environment;
use crate::failure::Failure;
use crate::scene::{self, Opened};
use crate::sequence::FIRST_FRAME;
use quell_trace::gltf::{LoadReport, Plays};
use quell_trace::{Scene, Tracer};
use serde_json::{Map, Value, json};
use std::fmt::Write;

pub fn run(context: &Context, source: &str, args: &SceneArgs, environment: &EnvironmentArgs) -> Result<(), Failure> {
    // Warnings stand in the text that is printed below: not twice.
    let silenced = context.silenced();
    let Opened { mut scene, report } = scene::open(&silenced, source, args)?;
    environment::surround(context, &mut scene, environment)?;
    scene::expose(&silenced, source, &mut scene, 1, None, FIRST_FRAME)?;
    let tracer = Tracer::new(&scene, FIRST_FRAME, 1)?;
    let counts = [
        ("meshes", scene.meshes.len()),
        ("meshes that deform", scene.meshes.iter().filter(|m| m.deform.is_some()).count()),
        ("instances", scene.instances.len()),
        ("materials", scene.surfaces.len()),
        ("images", scene.images.len()),
        ("triangles in the world", tracer.triangles()),
        ("lights (lamps of triangles that emit, and lights without extent)", tracer.lights()),
        ("cameras", scene.cameras.len()),
        ("frames", scene.frames),
    ];
    let stresses = quell_trace::builtin_scenes().iter().find(|s| s.name == source).map_or("", |s| s.stresses);
    let mut text = match &report {
        None => format!("{source}: {stresses}\n\n"),
        Some(report) => format!("{source}: {}\n\n", origin(report)),
    };
    for (what, count) in counts {
        let _ = writeln!(text, "{count:>9}  {what}");
    }
    let _ = writeln!(
        text,
        "{:>9}  exposure{}",
        scene.exposure,
        if report.is_some() { ", from the brightness of the first frame" } else { "" }
    );
    let mut further = Map::new();
    let counted: Map<String, Value> = counts.into_iter().map(|(what, n)| (what.to_owned(), n.into())).collect();
    further.insert("scene".to_owned(), json!({"name": source, "stresses": stresses, "exposure": scene.exposure}));
    further.insert("holds".to_owned(), counted.into());
    match &report {
        None => {
            further.insert("ignored".to_owned(), Value::Array(Vec::new()));
            text.push_str("\nNothing was ignored: built-in scenes are made by code.");
        }
        Some(report) => {
            file_text(&mut text, &scene, report);
            further.insert("file".to_owned(), file_json(report));
            let warning = |w: &quell_trace::gltf::Warning| json!({"place": w.place, "message": w.message});
            further.insert("ignored".to_owned(), report.ignored.iter().chain(&report.warnings).map(warning).collect());
        }
    }
    context.finish(&context.report(), further, &text)
}

fn origin(report: &LoadReport) -> String {
    let mut text = "glTF 2.0".to_owned();
    if let Some(generator) = &report.generator {
        let _ = write!(text, ", written by {generator}");
    }
    if let Some(copyright) = &report.copyright {
        let _ = write!(text, ", copyright: {copyright}");
    }
    text
}

fn file_text(text: &mut String, scene: &Scene, report: &LoadReport) {
    if report.scenes.len() > 1 {
        text.push_str("\nScenes (--scene)\n");
        for (number, name) in report.scenes.iter().enumerate() {
            let mark = if report.scene == Some(number) { "loaded" } else { "" };
            let _ = writeln!(text, "{:>9}  {name:<32} {mark}", number + 1);
        }
    }
    text.push_str("\nCameras (--camera)\n");
    for (number, camera) in report.cameras.iter().enumerate() {
        let kind = if camera.perspective { "perspective" } else { "orthographic" };
        let aspect = camera.aspect.map_or_else(String::new, |a| format!(", made for {a:.3} : 1"));
        let moves = if camera.moves { ", moves" } else { "" };
        let other = camera.other_name.as_ref().map_or_else(String::new, |n| format!(" ({n})"));
        let _ = writeln!(text, "{:>9}  {:<32} {kind}{aspect}{moves}", number + 1, format!("{}{other}", camera.name));
    }
    if report.cameras.is_empty() {
        text.push_str("        1  made here: frames the scene\n");
    }
    if !report.clips.is_empty() {
        text.push_str("\nClips (--clip)\n");
    }
    for (number, clip) in report.clips.iter().enumerate() {
        let plays = match &clip.plays {
            Plays::Yes => "plays".to_owned(),
            Plays::NotChosen => "was not chosen".to_owned(),
            Plays::Empty => "has no channel that can be played".to_owned(),
            Plays::SharesChannels(other) => format!("does not play: it drives what `{other}` drives"),
        };
        let _ = writeln!(
            text,
            "{:>9}  {:<32} {:.2} s, {} channels; {plays}",
            number + 1,
            clip.name,
            clip.seconds,
            clip.channels
        );
    }
    if !scene.lights.is_empty() || report.emitters > 0 {
        let _ = writeln!(
            text,
            "\nLight: {} without extent, {} instances whose surface emits",
            report.lights, report.emitters
        );
    }
    for note in &report.notes {
        let _ = writeln!(text, "\nNote: {note}");
    }
    if report.warnings.is_empty() && report.ignored.is_empty() {
        text.push_str("\nNothing was ignored.");
        return;
    }
    if !report.ignored.is_empty() {
        text.push_str("\nIgnored on purpose\n");
    }
    for ignored in &report.ignored {
        let _ = writeln!(text, "  {ignored}");
    }
    if !report.warnings.is_empty() {
        text.push_str("\nWarnings: left out or replaced\n");
    }
    for warning in &report.warnings {
        let _ = writeln!(text, "  {warning}");
    }
    if report.further_warnings > 0 {
        let _ = writeln!(text, "  and {} more", report.further_warnings);
    }
}

fn file_json(report: &LoadReport) -> Value {
    let camera = |c: &quell_trace::gltf::CameraInfo| json!({"name": c.name, "perspective": c.perspective, "aspect": c.aspect, "moves": c.moves});
    let clip = |c: &quell_trace::gltf::ClipInfo| json!({"name": c.name, "seconds": c.seconds, "channels": c.channels, "plays": c.plays == Plays::Yes});
    json!({
        "generator": report.generator,
        "copyright": report.copyright,
        "scenes": report.scenes,
        "scene": report.scene,
        "nodes": report.nodes,
        "materials": report.materials,
        "textures": report.textures,
        "images": report.images,
        "lights": report.lights,
        "emitters": report.emitters,
        "cameras": report.cameras.iter().map(camera).collect::<Vec<_>>(),
        "clips": report.clips.iter().map(clip).collect::<Vec<_>>(),
        "notes": report.notes,
        "further_warnings": report.further_warnings,
    })
}
