//! What is taken of a scene's file.

use clap::Args;

/// Of each option, not of the struct: that would take the options after it, too.
const HEADING: &str = "Options for glTF files";

/// Which part of a glTF file is loaded, and how.
#[derive(Debug, Default, Args)]
pub struct SceneArgs {
    /// Scene in the file, by name or number [default: the file's own]
    #[arg(help_heading = HEADING, long = "scene", id = "scene_in_file", value_name = "NAME")]
    pub name: Option<String>,
    /// Clip to play, by name or number, or none [default: all that do not drive what one before them drives]
    #[arg(help_heading = HEADING, long, value_name = "NAME")]
    pub clip: Option<String>,
    /// Frames a second of animation [default: 24]
    #[arg(help_heading = HEADING, long, value_name = "N", value_parser = super::values::positive)]
    pub fps: Option<f32>,
}
