//! What the user typed. Nothing here has a side effect; what the program runs on is made from it in `context.rs` and by
//! each command.

pub mod compare;
pub mod denoise;
pub mod doctor;
pub mod environment;
pub mod ranges;
pub mod scene;
pub mod shaders;
pub mod values;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
pub use compare::CompareArgs;
pub use denoise::DenoiseArgs;
pub use doctor::DoctorArgs;
use quell::Size;
use quell_trace::{Estimator, PrimaryReplacement};
use ranges::Frames;
use scene::SceneArgs;
pub use shaders::ShadersArgs;
use std::ffi::OsString;
use std::path::PathBuf;
use values::{BackendChoice, Setting};

/// Where `demo` writes by default.
pub const DEMO_FOLDER: &str = "quell-demo";

/// The whole command line.
#[derive(Debug, Parser)]
#[command(
    name = "quell",
    about = "Removes the noise from path-traced animations (Mara et al. 2017)",
    before_help = "Example: quell demo",
    disable_version_flag = true,
    disable_help_subcommand = true,
    max_term_width = 120
)]
pub struct Cli {
    #[command(flatten)]
    pub common: Common,
    /// Print the version; with -v also instruction set, features and adapters
    #[arg(short = 'V', long)]
    pub version: bool,
    /// Print the completions for a shell
    #[arg(long, value_name = "SHELL")]
    pub completions: Option<Shell>,
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// Options that every command takes.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Say more
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Say nothing but results and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Results as JSON on standard output
    #[arg(long, global = true)]
    pub json: bool,
    /// Write the results as JSON to a file
    #[arg(long, global = true, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Threads to use [default: all]
    #[arg(long, global = true, value_name = "N", value_parser = values::at_least_one::<u16>)]
    pub threads: Option<u16>,
    /// Implementation of the stages: cpu, gpu, reference, or auto: a GPU where there is one, but the CPU for denoise, so that every machine gives the same bits [default: auto; compare and reproduce: cpu]
    #[arg(long, global = true, value_name = "NAME")]
    pub backend: Option<BackendChoice>,
    /// GPU to use, by part of its name; `quell --version -v` lists them. A software device (llvmpipe) is used only if it is named
    #[arg(long, global = true, value_name = "NAME")]
    pub device: Option<String>,
    /// What traces scenes for render, demo, compare, reproduce and bench, cpu or gpu [default: gpu with --backend gpu on a real GPU, else cpu]
    #[arg(long, global = true, value_name = "NAME", value_parser = values::tracer)]
    pub tracer: Option<values::TracerChoice>,
    /// Named values of all parameters. Real-time filter: quality (the default; of reproduce: paper), paper (as published in 2017). Sequence filter (denoise, bench --sequence): sequence (the default), sequence-short
    #[arg(long, global = true, value_name = "NAME")]
    pub preset: Option<String>,
    /// Set one parameter; repeatable; `quell explain` lists them
    #[arg(long, global = true, value_name = "STAGE.PARAMETER=VALUE")]
    pub set: Vec<Setting>,
    /// Take parameters from a TOML file; --set comes after it
    #[arg(long, global = true, value_name = "FILE.toml")]
    pub settings: Option<PathBuf>,
    /// The command line as it was typed
    #[arg(skip)]
    pub arguments: Vec<OsString>,
    /// The file that holds the program
    #[arg(skip)]
    pub program: PathBuf,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Demo(DemoArgs),
    Render(RenderArgs),
    Denoise(DenoiseArgs),
    Doctor(DoctorArgs),
    Compare(CompareArgs),
    Scenes(ScenesArgs),
    Score(ScoreArgs),
    Bench(BenchArgs),
    Reproduce(ReproduceArgs),
    Explain(ExplainArgs),
    Shaders(ShadersArgs),
}

