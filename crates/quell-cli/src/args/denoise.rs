//! What `quell denoise` takes.

use super::ranges::Frames;
use clap::Args;
use std::path::PathBuf;
use std::str::FromStr;

/// Remove the noise from an EXR sequence of Blender, Arnold, RenderMan, V-Ray, pbrt, Mitsuba or any other renderer
#[derive(Debug, Args)]
#[command(
    before_help = "Example: quell denoise shot.####.exr -o clean/",
    after_help = "\
INPUT
  Files, folders, shot.####.exr, shot.%04d.exr or globs; one file a frame, or one a pass
  (shot.albedo.0001.exr). Frames before and after those that are written are read as needed, so a
  job may be split in any way, to the same bits.

OUTPUT
  A folder, in which files keep their names, or a pattern: clean/shot_clean.####.exr. Inputs are
  never replaced, files of other programs only with --overwrite. Same parts, channels, types and
  attributes as the input; passes that hold no light are copied.

EXIT STATUS
  0 all frames written, 1 failed, 2 usage, 3 some frames failed and the others are written,
  130 interrupted (files that were written are whole; the same command with --resume goes on)."
)]
pub struct DenoiseArgs {
    /// EXR files, folders, patterns with #### or %04d, or globs
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    pub inputs: Vec<PathBuf>,
    /// Folder to write to, or a pattern such as clean/shot.####.exr
    #[arg(short, long, value_name = "DIR or PATTERN")]
    pub output: PathBuf,
    /// Frames to write, such as 1001-1100, 1-99x2, 1,4,7-9 or -10--1 [default: all]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// The whole shot: a frame of it that is missing or cannot be read is an error, not a warning
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub shot: Option<Frames>,
    /// First frames of new shots [default: found from the pictures, and printed]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub cuts: Option<Cuts>,
    /// all, beauty (light passes go through as they are and do not add up to it), or a list of roles or pass names such as
    /// diffuse_indirect,glossy_indirect: the others go through as they are, and the beauty is the sum of what is written
    #[arg(long, value_name = "all|beauty|LIST", default_value = "all")]
    pub passes: Passes,
    /// Only this view layer [default: every one, each from its own guides]
    #[arg(long, value_name = "NAME")]
    pub view_layer: Option<String>,
    /// Only this stereo view [default: all]
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Say what a channel is, where its name does not, such as albedo=tex_color; repeatable
    #[arg(long, value_name = "ROLE=CHANNEL")]
    pub map: Vec<String>,
    /// A TOML file with further names of passes [also: the environment variable QUELL_ALIASES]
    #[arg(long, value_name = "FILE.toml")]
    pub aliases: Option<PathBuf>,
    /// What motion vectors mean: auto (every reading is tried on two frames), none, or a convention's name [default: the
    /// renderer's where it is known, else auto]
    #[arg(long, value_name = "auto|PRESET|none")]
    pub motion: Option<String>,
    /// both (frames before and after are used) or past
    #[arg(long, value_name = "both|past", default_value = "both")]
    pub history: History,
    /// How much noise is removed: 0 gives the input, 1 what the filter makes, more than 1 a smoother picture [default: 1]
    #[arg(long, value_name = "0..4")]
    pub strength: Option<f32>,
    /// Also write the expected error that remains, as a pass quell.noise (one channel Y)
    #[arg(long)]
    pub noise_pass: bool,
    /// Skip frames whose file exists
    #[arg(long, conflicts_with_all = ["resume", "overwrite"])]
    pub skip_existing: bool,
    /// Skip frames that quell wrote with the same settings
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Also replace files that quell did not write
    #[arg(long)]
    pub overwrite: bool,
    /// Most memory to use, such as 8G or 500M: where the job would take more, the picture is filtered in bands of rows, to
    /// the same bits, with temporary files beside the output [default: what the system has free]
    #[arg(long, value_name = "SIZE")]
    pub max_memory: Option<Bytes>,
    /// Say what would be done: frames, what each channel is taken for, memory; write nothing
    #[arg(long)]
    pub dry_run: bool,
}

/// First frames of shots; `none` for no cut at all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cuts(pub Vec<i64>);

impl FromStr for Cuts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self(Vec::new()));
        }
        text.parse::<Frames>().map(|frames| Self(frames.numbers().to_vec())).map_err(|e| format!("{e}; or `none`"))
    }
}

/// Which passes are filtered and written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Passes {
    /// Every one.
    All,
    /// The beauty alone.
    Beauty,
    /// Those that are named.
    List(Vec<String>),
}

impl FromStr for Passes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            "beauty" => Ok(Self::Beauty),
            _ if text.split(',').all(|name| !name.trim().is_empty()) => {
                Ok(Self::List(text.split(',').map(|name| name.trim().to_owned()).collect()))
            }
            _ => Err(format!("`{text}` is no choice of passes; there are all, beauty, or names with commas between")),
        }
    }
}

/// An amount of memory: `8G`, `500M`; 1024 bytes are a K.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bytes(pub u64);

impl FromStr for Bytes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no amount of memory; write 8G or 500M");
        let upper = text.trim().to_ascii_uppercase();
        let unit = upper.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let number: f64 = upper[..upper.len() - unit.len()].parse().map_err(|_| wrong())?;
        let factor = match unit.trim_end_matches("IB").trim_end_matches('B') {
            "" => 0,
            "K" => 10,
            "M" => 20,
            "G" => 30,
            "T" => 40,
            _ => return Err(wrong()),
        };
        let bytes = number * (1u64 << factor) as f64;
        if bytes >= 1.0 && bytes < u64::MAX as f64 { Ok(Self(bytes as u64)) } else { Err(wrong()) }
    }
}

/// Which frames a frame may learn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    Both,
    Past,
}

impl FromStr for History {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "both" => Ok(Self::Both),
            "past" => Ok(Self::Past),
            _ => Err(format!("`{text}` is no history; there are both, past")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists() {
        assert_eq!("1034,1070".parse(), Ok(Cuts(vec![1034, 1070])));
        assert_eq!("none".parse(), Ok(Cuts(Vec::new())));
        assert!("x".parse::<Cuts>().unwrap_err().contains("none"));
        assert!("a,,b".parse::<Passes>().unwrap_err().contains("beauty"));
        assert_eq!("beauty, DiffDir".parse(), Ok(Passes::List(vec!["beauty".to_owned(), "DiffDir".to_owned()])));
        assert_eq!("500M".parse(), Ok(Bytes(500 << 20)));
        assert_eq!("1.5GiB".parse(), Ok(Bytes(3 << 29)));
        for wrong in ["", "8X", "-1G", "G", "1e30T"] {
            assert!(wrong.parse::<Bytes>().unwrap_err().contains("8G"), "{wrong}");
        }
        assert!("future".parse::<History>().is_err());
    }
}
