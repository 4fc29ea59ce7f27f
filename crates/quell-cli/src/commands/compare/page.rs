//! The page of a comparison.

use super::contest::Contest;
use crate::failure::Failure;
use crate::interrupt;
use quell::{Plane, Rgb, Size};
use quell_lab::report::comparison::{self, ComparisonPage, Panel};
use quell_lab::report::figures::ComparedMethod;
use quell_lab::tone::{Picture, Tone};
use std::path::Path;

/// Frames whose pictures are shown at most: enough to see flicker, few enough for a page.
const MOST_FRAMES: usize = 24;
/// Pictures for the page may take so many bytes before they are encoded.
const MOST_PICTURE_BYTES: usize = 1 << 30;
/// Rows of which there are x-t slices, evenly spaced.
const SLICES: usize = 7;
/// Slices are about the past of what is shown; longer ones would only be smaller.
const MOST_SLICE_FRAMES: usize = 96;
/// What stands in a slice where a frame has no picture.
const NOTHING: [u8; 3] = [16, 18, 22];

/// Writes the page; what had to be left out is returned in a sentence.
pub fn write(
    path: &Path,
    contest: &Contest,
    methods: &[ComparedMethod],
    notes: &[String],
    command: &str,
) -> Result<Option<String>, Failure> {
    let sequence = &contest.sequence;
    let Size { width, height } = sequence.size;
    // One more than the methods, for the reference.
    let each = sequence.size.pixels() * 7 * (contest.entries.len() + 1);
    let most = (MOST_PICTURE_BYTES / each.max(1)).clamp(1, MOST_FRAMES);
    let shown = shown_frames(&sequence.numbers, &sequence.scored, most);
    let slice_rows: Vec<usize> = if sequence.numbers.len() > 1 {
        let mut rows: Vec<usize> = (1..=SLICES).map(|i| i * height / (SLICES + 1)).collect();
        rows.dedup();
        rows
    } else {
        Vec::new()
    };
    let slice_frames = &sequence.numbers[sequence.numbers.len().saturating_sub(MOST_SLICE_FRAMES)..];
    let mut page = ComparisonPage {
        title: format!("{}: methods compared", sequence.name),
        subtitle: format!(
            "{}, {} frames, {}; {} scored",
            sequence.size,
            sequence.numbers.len(),
            sequence.description,
            sequence.scored.len()
        ),
        frame_numbers: shown.clone(),
        frames_per_second: f64::from(crate::sequence::files::FRAMES_PER_SECOND),
        slice_rows: slice_rows.clone(),
        slice_frames: slice_frames.to_vec(),
        methods: methods.to_vec(),
        notes: notes.to_vec(),
        command: command.to_owned(),
        ..ComparisonPage::default()
    };
    let mut reference = Gatherer::new("reference", width, &slice_rows, slice_frames, &shown, sequence.tone);
    for &number in slice_frames {
        reference.add(number, sequence.reference(number).map(|r| &r.mean));
    }
    page.panels.push(reference.panel);
    for entry in &contest.entries {
        if interrupt::asked() {
            return Err(Failure::Interrupted("the methods are finished and kept; the page is not written".to_owned()));
        }
        let Ok((finished, verdict)) = &entry.result else { continue };
        let mut panel = Gatherer::new(&entry.name, width, &slice_rows, slice_frames, &shown, sequence.tone);
        for &number in slice_frames {
            let picture = match sequence.index_of(number) {
                Some(index) => Some(finished.picture(index)?),
                None => None,
            };
            panel.add(number, picture.as_ref());
        }
        let mut panel = panel.panel;
        panel.maps = shown.iter().map(|n| verdict.maps.get(n).cloned()).collect();
        page.panels.push(panel);
    }
    Ok(comparison::write(path, &page)?)
}

/// The last frames in a row that end with the last scored one: stepping through them shows what flickers.
fn shown_frames(numbers: &[i64], scored: &[i64], most: usize) -> Vec<i64> {
    let last = scored.last().or(numbers.last()).copied().unwrap_or_default();
    let end = numbers.partition_point(|n| *n <= last);
    // Where the scored frames are far apart, those are what can be compared.
    let apart = scored.windows(2).any(|w| w[1] - w[0] > 1);
    if apart {
        return scored[scored.len().saturating_sub(most)..].to_vec();
    }
    let wanted = scored.len().max(2).min(most);
    numbers[end.saturating_sub(wanted)..end].to_vec()
}

/// One panel's pictures, frame by frame.
struct Gatherer<'a> {
    panel: Panel,
    rows: &'a [usize],
    frames: &'a [i64],
    shown: &'a [i64],
    tone: Tone,
}

impl<'a> Gatherer<'a> {
    fn new(name: &str, width: usize, rows: &'a [usize], frames: &'a [i64], shown: &'a [i64], tone: Tone) -> Self {
        let size = Size::new(width, frames.len());
        let empty = || Picture { size, rgb: NOTHING.repeat(size.pixels()) };
        let panel = Panel {
            name: name.to_owned(),
            pictures: shown.iter().map(|_| None).collect(),
            maps: Vec::new(),
            slices: rows.iter().map(|_| empty()).collect(),
        };
        Self { panel, rows, frames, shown, tone }
    }

    fn add(&mut self, number: i64, plane: Option<&Plane<Rgb>>) {
        let Some(plane) = plane else { return };
        let picture = self.tone.picture(plane);
        let bytes = 3 * picture.size.width;
        if let Some(line) = self.frames.iter().position(|n| *n == number) {
            for (slice, &row) in self.panel.slices.iter_mut().zip(self.rows) {
                let from = picture.rgb.get(row * bytes..(row + 1) * bytes);
                if let (Some(from), Some(to)) = (from, slice.rgb.get_mut(line * bytes..(line + 1) * bytes)) {
                    to.copy_from_slice(from);
                }
            }
        }
        if let Some(place) = self.shown.iter().position(|n| *n == number) {
            self.panel.pictures[place] = Some(picture);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_frames_follow_each_other_where_they_can() {
        let numbers: Vec<i64> = (0..64).collect();
        let scored: Vec<i64> = (48..64).collect();
        assert_eq!(shown_frames(&numbers, &scored, 24), scored);
        assert_eq!(shown_frames(&numbers, &scored, 8), (56..64).collect::<Vec<_>>());
        assert_eq!(shown_frames(&numbers, &[3, 7, 11], 24), [3, 7, 11]);
        assert_eq!(shown_frames(&numbers, &[40], 24), [39, 40]);
        assert_eq!(shown_frames(&[5], &[5], 24), [5]);
    }
}