/// Render, denoise and show a built-in scene: pictures, a page, a table
#[derive(Debug, Args)]
#[command(before_help = "Example: quell demo -o quell-demo")]
pub struct DemoArgs {
    /// Folder to write to
    #[arg(short, long, value_name = "DIR", default_value = DEMO_FOLDER)]
    pub output: PathBuf,
    /// Extent of the pictures; the reference frames that come with quell fit the default only
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "480x270", value_parser = values::size)]
    pub size: Size,
    /// Frames to render
    #[arg(long, value_name = "N", default_value = "24", value_parser = values::at_least_one::<u32>)]
    pub count: u32,
    /// Also write every frame with all its planes as EXR
    #[arg(long)]
    pub exr: bool,
    /// For maintainers: make the reference frames that come with quell anew, in this folder
    #[arg(long, value_name = "DIR", hide = true)]
    pub make_references: Option<PathBuf>,
    /// For maintainers: samples a pixel of those
    #[arg(long, value_name = "SPP", hide = true, default_value = "2048", value_parser = values::at_least_one::<u32>)]
    pub reference_spp: u32,
}

/// Path trace a scene to factored EXR frames and denoise them
#[derive(Debug, Args)]
#[command(before_help = "Example: quell render glossy-room -o frames --size 640x360 --count 24 --reference 256")]
pub struct RenderArgs {
    /// glTF file (.glb, .gltf), or built-in scene; `quell scenes` lists them
    #[arg(value_name = "SCENE")]
    pub source: String,
    /// Folder to write to
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Extent of the pictures
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "480x270", value_parser = values::size)]
    pub size: Size,
    /// Frames to render, such as 0-23, 0-63x4, 1,4,7-9 or -10--1 [default: the scene's own]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true, conflicts_with = "count")]
    pub frames: Option<Frames>,
    /// Frames to render, from the scene's first
    #[arg(long, value_name = "N", value_parser = values::at_least_one::<u32>)]
    pub count: Option<u32>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub environment: environment::EnvironmentArgs,
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// Do not denoise
    #[arg(long)]
    pub no_denoise: bool,
    /// Converged frames as well, from SPP samples a pixel in two halves [default SPP: 256]
    #[arg(long, value_name = "SPP", num_args = 0..=1, default_missing_value = "256",
          value_parser = values::at_least_one::<u32>)]
    pub reference: Option<u32>,
    /// Make references of these frames only
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub reference_frames: Option<Frames>,
    /// Stop a reference early where its own trimmed relMSE, known from its halves, is this small
    #[arg(long, value_name = "RELMSE", value_parser = values::positive)]
    pub reference_error: Option<f32>,
    /// Brightness of pictures [default: the scene's own, of a file by how bright it is]
    #[arg(long, value_name = "FACTOR", value_parser = values::positive)]
    pub exposure: Option<f32>,
    /// Store colours as half float: files are less than half as large
    #[arg(long)]
    pub half: bool,
    /// Also replace EXR files that quell did not write
    #[arg(long)]
    pub overwrite: bool,
}

/// How light is sampled.
#[derive(Debug, Args)]
pub struct SamplingArgs {
    /// Number of the camera, from 1, or its name; or orbit, dolly, still: a path for the first
    #[arg(long, value_name = "NAME", default_value = "1")]
    pub camera: String,
    /// exact (converges to the full integral) or paper (as published)
    #[arg(long, value_name = "NAME", default_value = "exact", value_parser = values::estimator)]
    pub estimator: Estimator,
    /// Samples a pixel; each is one matte and one glossy path. From 2 on, frames hold two halves and variances too
    #[arg(long, value_name = "N", default_value = "1", value_parser = values::at_least_one::<u32>)]
    pub spp: u32,
    /// Scatterings of a path after the surface that is seen
    #[arg(long, value_name = "N", default_value = "3")]
    pub bounces: u32,
    /// Other seeds, other noise
    #[arg(long, value_name = "N", default_value = "0")]
    pub seed: u64,
    /// Shadow rays a pixel of the direct light [default: the tracer's own]
    #[arg(long, value_name = "N", value_parser = values::at_least_one::<u32>)]
    pub direct_samples: Option<u32>,
    /// Move the samples within the pixel from frame to frame: pictures are then anti-aliased over time
    #[arg(long)]
    pub jitter: bool,
    /// Primary surface replacement: feature buffers, motion and both signals are those of the surface that is seen in perfect mirrors
    /// and through smooth glass (mirrors), through smooth glass only (glass), or of the first surface always (off)
    #[arg(long, value_name = "NAME", default_value = "mirrors", value_parser = values::primary_replacement)]
    pub replacement: PrimaryReplacement,
    /// Largest luminance of a sample, 0: no limit; loses energy
    #[arg(long, value_name = "LUMINANCE", default_value = "0")]
    pub indirect_clamp: f32,
}

