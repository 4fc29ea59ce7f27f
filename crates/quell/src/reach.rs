//! How far a stage looks: stages say it, pipelines add it up for bands, tiles and listings.

/// How far from a pixel a stage looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// Pixels to the left and right, and up and down, within the frame.
    pub pixels: [usize; 2],
    /// Frames before, and after where the filter knows them.
    pub frames: u32,
    /// Rows read around the place where motion leads in those frames.
    pub footprint: usize,
    /// It runs on whole pictures, before bands of rows are cut: no band needs rows for it.
    pub whole_picture: bool,
}

impl Reach {
    /// The pixel alone.
    pub const NONE: Self = Self { pixels: [0; 2], frames: 0, footprint: 0, whole_picture: false };

    /// As many pixels each way, within the frame.
    pub const fn around(pixels: usize) -> Self {
        Self { pixels: [pixels; 2], ..Self::NONE }
    }

    /// Rows, where motion leads up or down by at most `moved` rows a frame, and by at most `farthest` in all.
    pub(crate) fn rows(self, moved: f32, farthest: f32) -> usize {
        let led = (moved * self.frames as f32).min(farthest).ceil() as usize;
        self.pixels[1] + if self.frames > 0 { led + self.footprint } else { 0 }
    }
}

impl std::fmt::Display for Reach {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let counted = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        if self.whole_picture {
            return f.write_str("the whole picture");
        }
        let pixels = match self.pixels {
            [0, 0] => None,
            [x, y] if x == y => Some(counted(x, "pixel")),
            [x, y] => Some(format!("{x} x {y} pixels")),
        };
        let frames = (self.frames > 0).then(|| counted(self.frames as usize, "frame"));
        match (pixels, frames) {
            (None, None) => f.write_str("the pixel"),
            (Some(pixels), Some(frames)) => write!(f, "{pixels}, {frames}"),
            (one, other) => f.write_str(&one.or(other).unwrap_or_default()),
        }
    }
}

/// A line of a listing of stages: what one reads, writes, and how far it looks; `None`: it does not run.
pub(crate) fn listing(name: &str, step: Option<(String, String, Reach)>) -> String {
    match step {
        Some((reads, writes, reach)) => format!("{name:<25} {reads} -> {writes} (reach: {reach})"),
        None => format!("{name:<25} does not run"),
    }
}
