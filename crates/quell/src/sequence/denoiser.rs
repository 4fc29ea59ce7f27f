//! The public face: frames in, in order; filtered frames out as soon as their window is complete.

use super::accumulate::accumulate;
use super::energy::Class;
use super::frame::SequenceFrame;
use super::member::Member;
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

/// A filtered light: the light itself, then its joint planes, all without weight.
#[derive(Clone, Debug, PartialEq)]
pub struct FilteredLight {
    /// As many planes as the light and its joint planes.
    pub planes: Vec<Plane<Rgb>>,
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
        Ok(Self { settings, entries: VecDeque::new(), done: 0 })
    }

    /// Frames on each side of a wanted one that take part in it.
    pub fn reach(&self) -> usize {
        self.settings.gather.frames as usize + self.settings.stabilise.frames as usize
    }

    /// Takes the next frame; `wanted`: it is to come out, not only to help its neighbours. What comes out is complete, in
    /// order. A number that does not follow, another size or other lights are a cut: what waited comes out first.
    ///
    /// # Errors
    /// [`Error::EmptySize`], [`Error::PlaneSize`]: the frame is left out and the denoiser unchanged.
    pub fn push(&mut self, frame: SequenceFrame, wanted: bool) -> Result<Vec<Filtered>, Error> {
        check(&frame)?;
        let (mut member, repaired) = Member::new(frame);
        let follows = self.entries.back().is_none_or(|last| {
            last.member.number.checked_add(1) == Some(member.number) && last.member.same_kind(&member)
        });
        let mut out = if follows { Vec::new() } else { self.finish()? };
        if let Some(last) = self.entries.back_mut() {
            if last.member.motion_to_next.is_none() {
                last.member.derive_motion_to_next(&member);
            }
            follow_reflections(&mut last.member, &mut member);
        }
        self.entries.push_back(Entry { member, wanted, repaired, estimate: None });
        out.extend(self.ready(false));
        Ok(out)
    }

    /// The end of the sequence, or a cut: the rest comes out, and the next frame starts afresh.
    ///
    /// # Errors
    /// None today.
    pub fn finish(&mut self) -> Result<Vec<Filtered>, Error> {
        let out = self.ready(true);
        self.entries.clear();
        self.done = 0;
        Ok(out)
    }

    /// Frames whose window is complete, or all where the sequence ends.
    fn ready(&mut self, ends: bool) -> Vec<Filtered> {
        let gather = self.settings.gather.frames as usize;
        let steady = self.settings.stabilise.frames as usize;
        let future = self.settings.gather.future;
        let mut out = Vec::new();
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
                        let estimate = self.estimate(i);
                        self.entries[i].estimate = Some(estimate);
                        self.entries[i].member.estimated();
                    }
                }
                out.extend(self.result(t, from, to));
            }
            // Neighbours still ask for the picture, nobody for the lights: frames are large.
            if let Some(estimate) = &mut self.entries[t].estimate {
                estimate.colours = Rows::empty();
                estimate.samples = Plane::filled(Size::new(0, 0), 0.0);
            }
            self.done += 1;
            // What no later frame can reach.
            while self.done > gather + steady {
                self.entries.pop_front();
                self.done -= 1;
            }
        }
        out
    }

    fn estimate(&self, i: usize) -> Estimate {
        let s = &self.settings;
        let gather = s.gather.frames as usize;
        let (from, to) = (i.saturating_sub(gather), (i + gather).min(self.entries.len() - 1));
        let window: Vec<&Member> = (from..=to).map(|k| &self.entries[k].member).collect();
        let member = window[i - from];
        let accumulated = accumulate(&window, i - from, &s.gather);
        let samples = most_samples(member, &accumulated.moments);
        let variance = variance(member, &accumulated, &s.variance, &s.wavelet);
        let colours = wavelet(member, accumulated, variance, &s.wavelet);
        let picture = picture(member, &colours);
        Estimate { colours, picture, samples }
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
        same(&format!("weight of {}", light.name), light.weight.as_ref().map(Plane::size))?;
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
fn most_samples(member: &Member, moments: &Rows) -> Plane<f32> {
    Plane::from_fn(member.size, |x, y| {
        (0..member.slots.len()).map(|l| moments.row(y, 2 * l + 1)[x]).fold(1.0, f32::max)
    })
}

/// What multiplies a light back besides its weight, of one row.
fn seen_row<'a>(member: &'a Member, slot: &super::member::Slot, y: usize) -> Option<&'a [Rgb]> {
    let seen = member.seen_colour.as_ref().filter(|_| Class::of(slot.kind) == Class::Seen)?;
    Some(&seen[y * member.size.width..][..member.size.width])
}

/// Sum of light * weight over the lights of the beauty.
fn picture(member: &Member, colours: &Rows) -> Plane<Rgb> {
    let mut picture = Plane::filled(member.size, [0.0; 3]);
    crate::par::rows(picture.data_mut(), member.size.width, |y, row| {
        for (l, slot) in member.slots.iter().enumerate().filter(|(l, _)| member.in_beauty[*l]) {
            let channels = [0, 1, 2].map(|c| colours.row(y, 3 * slot.first + c));
            let weights = member.weights[l].as_ref().map(|p| p.row(y));
            let seen = seen_row(member, slot, y);
            for (x, value) in row.iter_mut().enumerate() {
                let weight = weights.map_or([1.0; 3], |w| w[x]);
                let seen = seen.map_or([1.0; 3], |s| s[x]);
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
    let ratio = Plane::from_fn(member.size, |x, y| {
        let (before, after) = (estimate.picture.at(x, y), picture.at(x, y));
        [0, 1, 2].map(|c| if before[c] > 1e-8 && after[c] > 0.0 { after[c] / before[c] } else { 1.0 })
    });
    let light = |slot: &super::member::Slot| FilteredLight {
        planes: (slot.first..slot.first + slot.planes)
            .map(|k| {
                Plane::from_fn(member.size, |x, y| {
                    let seen = seen_row(member, slot, y).map_or([1.0; 3], |s| s[x]);
                    [0, 1, 2].map(|c| estimate.colours.row(y, 3 * k + c)[x] * seen[c] * ratio.at(x, y)[c])
                })
            })
            .collect(),
    };
    member.slots.iter().map(light).collect()
}