/// List the built-in scenes and what they stress
#[derive(Debug, Args)]
#[command(before_help = "Example: quell scenes")]
pub struct ScenesArgs {}

/// Score frames of any origin against references: picture metrics, and the scorecard of artefacts
#[derive(Debug, Args)]
#[command(before_help = "Example: quell score frames/denoised --reference frames/reference --guides frames/noisy")]
pub struct ScoreArgs {
    /// Folder of the frames to be scored, EXR as quell writes it; or the folder above its `denoised`
    #[arg(value_name = "DIR")]
    pub results: PathBuf,
    /// Folder of the converged frames, with their halves where there are any; or the folder above its `reference`
    #[arg(long, value_name = "DIR")]
    pub reference: PathBuf,
    /// Folder of frames with guides (depth, normals, motion, ids), or the folder above its `noisy` [default: the references]
    #[arg(long, value_name = "DIR")]
    pub guides: Option<PathBuf>,
    /// Score these frames only
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// Frames that serve as the past of the others only [default: 16, or a third of fewer than 24]
    #[arg(long, value_name = "N")]
    pub warm_up: Option<u32>,
    /// What the table calls the result [default: its folder]
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
}

/// Measure the time of each stage beside the paper's table; with --scene also the rays a second
#[derive(Debug, Args)]
#[command(before_help = "Example: quell bench --backend gpu --size 1280x720,1920x1080,3840x2160,5120x2880 --json")]
pub struct BenchArgs {
    /// Trace this glTF file or built-in scene; where a GPU traces (--tracer), the whole frame against a budget of 16.6 ms [default:
    /// synthetic frames]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<String>,
    #[command(flatten)]
    pub environment: environment::EnvironmentArgs,
    /// Extents to measure
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x720", value_delimiter = ',',
          value_parser = values::size)]
    pub size: Vec<Size>,
    /// Frames to measure, after 1 frame of warm-up (8 on a GPU); fewer where they take longer than a minute
    #[arg(long, value_name = "N", default_value = "10", value_parser = values::at_least_one::<u32>)]
    pub count: u32,
    /// Frames whose samples move within the pixel, which are anti-aliased over time
    #[arg(long, conflicts_with_all = ["scene", "sequence"])]
    pub jitter: bool,
    /// What the memory moves, for the floors [default: what copying reaches]
    #[arg(long, value_name = "GB/s", value_parser = values::positive)]
    pub bandwidth: Option<f32>,
    /// Measure the filter of `denoise` instead, on frames with Cycles' passes made in memory
    #[arg(long, conflicts_with = "scene")]
    pub sequence: bool,
    /// With --sequence: another denoiser on the same frames in turn, and what each takes (oidn: Open Image Denoise 2, loaded from $QUELL_OIDN)
    #[arg(long, value_name = "DENOISER", requires = "sequence")]
    pub against: Option<Rival>,
}

/// Denoisers that `bench --sequence` measures beside quell's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Rival {
    Oidn,
}

