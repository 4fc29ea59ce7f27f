//! The public face: frames in, in order; filtered frames out as soon as their window is complete.

use super::accelerator::{self, AcceleratedWindow, Accelerator, WaveletJob};
use super::accumulate::{Accumulated, accumulate};
use super::energy::Class;
use super::estimate::EstimateJob;
use super::frame::SequenceFrame;
use super::member::{Member, Slot};
use super::packed::{Packed, Weight};
use super::reflections::follow_reflections;
use super::rows::Rows;
use super::settings::SequenceSettings;
use super::stabilise::{self, stabilise};
use super::variance::variance;
use super::wavelet::wavelet;
use crate::error::Error;
use crate::frame::Rgb;
use crate::plane::{Plane, Size};
use std::collections::VecDeque;
use std::sync::Arc;

/// A filtered light: the light itself, then its joint planes, all without weight.
#[derive(Clone, Debug, PartialEq)]
pub struct FilteredLight {
    /// As many planes as the light and its joint planes.
    pub planes: Vec<Plane<Rgb>>,
    /// [`super::Light::weight`] as it came.
    pub weight: Option<Arc<Plane<Rgb>>>,
}

/// A frame made ready for the filter: a third of its size as it came. What only this frame decides is decided here, so
/// that another thread can do it.
pub struct PreparedFrame {
    pub(super) member: Member,
    pub(super) repaired: usize,
}

impl PreparedFrame {
    /// Takes a frame apart.
    ///
    /// # Errors
    /// [`Error::EmptySize`], [`Error::PlaneSize`].
    pub fn new(frame: SequenceFrame) -> Result<Self, Error> {
        check(&frame)?;
        let (member, repaired) = Member::new(frame);
        Ok(Self { member, repaired })
    }

    /// Frame number.
    pub fn number(&self) -> i64 {
        self.member.number
    }

    /// Finds the motion to the next frame in that frame, where it is not known (files hold none for the sky). Done by [`SequenceDenoiser::push`] too;
    /// for frames of which only rows will be pushed it must be done before. So with the motion of what mirrors show.
    pub fn followed_by(&mut self, next: &mut Self) {
        if self.member.number.checked_add(1) != Some(next.member.number) || !self.member.same_kind(&next.member) {
            return;
        }
        if self.member.lacks_motion_to_next() {
            self.member.derive_motion_to_next(&next.member);
        }
        follow_reflections(&mut self.member, &mut next.member);
    }

    /// Rows that motion leads up or down at most, to the frame before and to the next.
    pub fn rows_moved(&self) -> [f32; 2] {
        self.member.rows_moved()
    }
}

impl std::fmt::Debug for PreparedFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PreparedFrame").field("number", &self.member.number).finish_non_exhaustive()
    }
}

/// A filtered frame. Planes have the frame's extent.
#[derive(Clone, Debug, PartialEq)]
pub struct Filtered {
    /// Frame number.
    pub number: i64,
    /// In the order of [`SequenceFrame::lights`].
    pub lights: Vec<FilteredLight>,
    /// Coverage, where the frame has it.
    pub alpha: Option<Plane<f32>>,
    /// Trust in the result, 0..1: 1 where many samples met.
    pub confidence: Plane<f32>,
    /// Samples (pixels of some frame) that the steadiest light's mean is worth before the filter over the image.
    pub samples: Plane<f32>,
    /// Colour samples of the input that were not finite and counted as 0.
    pub repaired: usize,
}

/// Samples at which confidence is full.
const CONFIDENT_SAMPLES: f32 = 8.0;

struct Entry {
    member: Member,
    wanted: bool,
    repaired: usize,
    estimate: Option<Estimate>,
}

/// A frame after the wavelet.
struct Estimate {
    slots: Vec<Slot>,
    colours: Rows,
    picture: Plane<Rgb>,
    samples: Plane<f32>,
}

