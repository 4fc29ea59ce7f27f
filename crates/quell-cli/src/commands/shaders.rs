//! `quell shaders`: the composed WGSL and its manifest.

use crate::args::ShadersArgs;
use crate::context::Context;
use crate::failure::Failure;

#[cfg(not(feature = "gpu"))]
pub fn run(_: &Context, _: ShadersArgs) -> Result<(), Failure> {
    Err(Failure::Usage("this program was built without its feature `gpu`, so it has no shaders".to_owned()))
}

#[cfg(feature = "gpu")]
pub fn run(context: &Context, args: ShadersArgs) -> Result<(), Failure> {
    use crate::{interrupt, output};
    use quell::gpu::{Contents, Convention, SignalContents, Storage};
    use quell_host::manifest::{Choice, File, files};
    use quell_lab::trial;
    use quell_trace::{Control, builtin};
    use serde_json::Map;

    let signal = |name: &str| {
        let there = args.signals.iter().any(|s| s == name);
        there.then_some(SignalContents { weight: true, direct: false })
    };
    let contents = Contents {
        matte: signal("matte"),
        glossy: signal("glossy"),
        jitter: !args.no_jitter,
        textures: args.guides == "textures",
        counts: args.count_repairs,
        ..Contents::USUAL
    };
    let convention = match args.convention.as_str() {
        "bevy" => Convention::BEVY,
        "upscaler" => Convention::UPSCALER,
        "ndc" => Convention::NDC,
        _ => Convention::QUELL,
    };
    let storage = if args.storage == "float" { Storage::Float } else { Storage::Half };
    let (settings, size, fuse) = (&context.settings, args.size, !args.unfused);
    let choice = Choice { settings, size, contents, convention, storage, fuse };
    if args.frames.is_some() && args.convention != "quell" {
        let message = "--frames come as quell means them: leave out --convention".to_owned();
        return Err(Failure::Usage(message));
    }
    let files = files(&choice)?;
    let scene = args.frames.map(|count| builtin(&args.scene).map(|scene| (scene, count))).transpose()?;
    output::check_folder(&args.output)?;
    let mut written = Vec::new();
    let mut write = |file: File| -> Result<(), Failure> {
        let path = args.output.join(&file.name);
        quell_frames::files::write_bytes(&path, &file.bytes)?;
        written.push(path.to_string_lossy().into_owned());
        Ok(())
    };
    files.into_iter().try_for_each(&mut write)?;
    if let Some((scene, count)) = scene {
        let control = Control { cancel: Some(interrupt::flag()), progress: None };
        trial::frames(&choice, &scene, count, &control, &mut write)?;
    }
    let text = written.join("\n");
    let mut further = Map::new();
    further.insert("files".to_owned(), written.into());
    context.finish(&context.report(), further, &text)
}
