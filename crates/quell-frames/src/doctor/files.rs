//! What file names and headers show: frames that are missing, unreadable, of another size or layout, or twice there.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use crate::driver::ranges;
use crate::image::{ExrImage, Window};
use crate::sequence::{FrameSources, Sequence};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// What is kept of a frame's headers.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub number: i64,
    /// Why the headers cannot be read.
    pub error: Option<String>,
    pub display: Option<Window>,
    pub full: Option<Window>,
    /// Parts and channels, file by file.
    layout: Vec<String>,
    bytes: Vec<u64>,
}

/// Reads the headers of all frames.
pub(super) fn headers(sequence: &Sequence) -> Vec<Header> {
    sequence.frames.par_iter().map(header).collect()
}

fn header(frame: &FrameSources) -> Header {
    let bytes = frame.files.iter().map(|f| std::fs::metadata(&f.path).map_or(0, |m| m.len())).collect();
    let mut header = Header { number: frame.number, error: None, display: None, full: None, layout: Vec::new(), bytes };
    match frame.read_headers() {
        Ok(images) => {
            header.display = images.first().map(ExrImage::display_window);
            header.full = images.iter().map(ExrImage::full_window).reduce(Window::union);
            header.layout = layout(&images);
        }
        Err(error) => header.error = Some(error.to_string()),
    }
    header
}

/// One line a channel: two frames of one layout can be filtered together.
fn layout(images: &[ExrImage]) -> Vec<String> {
    let mut lines = Vec::new();
    for image in images {
        for (i, part) in image.parts().iter().enumerate() {
            lines.extend(part.channels().iter().map(|c| format!("{i} {}", c.name())));
        }
    }
    lines
}

impl Header {
    /// True where the frame can stand in one sequence with `first`.
    pub fn fits(&self, first: &Self) -> bool {
        self.error.is_none() && self.display == first.display && self.layout == first.layout
    }
}

/// A few numbers, not thousands.
pub(super) fn some(numbers: &[i64]) -> String {
    let text = ranges(numbers);
    if text.len() <= 60 { text } else { format!("{} .. ({} frames)", text.get(..50).unwrap_or(&text), numbers.len()) }
}

/// Judges names and headers. `first` is the first frame that can be read.
pub(super) fn judge(sequence: &Sequence, headers: &[Header], first: &Header, found: &mut Diagnosis) {
    let before = found.findings.len();
    let unreadable: Vec<&Header> = headers.iter().filter(|h| h.error.is_some()).collect();
    if let Some(one) = unreadable.first() {
        let numbers: Vec<i64> = unreadable.iter().map(|h| h.number).collect();
        found.findings.push(
            Finding::new("frames.unreadable", Severity::Fault, format!("frames {} cannot be read", some(&numbers)))
                .frame(one.number)
                .evidence(
                    one.error.clone().unwrap_or_default(),
                    vec![Figure::new("unreadable frames", unreadable.len() as f64, "frames")],
                )
                .cure(
                    "these frames are not written, and their neighbours lose what they would have given",
                    "render them again",
                ),
        );
    }
    gaps(sequence, found);
    for (number, pass) in sequence.incomplete.iter().take(3) {
        found.findings.push(
            Finding::new(
                "frames.incomplete",
                Severity::Fault,
                format!("frame {number} lacks its file of the pass `{pass}`"),
            )
            .frame(*number)
            .channel(pass.clone())
            .evidence(
                format!("{} frames lack a file that others have", sequence.incomplete.len()),
                vec![Figure::new("incomplete frames", sequence.incomplete.len() as f64, "frames")],
            )
            .cure("the frame is left out", "render the pass of this frame again"),
        );
    }
    let readable = || headers.iter().filter(|h| h.error.is_none());
    let others: Vec<&Header> = readable().filter(|h| h.display != first.display).collect();
    if let (Some(other), Some(here)) = (others.first(), first.display) {
        let there = other.display.unwrap_or(here);
        let numbers: Vec<i64> = others.iter().map(|h| h.number).collect();
        found.findings.push(
            Finding::new("frames.size", Severity::Fault, format!("frames {} are of another size", some(&numbers)))
                .frame(other.number)
                .evidence(
                    format!("frame {} shows {there}, frame {} {here}", other.number, first.number),
                    vec![
                        Figure::new("width", there.size.width as f64, "px"),
                        Figure::new("height", there.size.height as f64, "px"),
                        Figure::new("frames", others.len() as f64, "frames"),
                    ],
                )
                .cure(
                    "these frames fail, and their neighbours lose what they would have given",
                    "render them again in the size of the others, or denoise them as a sequence of their own",
                ),
        );
    }
    let others: Vec<&Header> = readable().filter(|h| h.display == first.display && h.layout != first.layout).collect();
    if let Some(other) = others.first() {
        let numbers: Vec<i64> = others.iter().map(|h| h.number).collect();
        let lacks = first.layout.iter().find(|line| !other.layout.contains(line));
        let more = other.layout.iter().find(|line| !first.layout.contains(line));
        let name = |line: Option<&String>| line.and_then(|l| l.split_once(' ')).map(|(_, name)| format!("`{name}`"));
        let evidence = match (name(lacks), name(more)) {
            (Some(lacks), Some(more)) => format!("frame {} lacks {lacks} and has {more}", other.number),
            (Some(lacks), None) => format!("frame {} lacks {lacks}", other.number),
            (None, Some(more)) => format!("frame {} has {more}, which frame {} lacks", other.number, first.number),
            (None, None) => format!("frame {} has its channels in another order", other.number),
        };
        found.findings.push(
            Finding::new(
                "frames.layout",
                Severity::Fault,
                format!("frames {} hold other channels than the first", some(&numbers)),
            )
            .frame(other.number)
            .channel(lacks.or(more).and_then(|l| l.split_once(' ')).map_or("", |(_, name)| name))
            .evidence(evidence, vec![Figure::new("frames", others.len() as f64, "frames")])
            .cure(
                "these frames fail: what steers the filter would be missing or another",
                "render them with the same passes, or denoise them as a sequence of their own",
            ),
        );
    }
    if found.findings.len() == before {
        found.pass("frames", format!("{} frames: no gap, one size, one set of channels", headers.len()));
    }
}

