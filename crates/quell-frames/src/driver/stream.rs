//! Frames in memory, pushed one by one; clean ones come out as soon as their window is full. To the bit what a [`super::Job`]
//! makes of files with the same channels.

use super::frames::{Denoisers, Done, Loaded};
use super::job::layout;
use super::layers::{self, Before, Taken};
use super::pipeline::Window;
use crate::adapt::{AdaptOptions, Adapter};
use crate::error::Error;
use crate::image::ExrImage;
use crate::roles::{MapOptions, map_roles};
use quell::sequence::{Accelerator, SequenceDenoiser, SequenceSettings};
use quell::{Backend, Plane};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the user asked for.
#[derive(Clone, Debug)]
pub struct StreamOptions {
    /// Which passes are what.
    pub map: MapOptions,
    /// How passes become planes.
    pub adapt: AdaptOptions,
    /// Of the filter.
    pub settings: SequenceSettings,
    /// First frames of shots; absent: found.
    pub cuts: Option<Vec<i64>>,
    /// Which implementation of the stages runs on this processor. `Reference` is slow.
    pub backend: Backend,
    /// Runs stages of the filter on another device; absent: this processor does all.
    pub accelerator: Option<Arc<dyn Accelerator>>,
}

/// A frame that came out.
#[derive(Debug)]
pub struct Cleaned {
    /// Frame number.
    pub number: i64,
    /// Its image; channels that were filtered are replaced ([`crate::Channel::is_replaced`]), the others without samples.
    pub image: ExrImage,
    /// Expected error of the picture: root mean square over the channels, in its units. Of several layers the first's.
    pub noise: Option<Plane<f32>>,
    /// Sentences for the user.
    pub notes: Vec<String>,
}

/// A sequence whose frames are pushed in order.
///
/// What must be seen in pixels (do the light passes add up, what do vectors mean) is decided on the first two frames: the
/// first waits for the second.
#[derive(Debug)]
pub struct Stream {
    options: StreamOptions,
    first: Option<(i64, ExrImage)>,
    shot: Option<Shot>,
    /// Number of the frame that was taken last.
    last: Option<i64>,
    reach: usize,
}

/// What the first frames decided.
struct Shot {
    adapters: Vec<Adapter>,
    before: Vec<Before>,
    layout: Vec<Vec<String>>,
    denoisers: Denoisers,
    /// What there is to say of frames inside.
    notes: BTreeMap<i64, Vec<String>>,
}

impl std::fmt::Debug for Shot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shot").field("adapters", &self.adapters).finish_non_exhaustive()
    }
}

/// Hears what comes out; false: nobody wants more.
type Out<'o> = &'o mut dyn FnMut(Cleaned) -> bool;

impl Stream {
    /// Nothing is allocated before the first frame.
    ///
    /// # Errors
    /// [`Error::Filter`] for a setting out of its range.
    pub fn new(options: StreamOptions) -> Result<Self, Error> {
        let reach = SequenceDenoiser::new(options.settings.clone()).map_err(Error::Filter)?.reach();
        Ok(Self { options, first: None, shot: None, last: None, reach })
    }

    /// How many frames a frame sees on each side.
    pub const fn reach(&self) -> usize {
        self.reach
    }

    /// What each pass was taken for, and why; empty before that is decided.
    pub fn mapping(&self) -> String {
        let adapters = self.shot.iter().flat_map(|shot| &shot.adapters);
        adapters.map(Adapter::describe).collect::<Vec<_>>().join("\n")
    }

    /// What may spoil the result, and what to do; empty before that is decided.
    pub fn warnings(&self) -> Vec<String> {
        self.shot.iter().flat_map(|shot| &shot.adapters).flat_map(Adapter::warnings).cloned().collect()
    }

    /// Names of passes that were taken for nothing and stay as they are; empty before that is decided.
    pub fn others(&self) -> Vec<String> {
        let adapters = self.shot.iter().flat_map(|shot| &shot.adapters);
        adapters.flat_map(|adapter| &adapter.mapping().others).cloned().collect()
    }

    /// Takes the next frame. A number that does not follow, and a frame that shows something else, begin a new shot: what
    /// waited comes out first.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the frame does not fit the first one, or has no higher number than the last: it is left out, the others stay. Where what the first
    /// frames bring cannot be filtered, they are given up. [`Error::Filter`]: the frames inside are given up.
    pub fn push(&mut self, number: i64, image: ExrImage, out: Out<'_>) -> Result<(), Error> {
        if let Some(last) = self.last.filter(|last| !self.is_empty() && number <= *last) {
            let reason = format!(
                "number {number} after {last}; numbers rise within a sequence, and another one begins after a flush"
            );
            return Err(Error::invalid(image.path(), reason));
        }
        if self.shot.is_none() {
            let Some((first_number, first)) = self.first.take() else {
                (self.first, self.last) = (Some((number, image)), Some(number));
                return Ok(());
            };
            let follows = first_number.checked_add(1) == Some(number) && layout_of(&first) == layout_of(&image);
            self.shot = Some(self.begin(&first, follows.then_some(&image))?);
            self.take(first_number, first, out)?;
        }
        self.take(number, image, out)
    }