/// Filters a sequence, window by window.
///
/// Frame t depends on frames t - [`reach`](Self::reach) .. t + reach alone, and never on a filtered one: any split of a
/// sequence gives the same bits, provided that each part sees that many frames around what it wants.
#[derive(Debug)]
pub struct SequenceDenoiser {
    settings: SequenceSettings,
    entries: VecDeque<Entry>,
    /// Entries at the front that were given out or are not wanted.
    done: usize,
    accelerator: Option<Arc<dyn Accelerator>>,
    elsewhere: Elsewhere,
}

/// Where the frames of the present run are besides here.
#[derive(Debug, Default)]
enum Elsewhere {
    /// Not asked yet.
    #[default]
    Unknown,
    /// Stages 1 and 2 run here.
    Nowhere,
    Window(Box<dyn AcceleratedWindow>),
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Entry").field("number", &self.member.number).finish_non_exhaustive()
    }
}

impl SequenceDenoiser {
    /// Nothing is allocated before the first frame.
    ///
    /// # Errors
    /// [`Error::ParameterValue`] for a setting out of its range.
    pub fn new(settings: SequenceSettings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self { settings, entries: VecDeque::new(), done: 0, accelerator: None, elsewhere: Elsewhere::Unknown })
    }

    /// Likewise; stages that `accelerator` knows run there.
    ///
    /// # Errors
    /// As [`SequenceDenoiser::new`].
    pub fn with_accelerator(settings: SequenceSettings, accelerator: Arc<dyn Accelerator>) -> Result<Self, Error> {
        Ok(Self { accelerator: Some(accelerator), ..Self::new(settings)? })
    }

    /// Frames on each side of a wanted one that take part in it.
    pub fn reach(&self) -> usize {
        self.settings.gather.frames as usize + self.settings.stabilise.frames as usize
    }

    /// Rows above and below a band that decide it, where no surface moves up or down by more than `moved` rows a frame. A
    /// band with as many rows around it is filtered to the bits of the whole picture.
    pub fn margin(&self, moved: f32, picture_height: usize) -> usize {
        let s = &self.settings;
        let farthest = s.gather.travel * picture_height as f32;
        let way = |frames: u32| (moved * frames as f32).min(farthest).ceil() as usize + 2;
        let wavelet = WaveletJob::margin(s.wavelet.levels.max(s.wavelet.transmission_levels));
        let variance = s.variance.radius as usize;
        // The range in 3x3, the cubic, what is in front in 3x3, edges along the picture; slopes and noise of guides.
        let (stabilise, guides) = (3 + 1 + super::stabilise::BORDER, 2);
        way(s.stabilise.frames) + stabilise + wavelet + variance + guides + way(s.gather.frames)
    }

    /// Takes the next frame; `wanted`: it is to come out, not only to help its neighbours. What comes out is complete, in
    /// order. A number that does not follow, another size or other lights are a cut: what waited comes out first.
    ///
    /// # Errors
    /// [`Error::EmptySize`], [`Error::PlaneSize`]: the frame is left out and the denoiser unchanged.
    /// [`Error::Accelerator`]: as [`Self::push_to`].
    pub fn push(&mut self, frame: SequenceFrame, wanted: bool) -> Result<Vec<Filtered>, Error> {
        let mut out = Vec::new();
        self.push_to(PreparedFrame::new(frame)?, wanted, &mut |filtered| {
            out.push(filtered);
            true
        })?;
        Ok(out)
    }

    /// [`Self::push`], with every frame given to `out` as soon as it is filtered: one at a time is in memory. Where `out`
    /// returns false, the rest is put off until the next call.
    ///
    /// # Errors
    /// [`Error::Accelerator`]: the frames inside are given up, and the next one starts afresh.
    pub fn push_to(
        &mut self,
        frame: PreparedFrame,
        wanted: bool,
        out: &mut dyn FnMut(Filtered) -> bool,
    ) -> Result<(), Error> {
        let PreparedFrame { mut member, repaired } = frame;
        let follows = self.entries.back().is_none_or(|last| {
            last.member.number.checked_add(1) == Some(member.number) && last.member.same_kind(&member)
        });
        if !follows {
            self.finish_to(out)?;
        }
        if let Some(last) = self.entries.back_mut() {
            if last.member.lacks_motion_to_next() {
                last.member.derive_motion_to_next(&member);
            }
            // Done before for bands: what mirrors show is found in the whole picture.
            if last.member.reflection_to_next.is_none() {
                follow_reflections(&mut last.member, &mut member);
            }
        }
        self.entries.push_back(Entry { member, wanted, repaired, estimate: None });
        self.ready(false, out)
    }

    /// The end of the sequence, or a cut: the rest comes out, and the next frame starts afresh.
    ///
    /// # Errors
    /// [`Error::Accelerator`]: the frames inside are given up.
    pub fn finish(&mut self) -> Result<Vec<Filtered>, Error> {
        let mut out = Vec::new();
        self.finish_to(&mut |filtered| {
            out.push(filtered);
            true
        })?;
        Ok(out)
    }

    /// [`Self::finish`], with every frame given to `out` as soon as it is filtered.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn finish_to(&mut self, out: &mut dyn FnMut(Filtered) -> bool) -> Result<(), Error> {
        let result = self.ready(true, out);
        self.clear();
        result
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.done = 0;
        self.elsewhere = Elsewhere::Unknown;
    }

    /// Frames whose window is complete, or all where the sequence ends.
    fn ready(&mut self, ends: bool, out: &mut dyn FnMut(Filtered) -> bool) -> Result<(), Error> {
        let gather = self.settings.gather.frames as usize;
        let steady = self.settings.stabilise.frames as usize;
        let future = self.settings.gather.future;
        while self.done < self.entries.len() {
            let t = self.done;
            let last = self.entries.len() - 1;
            let needed = if future { t + gather + steady } else { t };
            if !ends && last < needed {
                break;
            }
            if self.entries[t].wanted {
                let (from, to) = (t.saturating_sub(steady), if future { (t + steady).min(last) } else { t });
                for i in from..=to {
                    if self.entries[i].estimate.is_none() {
                        let estimate = self.estimate(i).inspect_err(|_| self.clear())?;
                        self.entries[i].estimate = Some(estimate);
                        self.entries[i].member.estimated();
                    }
                }
                if let Some(filtered) = self.result(t, from, to) {
                    // Neighbours still ask for the picture, nobody for the lights: frames are large.
                    self.given_out(t);
                    self.done += 1;
                    let go_on = out(filtered);
                    self.forget();
                    if !go_on {
                        return Ok(());
                    }
                    continue;
                }
            }
            self.given_out(t);
            self.done += 1;
            self.forget();
        }
        Ok(())
    }

    fn given_out(&mut self, t: usize) {
        let Some(entry) = self.entries.get_mut(t) else { return };
        if let Some(estimate) = &mut entry.estimate {
            estimate.colours = Rows::empty();
            estimate.slots = Vec::new();
            estimate.samples = Plane::filled(Size::new(0, 0), 0.0);
            entry.member.given_out();
        }
    }

    /// Drops what no later frame can reach.
    fn forget(&mut self) {
        let gather = self.settings.gather.frames as usize;
        let steady = self.settings.stabilise.frames as usize;
        let kept = self.done.saturating_sub(steady);
        // A later frame may ask for an estimate that is still to be made, and that for the frames around it.
        let next =
            (kept..self.entries.len()).find(|&i| self.entries[i].estimate.is_none()).unwrap_or(self.entries.len());
        let kept = kept.min(next.saturating_sub(gather));
        self.entries.drain(..kept);
        self.done -= kept;
    }

    fn estimate(&mut self, i: usize) -> Result<Estimate, Error> {
        let Self { settings: s, entries, accelerator, elsewhere, .. } = self;
        let gather = s.gather.frames as usize;
        let (from, to) = (i.saturating_sub(gather), (i + gather).min(entries.len() - 1));
        let window: Vec<&Member> = (from..=to).map(|k| &entries[k].member).collect();
        let member = window[i - from];
        if let Some(accelerator) = accelerator.as_deref() {
            if matches!(elsewhere, Elsewhere::Unknown) {
                *elsewhere = accelerator.window().map_or(Elsewhere::Nowhere, Elsewhere::Window);
            }
            if let Elsewhere::Window(there) = elsewhere {
                let mut job = EstimateJob::new(&window, i - from, s);
                if there.estimate(&mut job).map_err(|reason| accelerator::failed(accelerator, reason))? {
                    let (slots, colours, samples) = job.estimated();
                    let picture = picture(member, &slots, &colours);
                    return Ok(Estimate { slots, colours, picture, samples });
                }
            }
        }
        let accumulated = accumulate(&window, i - from, &s.gather);
        let samples = most_samples(member.size, &accumulated.moments);
        let local = member.guides.local(member.size, member.seen_colour.as_ref());
        let variance = variance(member, &local, &accumulated, &s.variance, &s.wavelet);
        let Accumulated { slots, colours, moments } = accumulated;
        drop(moments);
        let colours = match accelerator.as_deref() {
            None => wavelet(member, &local, &slots, colours, variance, &s.wavelet),
            Some(elsewhere) => WaveletJob::new(member, &local, &slots, &colours, &variance, &s.wavelet)
                .and_then(|mut job| elsewhere.wavelet(&mut job).map(|()| job.filtered()))
                .map_err(|reason| accelerator::failed(elsewhere, reason))?,
        };
        let picture = picture(member, &slots, &colours);
        Ok(Estimate { slots, colours, picture, samples })
    }

    fn result(&self, t: usize, from: usize, to: usize) -> Option<Filtered> {
        let window: Vec<_> = (self.entries.range(from..=to))
            .filter_map(|e| {
                let picture = &e.estimate.as_ref()?.picture;
                Some(stabilise::Filtered { member: &e.member, picture, alpha: e.member.alpha.as_ref() })
            })
            .collect();
        let entry = &self.entries[t];
        let estimate = entry.estimate.as_ref()?;
        let (picture, alpha) = stabilise(&window, t - from, &self.settings.gather, &self.settings.stabilise);
        let lights = lights(&entry.member, estimate, &picture);
        let confidence =
            Plane::from_fn(picture.size(), |x, y| (estimate.samples.at(x, y) / CONFIDENT_SAMPLES).min(1.0));
        let samples = estimate.samples.clone();
        Some(Filtered { number: entry.member.number, lights, alpha, confidence, samples, repaired: entry.repaired })
    }
}

