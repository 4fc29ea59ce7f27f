//! What `quell compare` takes.

use super::SamplingArgs;
use super::environment::EnvironmentArgs;
use super::ranges::Frames;
use super::scene::SceneArgs;
use super::values;
use clap::Args;
use quell::Size;
use std::path::PathBuf;
use std::str::FromStr;

/// Methods side by side on the same frames: metrics, artefacts, time, memory, and a page to look at
#[derive(Debug, Args)]
#[command(
    before_help = "Example: quell compare glossy-room -o comparison --methods none,quell:quality",
    after_help = "\
METHODS
  none, quell:quality, quell:paper, quell:sequence, and the baselines; an unknown name is answered
                                   with the nearest
  quell:paper+no-virtual           one of the talk's ablations
  quell:paper+firefly.enabled=off  any parameter
  svgf+taa                         a baseline behind quell's temporal anti-aliasing, for --jitter
  quell:sequence                   the filter of `quell denoise`, which sees frames before and after
  mine=DIR                         finished frames of your own: EXR files with R, G, B, the frame
                                   number last (any.0012.exr)
  mine='CMD {noisy} {out}'         a command, given alone in its own --methods: run once, timed;
                                   {noisy} becomes a folder with the same frames that all methods
                                   get (noisy.0012.exr, every plane), {out} an empty folder for its
                                   results

Interrupted, the same command goes on where it stopped."
)]
pub struct CompareArgs {
    /// glTF file, built-in scene, or a folder with frames and references that quell wrote
    pub source: String,
    /// Folder to write to
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What is compared, divided by commas; repeatable [default: what runs on these frames]
    #[arg(long, value_name = "LIST")]
    pub methods: Vec<String>,
    /// Extent of the pictures [default: 320x180]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = values::size)]
    pub size: Option<Size>,
    /// Frames, such as 0-63 [default: the scene's own, all of the folder's]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true, conflicts_with = "count")]
    pub frames: Option<Frames>,
    /// Frames, from the first
    #[arg(long, value_name = "N", value_parser = values::at_least_one::<u32>)]
    pub count: Option<u32>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub environment: EnvironmentArgs,
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// Repeat with so many seeds, from --seed on: means with 95 % intervals
    #[arg(long, value_name = "N", default_value = "1", value_parser = values::at_least_one::<u16>)]
    pub seeds: u16,
    /// Samples a pixel of references, both halves together
    #[arg(long, value_name = "N", default_value = "64", value_parser = values::at_least_one::<u32>)]
    pub reference_spp: u32,
    /// Frames with references; those with 8 such before them are scored [default: the last steady ones, 16 + 8]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub reference_frames: Option<Frames>,
    /// Where the references of a folder lie, if not in it
    #[arg(long, value_name = "DIR")]
    pub reference: Option<PathBuf>,
    /// Brightness of pictures [default: the scene's own, of a file by how bright it is]
    #[arg(long, value_name = "FACTOR", value_parser = values::positive)]
    pub exposure: Option<f32>,
    /// What is printed: text, csv, latex
    #[arg(long, value_name = "NAME", default_value = "text")]
    pub format: Format,
    /// Also write this part of every method's last scored frame, with its FLIP map, as PNG; repeatable
    #[arg(long, value_name = "X,Y,W,H", value_parser = crop)]
    pub crop: Vec<Crop>,
}

/// How the table is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Text,
    Csv,
    Latex,
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "text" => Ok(Self::Text),
            "csv" => Ok(Self::Csv),
            "latex" => Ok(Self::Latex),
            _ => Err(format!("unknown format `{text}`; there are text, csv, latex")),
        }
    }
}

/// A part of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    pub x: usize,
    pub y: usize,
    pub size: Size,
}

fn crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Crop { x, y, size: Size::new(width, height) }),
        _ => Err(format!("`{text}` is no part of a picture; write X,Y,WIDTH,HEIGHT, such as 100,40,64,64")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_and_formats() {
        assert_eq!(crop("1, 2,3,4"), Ok(Crop { x: 1, y: 2, size: Size::new(3, 4) }));
        for text in ["1,2,3", "1,2,0,4", "a,b,c,d", "-1,2,3,4", ""] {
            assert!(crop(text).unwrap_err().contains("X,Y,WIDTH,HEIGHT"), "{text}");
        }
        assert!("html".parse::<Format>().unwrap_err().contains("csv, latex"));
    }
}