    /// The end of the sequence: the rest comes out. What is pushed next is decided upon anew.
    ///
    /// # Errors
    /// As [`Stream::push`]; everything inside is given up.
    pub fn flush(&mut self, out: Out<'_>) -> Result<(), Error> {
        let begun = match self.first.take() {
            None => Ok(()),
            Some((number, first)) => self.begin(&first, None).and_then(|shot| {
                self.shot = Some(shot);
                self.take(number, first, out)
            }),
        };
        let result = begun.and_then(|()| self.finish(out));
        self.reset();
        result
    }

    /// Decides now, without waiting for a second frame.
    ///
    /// # Errors
    /// As [`Stream::push`].
    pub fn decide(&mut self, out: Out<'_>) -> Result<(), Error> {
        let Some((number, first)) = self.first.take() else { return Ok(()) };
        self.shot = Some(self.begin(&first, None)?);
        self.take(number, first, out)
    }

    /// True where nothing was taken, or everything was given up.
    pub const fn is_empty(&self) -> bool {
        self.first.is_none() && self.shot.is_none()
    }

    /// Gives up everything inside.
    pub fn reset(&mut self) {
        (self.first, self.shot) = (None, None);
    }

    fn begin(&self, first: &ExrImage, second: Option<&ExrImage>) -> Result<Shot, Error> {
        let options = &self.options;
        let mappings = map_roles(&[(String::new(), first)], &options.map)?;
        let canvas = first.full_window();
        let new = |mapping| {
            let second = second.map(std::slice::from_ref);
            Adapter::new(mapping, canvas, std::slice::from_ref(first), second, &options.adapt)
        };
        let adapters = mappings.into_iter().map(new).collect::<Result<Vec<_>, _>>()?;
        let (settings, accelerator) = (&options.settings, options.accelerator.as_ref());
        let denoisers = Denoisers::of(adapters.len(), Path::new(""), settings, options.backend, accelerator)?;
        let before = adapters.iter().map(|_| Before::default()).collect();
        Ok(Shot { adapters, before, layout: layout_of(first), denoisers, notes: BTreeMap::new() })
    }

    fn take(&mut self, number: i64, image: ExrImage, out: Out<'_>) -> Result<(), Error> {
        let Self { options, shot: Some(shot), .. } = self else { return Ok(()) };
        let path: PathBuf = image.path().to_owned();
        if layout_of(&image) != shot.layout {
            let reason = "its passes are not those of the first frame; filter it as a sequence of its own";
            return Err(Error::invalid(&path, reason));
        }
        let mut images = vec![image];
        let find_cuts = options.cuts.is_none();
        let Taken { frames, cut, notes } =
            layers::take(&shot.adapters, &mut shot.before, &options.settings, find_cuts, number, &images)?;
        // The passes that are filtered are replaced, and nobody needs the others.
        images.iter_mut().for_each(ExrImage::forget);
        let cut = cut || options.cuts.as_ref().is_some_and(|cuts| cuts.contains(&number));
        let Shot { adapters, denoisers, notes: said, .. } = shot;
        said.insert(number, notes);
        let mut failed = None;
        let mut give = |number: i64, done: Done| match clean(adapters, said, number, done) {
            Ok(cleaned) => out(cleaned),
            Err(error) => {
                failed.get_or_insert(error);
                false
            }
        };
        if cut {
            denoisers.finish(&mut give)?;
        }
        denoisers.push(number, Loaded { images, frames, cut }, true, &mut give)?;
        self.last = Some(number);
        failed.map_or(Ok(()), Err)
    }

    fn finish(&mut self, out: Out<'_>) -> Result<(), Error> {
        let Some(Shot { adapters, denoisers, notes, .. }) = &mut self.shot else { return Ok(()) };
        let mut failed = None;
        denoisers.finish(&mut |number, done| match clean(adapters, notes, number, done) {
            Ok(cleaned) => out(cleaned),
            Err(error) => {
                failed.get_or_insert(error);
                false
            }
        })?;
        failed.map_or(Ok(()), Err)
    }
}

fn clean(
    adapters: &[Adapter],
    said: &mut BTreeMap<i64, Vec<String>>,
    number: i64,
    done: Done,
) -> Result<Cleaned, Error> {
    let mut images = done.images;
    let put = layers::put(adapters, false, number, &mut images, done.filtered)?;
    let mut notes = said.remove(&number).unwrap_or_default();
    notes.extend(put.notes);
    let missing = || Error::invalid(Path::new(&format!("frame {number}")), "it came out without its image");
    let image = images.pop().ok_or_else(missing)?;
    Ok(Cleaned { number, image, noise: put.errors.into_iter().next().flatten(), notes })
}

fn layout_of(image: &ExrImage) -> Vec<Vec<String>> {
    layout(std::slice::from_ref(image))
}