fn check(frame: &SequenceFrame) -> Result<(), Error> {
    let expected = frame.size;
    if expected.width == 0 || expected.height == 0 {
        return Err(Error::EmptySize { size: expected });
    }
    let same = |plane: &str, found: Option<Size>| match found {
        Some(found) if found != expected => Err(Error::PlaneSize { plane: plane.to_owned(), expected, found }),
        _ => Ok(()),
    };
    for light in &frame.lights {
        same(&light.name, Some(light.light.size()))?;
        same(&format!("weight of {}", light.name), light.weight.as_deref().map(Plane::size))?;
        for joint in &light.joint {
            same(&format!("joint plane of {}", light.name), Some(joint.size()))?;
        }
    }
    same("depth", frame.depth.as_ref().map(Plane::size))?;
    same("normal", frame.normal.as_ref().map(Plane::size))?;
    same("position", frame.position.as_ref().map(Plane::size))?;
    same("motion to previous", frame.motion_to_previous.as_ref().map(Plane::size))?;
    same("motion to next", frame.motion_to_next.as_ref().map(Plane::size))?;
    same("albedo", frame.albedo.as_ref().map(Plane::size))?;
    same("seen albedo", frame.seen_albedo.as_ref().map(Plane::size))?;
    same("seen normal", frame.seen_normal.as_ref().map(Plane::size))?;
    same("roughness", frame.roughness.as_ref().map(Plane::size))?;
    same("alpha", frame.alpha.as_ref().map(Plane::size))?;
    same("variance", frame.variance.as_ref().map(Plane::size))
}

