//! What is taken of a scene's file.

use clap::Args;

/// Which part of a glTF file is loaded, and how.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Options for glTF files")]
pub struct SceneArgs {
    /// Scene in the file, by name or number [default: the file's own]
    #[arg(long = "scene", id = "scene_in_file", value_name = "NAME")]
    pub name: Option<String>,
    /// Clip to play, by name or number, or none [default: all that do not drive what one before them drives]
    #[arg(long, value_name = "NAME")]
    pub clip: Option<String>,
    /// Frames a second of animation [default: 24]
    #[arg(long, value_name = "N", value_parser = super::values::positive)]
    pub fps: Option<f32>,
}