/// Reproduce the talk's tables and figures: stage times, the offline table, the ablations, more paths
#[derive(Debug, Args)]
#[command(before_help = "Example: quell reproduce -o quell-paper")]
pub struct ReproduceArgs {
    /// Folder to write to; an interrupted run goes on from what lies there
    #[arg(short, long, value_name = "DIR", default_value = "quell-paper")]
    pub output: PathBuf,
    /// Parts to make: stages, offline, ablations, paths [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub only: Vec<ReproducePart>,
    /// Extent of the sequences
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "240x135", value_parser = values::size)]
    pub size: Size,
    /// Extent of the offline table's frames, up to the talk's 5120x2880 [default: as --size]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = values::size)]
    pub offline_size: Option<Size>,
    /// Extent for the table of stage times
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x720", value_parser = values::size)]
    pub stages_size: Size,
    /// Frames of the sequences
    #[arg(long, value_name = "N", default_value = "48", value_parser = values::at_least_one::<u32>)]
    pub count: u32,
    /// Folder with the talk's scenes as cornell_box.glb, sponza_glossy.glb, bathroom_salle_de_bain.glb, white_room.glb and
    /// modern_hall.glb (for the Horse Room), instead of built-in stand-ins; ablations, which need motion, keep those
    #[arg(long, value_name = "DIR")]
    pub scenes: Option<PathBuf>,
    /// Camera of every scene, from 1; settings were fitted on 1 to 3 of the built-in ones [default: 4; of files 1]
    #[arg(long, value_name = "N")]
    pub camera: Option<usize>,
    /// Seed of the noisy frames
    #[arg(long, value_name = "N", default_value = "7")]
    pub seed: u64,
    /// Samples a pixel of references, both halves together; 0: no references and no figures of quality
    #[arg(long, value_name = "N", default_value = "256")]
    pub reference_spp: u32,
}

/// A part of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ReproducePart {
    Stages,
    Offline,
    Ablations,
    Paths,
}

/// Print the pipeline of a preset (quality, paper, sequence, sequence-short) as it will run, with every parameter; or what a scene holds
#[derive(Debug, Args)]
#[command(before_help = "Example: quell explain --set firefly.enabled=off")]
pub struct ExplainArgs {
    /// glTF file or built-in scene [default: the pipeline]
    #[arg(value_name = "SCENE", id = "source")]
    pub source: Option<String>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub environment: environment::EnvironmentArgs,
    /// The parameters as docs/parameters.md holds them
    #[arg(long, conflicts_with = "source")]
    pub markdown: bool,
}

impl ExplainArgs {
    /// True where the pipeline is asked for: neither a scene nor the page of parameters.
    pub fn is_of_the_pipeline(&self) -> bool {
        self.source.is_none() && !self.markdown && self.environment.environment.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definitions_are_sound_and_every_command_has_an_example() {
        Cli::command().debug_assert();
        for command in Cli::command().get_subcommands() {
            let example = command.get_before_help().map(ToString::to_string).unwrap_or_default();
            assert!(example.starts_with(&format!("Example: quell {}", command.get_name())), "{}", command.get_name());
            // The example itself is understood.
            let words = example.trim_start_matches("Example: ").split(' ');
            Cli::try_parse_from(words).unwrap_or_else(|e| panic!("{example}: {e}"));
            for argument in command.get_arguments().filter(|a| !a.is_hide_set()) {
                assert!(argument.get_help().is_some(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }

    #[test]
    fn negative_ranges_are_values_and_a_bare_reference_has_a_default() {
        let words = ["quell", "render", "x", "-o", "y", "--frames", "-10--1", "--reference", "--threads", "2"];
        let Some(Command::Render(args)) = Cli::try_parse_from(words).unwrap().command else { panic!() };
        assert_eq!(args.frames.unwrap().numbers().len(), 10);
        assert_eq!(args.reference, Some(256));
    }
}