/// The largest count among the lights.
fn most_samples(size: Size, moments: &Rows) -> Plane<f32> {
    Plane::from_fn(size, |x, y| (0..moments.channels() / 2).map(|l| moments.row(y, 2 * l + 1)[x]).fold(1.0, f32::max))
}

/// What multiplies a light back besides its weight.
fn seen<'a>(member: &'a Member, slot: &Slot) -> Option<&'a Packed> {
    member.seen_colour.as_ref().filter(|_| Class::of(slot.kind) == Class::Seen)
}

/// Sum of light * weight over the lights of the beauty.
fn picture(member: &Member, slots: &[Slot], colours: &Rows) -> Plane<Rgb> {
    let mut picture = Plane::filled(member.size, [0.0; 3]);
    let width = member.size.width;
    crate::par::rows(picture.data_mut(), width, |y, row| {
        for slot in slots.iter().filter(|slot| member.in_beauty[slot.light]) {
            let channels = [0, 1, 2].map(|c| colours.row(y, 3 * slot.first + c));
            let weights = member.weights[slot.light].as_deref();
            let seen = seen(member, slot);
            for (x, value) in row.iter_mut().enumerate() {
                let weight = weights.map_or([1.0; 3], |w| w.at(y * width + x));
                let seen = seen.map_or([1.0; 3], |s| s.at(0, y * width + x));
                for c in 0..3 {
                    value[c] += channels[c][x] * weight[c] * seen[c];
                }
            }
        }
    });
    picture
}