fn gaps(sequence: &Sequence, found: &mut Diagnosis) {
    let Some((from, _)) = sequence.gaps.first().copied() else { return };
    let missing: i64 = sequence.gaps.iter().map(|(a, b)| b.saturating_sub(*a).saturating_add(1)).sum();
    let figures = vec![Figure::new("missing frames", missing as f64, "frames")];
    // Every gap of one length, between all frames: a step.
    let numbers: Vec<i64> = sequence.frames.iter().map(|f| f.number).collect();
    let step = numbers.windows(2).map(|w| w[1].saturating_sub(w[0])).reduce(|a, b| if a == b { a } else { 0 });
    if let Some(step @ 2..) = step.filter(|_| numbers.len() > 2) {
        found.findings.push(
            Finding::new("frames.step", Severity::Fault, format!("only every {step}. frame is there"))
                .frame(from)
                .evidence(format!("frame numbers go up by {step} throughout ({})", some(&numbers)), figures)
                .cure(
                    "motion vectors span one frame, so no frame finds its neighbour: each is filtered by itself and flickers",
                    "render all frames; where the animation is on twos, denoise before frames are left out",
                ),
        );
        return;
    }
    let list: Vec<String> =
        sequence.gaps.iter().take(4).map(|(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") }).collect();
    let more =
        if sequence.gaps.len() > 4 { format!(" and {} more gaps", sequence.gaps.len() - 4) } else { String::new() };
    found.findings.push(
        Finding::new("frames.missing", Severity::Fault, format!("frames {}{more} are missing", list.join(", ")))
            .frame(from)
            .evidence(format!("{missing} of the numbers between the first and the last frame have no file"), figures)
            .cure(
                "the filter starts afresh behind each gap: the frames beside it are noisier",
                "render the missing frames; `quell denoise --shot RANGE` makes a gap an error",
            ),
    );
}

/// Pairs of neighbouring frames whose files are of one length and end alike: perhaps the same frame twice.
pub(super) fn candidates(sequence: &Sequence, headers: &[Header]) -> Vec<(i64, i64)> {
    let mut by_length: BTreeMap<&[u64], Vec<usize>> = BTreeMap::new();
    for (i, header) in headers.iter().enumerate().filter(|(_, h)| h.error.is_none()) {
        by_length.entry(&header.bytes).or_default().push(i);
    }
    let mut pairs = Vec::new();
    for group in by_length.values() {
        pairs.extend(group.windows(2).filter_map(|w| match w {
            [a, b] => Some((*a, *b)),
            _ => None,
        }));
    }
    // Files without compression are all of one length: reading their ends takes a moment, not minutes.
    pairs.truncate(4096);
    let alike = pairs.into_par_iter().filter(|(a, b)| {
        let (Some(a), Some(b)) = (sequence.frames.get(*a), sequence.frames.get(*b)) else { return false };
        a.files.iter().zip(&b.files).all(|(a, b)| ends_alike(&a.path, &b.path))
    });
    alike.filter_map(|(a, b)| Some((sequence.frames.get(a)?.number, sequence.frames.get(b)?.number))).collect()
}

fn ends_alike(a: &Path, b: &Path) -> bool {
    let end = |path: &Path| -> std::io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length - (length / 2).min(65_536)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    matches!((end(a), end(b)), (Ok(a), Ok(b)) if a == b)
}

/// Frames whose pictures are the same, bit for bit.
pub(super) fn repeated(pairs: &[(i64, i64)], beauty: &str, found: &mut Diagnosis) {
    let next = |(a, b): &&(i64, i64)| a.checked_add(1) == Some(*b);
    // Neighbours first: a loop may come round to the same frame.
    let adjacent = pairs.iter().find(next);
    let Some((first, second)) = adjacent.or(pairs.first()).copied() else { return };
    let severity = if adjacent.is_some() { Severity::Fault } else { Severity::Warning };
    found.findings.push(
        Finding::new("frames.repeated", severity, format!("frame {second} is frame {first} once more"))
            .frame(second)
            .channel(beauty)
            .evidence(
                format!(
                    "every pixel of {} pairs of frames is equal, bit for bit ({first} and {second} first)",
                    pairs.len()
                ),
                vec![Figure::new("equal pairs", pairs.len() as f64, "pairs")],
            )
            .cure(
                "the picture stops for a frame, and its noise counts twice",
                "render the frame again (a farm that copies the last frame over a failed one does this)",
            ),
    );
}
