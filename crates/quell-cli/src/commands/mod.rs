//! The commands, one file each, and what `quell` does without one.

mod bench;
mod compare;
mod demo;
mod denoise;
pub mod doctor;
mod explain;
mod explain_scene;
mod render;
mod reproduce;
mod scenes;
mod score;
mod shaders;

use crate::args::{Cli, Command};
use crate::backend::adapters;
use crate::context::{Context, instruction_set};
use crate::failure::Failure;
use crate::{allocator, interrupt, output};
use clap::CommandFactory;
use quell::Preset;

/// Five lines that start a newcomer.
const WELCOME: &str = "\
quell removes the noise from path-traced animations.
  quell demo                        see it: pictures, a page to open, a table of scores (about a minute)
  quell scenes                      what else there is to render: quell render SCENE -o DIR
  quell denoise shot.####.exr -o clean/   your own frames: EXR sequences of Blender and other renderers
  quell --help                      all commands; each has a --help of its own that begins with an example";

/// Does what the user typed.
pub fn run(cli: Cli) -> Result<(), Failure> {
    if let Some(shell) = cli.completions {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut Cli::command(), "quell", &mut script);
        return output::print(&String::from_utf8_lossy(&script));
    }
    if cli.version {
        return output::print(&version(cli.common.verbose));
    }
    let Some(command) = cli.command else { return output::print(WELCOME) };
    // Frame after frame of one size.
    if matches!(command, Command::Denoise(_) | Command::Bench(_)) {
        allocator::keep_for_reuse();
    }
    let in_threads = || {
        let command = match command {
            Command::Denoise(args) => {
                let (context, settings) = Context::for_sequences(&cli.common)?;
                interrupt::install()?;
                return denoise::run(&context, settings, args);
            }
            Command::Explain(args) if args.is_of_the_pipeline() && Context::asks_for_sequences(&cli.common)? => {
                let (context, settings) = Context::for_sequences(&cli.common)?;
                return explain::sequence(&context, &settings);
            }
            Command::Bench(args) if args.sequence => {
                let (context, settings) = Context::for_sequences(&cli.common)?;
                interrupt::install()?;
                return bench::sequence::run(&context, &settings, &args);
            }
            other => other,
        };
        let preset = match command {
            // It makes the figures of the paper.
            Command::Reproduce(_) => Preset::Paper,
            _ => Preset::default(),
        };
        let context = Context::new(&cli.common, preset)?;
        interrupt::install()?;
        match command {
            // Handled above: its settings are others.
            Command::Denoise(_) => Ok(()),
            Command::Demo(args) => demo::run(&context, args),
            Command::Doctor(args) => doctor::run(&context, args),
            Command::Render(args) => render::run(&context, args),
            Command::Compare(args) => compare::run(&context, args),
            Command::Scenes(_) => scenes::run(&context),
            Command::Score(args) => score::run(&context, args),
            Command::Bench(args) => bench::run(&context, args),
            Command::Reproduce(args) => reproduce::run(&context, args),
            Command::Explain(args) => explain::run(&context, args),
            Command::Shaders(args) => shaders::run(&context, args),
        }
    };
    match cli.common.threads {
        None => in_threads(),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build()
            .map_err(|e| Failure::Failed(format!("cannot start {threads} threads: {e}")))?
            .install(in_threads),
    }
}

fn version(verbose: bool) -> String {
    let mut text = format!("quell {}", env!("CARGO_PKG_VERSION"));
    if verbose {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let (backends, features) = if cfg!(feature = "gpu") {
            ("cpu, gpu, reference", "cpu, threads, gpu")
        } else {
            ("cpu, reference", "cpu, threads")
        };
        text.push_str(&format!(
            "\ninstruction set: {}\ncores: {cores}\nback ends: {backends}\nfeatures: {features}\nadapters:",
            instruction_set()
        ));
        let adapters = adapters();
        if adapters.is_empty() {
            text.push_str(" none");
        }
        adapters.iter().for_each(|adapter| text.push_str(&format!("\n  {adapter}")));
    }
    text
}
