//! A frame's images to what the filter takes, and what the filter made of it back into the images: the same for files and for
//! frames in memory.

use super::cuts::CutGuides;
use crate::adapt::{Adapter, FrameNoise, Links};
use crate::error::Error;
use crate::image::ExrImage;
use quell::Plane;
use quell::sequence::{Filtered, Light, PreparedFrame, SequenceFrame, SequenceSettings};
use std::path::Path;

/// What a frame needs to know of its predecessor, for one layer and view. Frames are taken one after the other.
#[derive(Debug, Default)]
pub(super) struct Before {
    links: Links,
    /// Its number and what it shows.
    guides: Option<(i64, CutGuides)>,
}

/// What a frame's images became.
pub(super) struct Taken {
    /// Of each layer and view, with a description of its lights.
    pub frames: Vec<(PreparedFrame, SequenceFrame)>,
    /// It shows something else than the frame before.
    pub cut: bool,
    /// Sentences for the user.
    pub notes: Vec<String>,
}

/// Makes what the filter takes. One adapter and one `before` for each layer and view.
pub(super) fn take(
    adapters: &[Adapter],
    before: &mut [Before],
    settings: &SequenceSettings,
    find_cuts: bool,
    number: i64,
    images: &[ExrImage],
) -> Result<Taken, Error> {
    let path = || images.first().map_or(Path::new(""), ExrImage::path);
    let mut taken = Taken { frames: Vec::with_capacity(adapters.len()), cut: false, notes: Vec::new() };
    for (adapter, before) in adapters.iter().zip(before) {
        if images.iter().any(|image| image.full_window().union(adapter.canvas()) != adapter.canvas()) {
            let reason = format!("it has pixels outside of {}, which holds the other frames", adapter.canvas());
            return Err(Error::invalid(path(), reason));
        }
        let last = before.guides.take();
        let adapted = adapter.frame(number, images, &mut before.links)?;
        taken.notes.extend(adapted.notes);
        if find_cuts {
            let last = last.filter(|(last, _)| last.checked_add(1) == Some(number));
            taken.cut |= last.is_some_and(|(_, guides)| guides.cut_before(&adapted.frame));
            before.guides = Some((number, CutGuides::of(&adapted.frame)));
        }
        let described = without_light(&adapted.frame);
        let prepared = PreparedFrame::new(adapted.frame, settings);
        taken.frames.push((prepared.map_err(|source| Error::Frame { path: path().to_owned(), source })?, described));
    }
    Ok(taken)
}

/// What writing back needs of a frame: lights without their light and weight. The filter has them.
fn without_light(frame: &SequenceFrame) -> SequenceFrame {
    let mut kept = SequenceFrame::new(frame.number, frame.size);
    kept.lights = (frame.lights.iter())
        .map(|light| Light {
            name: light.name.clone(),
            kind: light.kind,
            light: Plane::filled(quell::Size::new(1, 1), [0.0; 3]),
            weight: None,
            in_beauty: light.in_beauty,
            joint: Vec::new(),
        })
        .collect();
    kept
}

/// What was put into the images.
#[derive(Default)]
pub(super) struct PutBack {
    /// Sentences for the user.
    pub notes: Vec<String>,
    /// How much noise there was and is, where that was asked for; of several layers the first that tells.
    pub measured: Option<FrameNoise>,
    /// Of each layer and view: the expected error of its picture.
    pub errors: Vec<Option<Plane<f32>>>,
}

/// Replaces every filtered pass in the images.
pub(super) fn put(
    adapters: &[Adapter],
    measure_noise: bool,
    number: i64,
    images: &mut [ExrImage],
    filtered: Vec<(SequenceFrame, Filtered)>,
) -> Result<PutBack, Error> {
    let mut put = PutBack::default();
    let mut repaired = 0;
    for (adapter, (mut frame, filtered)) in adapters.iter().zip(filtered) {
        let mut lights = Vec::with_capacity(filtered.lights.len());
        for (light, filtered) in frame.lights.iter_mut().zip(filtered.lights) {
            light.weight = filtered.weight;
            lights.extend(filtered.planes.into_iter().next());
        }
        let before = match &filtered.noise {
            Some(_) if measure_noise => adapter.picture(images)?,
            _ => None,
        };
        adapter.write_back(images, &frame, &lights, filtered.alpha.as_ref())?;
        if let (Some(before), Some(left)) = (before, &filtered.noise)
            && let Some(after) = adapter.picture(images)?
            && put.measured.is_none()
        {
            put.measured = FrameNoise::of(&before, &after, left);
        }
        put.errors.push(filtered.noise);
        repaired += filtered.repaired;
    }
    if repaired > 0 {
        put.notes
            .push(format!("frame {number}: {repaired} pixels held colours that are no numbers, and count as black"));
    }
    Ok(put)
}
