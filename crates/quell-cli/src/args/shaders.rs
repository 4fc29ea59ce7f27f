//! Options of `quell shaders`.

use super::values;
use clap::Args;
use quell::Size;
use std::path::PathBuf;

/// Write the GPU back end's shaders (WGSL) and a manifest of buffers, bindings and dispatches, for hosts in any language
#[derive(Debug, Args)]
#[command(before_help = "Example: quell shaders quell-shaders --size 1920x1080")]
pub struct ShadersArgs {
    /// Folder to write to
    #[arg(value_name = "DIR")]
    pub output: PathBuf,
    /// Extent that values in the manifest belong to: some settings are lengths in pixels, which grow with the height
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1920x1080", value_parser = values::size)]
    pub size: Size,
    /// How planes are stored: half or float
    #[arg(long, value_name = "NAME", default_value = "half", value_parser = ["half", "float"])]
    pub storage: String,
    /// One stage a pass
    #[arg(long)]
    pub unfused: bool,
    /// For frames without jitter: no temporal anti-aliasing
    #[arg(long)]
    pub no_jitter: bool,
    /// Signals of a frame: matte, glossy, or both
    #[arg(long, value_name = "LIST", default_value = "matte,glossy", value_delimiter = ',',
          value_parser = ["matte", "glossy"])]
    pub signals: Vec<String>,
    /// How guides come: as the host's own textures, which the first dispatch reads, or packed by the host
    #[arg(long, value_name = "NAME", default_value = "textures", value_parser = ["textures", "packed"])]
    pub guides: String,
    /// What those textures mean (units, signs, encodings): quell, bevy, upscaler or ndc; each can be changed in the manifest
    #[arg(long, value_name = "NAME", default_value = "quell", value_parser = ["quell", "bevy", "upscaler", "ndc"])]
    pub convention: String,
    /// Count what is repaired of colours, too: a dispatch of its own
    #[arg(long)]
    pub count_repairs: bool,
    /// Also write N frames to try a host with: what goes into its textures, and what must come out
    #[arg(long, value_name = "N", value_parser = values::at_least_one::<u32>)]
    pub frames: Option<u32>,
    /// Built-in scene of those frames
    #[arg(long, value_name = "NAME", default_value = "glossy-room", requires = "frames")]
    pub scene: String,
}
