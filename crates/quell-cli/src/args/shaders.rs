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
    /// For frames without jitter: stage 11 does not run
    #[arg(long)]
    pub no_jitter: bool,
    /// Signals of a frame: matte, glossy, or both
    #[arg(long, value_name = "LIST", default_value = "matte,glossy", value_delimiter = ',',
          value_parser = ["matte", "glossy"])]
    pub signals: Vec<String>,
}
