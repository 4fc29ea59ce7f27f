//! What `quell doctor` takes.

use super::ranges::Frames;
use clap::Args;
use std::path::PathBuf;

/// Say what is wrong with an EXR sequence, and how to fix it, before hours of denoising
#[derive(Debug, Args)]
#[command(
    before_help = "Example: quell doctor shot.####.exr --html doctor.html",
    after_help = "\
WHAT IT LOOKS AT
  Names and headers of all frames; the pixels of a few neighbouring frames, spread over the
  sequence. Motion vectors (sign, axes, unit, direction, length, zero), jitter in feature buffers,
  normals, depth, albedo, lossy compression, seeds, splatted pixel filters, denoised input, NaN,
  fireflies, frames that are missing, duplicated or of another size, passes with other names.
  docs/doctor.md lists every check with its threshold.

SEVERITY
  fault    spoils the result: fix it, or name the option
  warning  the result is less good than it could be
  note     good to know; quell handles it

EXIT STATUS
  0 no fault, 1 failed, 2 usage, 4 a fault was found, 130 interrupted."
)]
pub struct DoctorArgs {
    /// EXR files, folders, patterns with #### or %04d, or globs
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    pub inputs: Vec<PathBuf>,
    /// Look at these frames only, such as 1001-1100, 1-99x2, 1,4,7-9 or -10--1 [default: all]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// Write a page with pictures: the neighbour brought to the current frame, motion as colour
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Findings of this check do not count for the exit status, such as motion.missing; repeatable
    #[arg(long, value_name = "CHECK")]
    pub ignore: Vec<String>,
    /// Only this view layer [default: every one]
    #[arg(long, value_name = "NAME")]
    pub view_layer: Option<String>,
    /// Only this stereo view [default: all]
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Say what a channel is, as for `quell denoise`; repeatable
    #[arg(long, value_name = "ROLE=CHANNEL")]
    pub map: Vec<String>,
    /// A TOML file with further names of passes [also: the environment variable QUELL_ALIASES]
    #[arg(long, value_name = "FILE.toml")]
    pub aliases: Option<PathBuf>,
    /// What motion vectors are taken for, as for `quell denoise`
    #[arg(long, value_name = "auto|PRESET|none")]
    pub motion: Option<String>,
}
