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
    use crate::output;
    use quell::gpu::{Contents, Convention, SignalContents, Storage};
    use quell_lab::gpu::manifest::{Choice, files};
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
    let files = files(&choice)?;
    output::check_folder(&args.output)?;
    let mut written = Vec::new();
    for file in &files {
        let path = args.output.join(&file.name);
        quell_frames::files::write_bytes(&path, &file.bytes)?;
        written.push(path.to_string_lossy().into_owned());
    }
    let text = written.join("\n");
    let mut further = Map::new();
    further.insert("files".to_owned(), written.into());
    context.finish(&context.report(), further, &text)
}
