//! Light from all around, from a file.

use clap::Args;
use std::path::PathBuf;

/// Of each option, not of the struct: that would take the options after it, too.
const HEADING: &str = "Environment";

/// A picture that surrounds the scene.
#[derive(Debug, Default, Args)]
pub struct EnvironmentArgs {
    /// Latitude-longitude picture (.hdr, .exr) that surrounds and lights the scene, in place of its own environment
    #[arg(help_heading = HEADING, long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Turn it about the vertical, clockwise seen from above
    #[arg(help_heading = HEADING, long, value_name = "DEGREES", default_value = "0", allow_hyphen_values = true,
          requires = "environment")]
    pub environment_rotation: f32,
    /// Multiply it
    #[arg(help_heading = HEADING, long, value_name = "FACTOR", default_value = "1", requires = "environment",
          value_parser = super::values::positive)]
    pub environment_strength: f32,
}