/// The filtered lights, all scaled alike to the steadier picture: they add up to it.
fn lights(member: &Member, estimate: &Estimate, picture: &Plane<Rgb>) -> Vec<FilteredLight> {
    let (size, width) = (member.size, member.size.width);
    let ratio = crate::par::plane(size, |x, y| {
        let (before, after) = (estimate.picture.at(x, y), picture.at(x, y));
        [0, 1, 2].map(|c| if before[c] > 1e-8 && after[c] > 0.0 { after[c] / before[c] } else { 1.0 })
    });
    let filtered = |slot: &Slot| {
        let plane = |k: usize| {
            crate::par::plane(size, |x, y| {
                let seen = seen(member, slot).map_or([1.0; 3], |s| s.at(0, y * width + x));
                [0, 1, 2].map(|c| estimate.colours.row(y, 3 * k + c)[x] * seen[c] * ratio.at(x, y)[c])
            })
        };
        (slot.first..slot.first + slot.planes).map(plane).collect()
    };
    let mut shared: Vec<(*const Weight, Arc<Plane<Rgb>>)> = Vec::new();
    let mut light = |slot: &Slot| FilteredLight {
        planes: match estimate.slots.iter().find(|lit| lit.light == slot.light) {
            Some(lit) => filtered(lit),
            None => vec![Plane::filled(size, [0.0; 3]); slot.planes],
        },
        weight: member.weights[slot.light].as_ref().map(|weight| {
            let known = shared.iter().find(|(other, _)| std::ptr::eq(*other, Arc::as_ptr(weight)));
            let plane = known.map_or_else(|| Arc::new(weight.plane(size)), |(_, plane)| Arc::clone(plane));
            shared.push((Arc::as_ptr(weight), Arc::clone(&plane)));
            plane
        }),
    };
    member.slots.iter().map(&mut light).collect()
}
