//! The public face: frames in, in order; filtered frames out as soon as their window is complete.

use super::accelerator::{self, AcceleratedWindow, Accelerator};
use super::estimate::EstimateJob;
use super::finish::{Finish, FinishJob};
use super::frame::{Filtered, FilteredLight, SequenceFrame};
use super::pipeline::{SequencePlan, SequenceStage};
use super::run::{self, Estimate, SequenceStages, StageTimes, stages_of};
use super::settings::SequenceSettings;
use crate::denoiser::Backend;
use crate::error::Error;
use crate::frame::Rgb;
use crate::par;
use crate::plane::{Plane, Size};
use crate::stages::stabilise;
use crate::window::{PreparedFrame, Rows, Weight};
use std::collections::VecDeque;
use std::sync::Arc;

struct Entry {
    frame: PreparedFrame,
    wanted: bool,
    estimate: Option<Estimate>,
}

/// Filters a sequence, window by window.
///
/// Frame t depends on frames t - [`reach`](Self::reach) .. t + reach alone, and never on a filtered one: any split of a
/// sequence gives the same bits, provided that each part sees that many frames around what it wants.
pub struct SequenceDenoiser {
    settings: SequenceSettings,
    plan: SequencePlan,
    stages: &'static SequenceStages,
    entries: VecDeque<Entry>,
    /// Entries at the front that were given out or are not wanted.
    done: usize,
    accelerator: Option<Arc<dyn Accelerator>>,
    device: Device,
    times: StageTimes,
    /// What `blend` chose from and by, where it is asked for.
    #[cfg(all(feature = "internals", feature = "cpu"))]
    blend_views: Option<(usize, Vec<super::BlendView>)>,
}

/// Whether the frames of the present run are on the accelerator's device.
#[derive(Debug, Default)]
enum Device {
    /// Not asked yet.
    #[default]
    Unknown,
    /// They are not: all stages but the wavelet run here.
    Absent,
    Window(Box<dyn AcceleratedWindow>),
}

impl Drop for SequenceDenoiser {
    fn drop(&mut self) {
        self.entries.clear();
        par::forget_spares();
    }
}

impl std::fmt::Debug for SequenceDenoiser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let frames: Vec<i64> = self.entries.iter().map(|entry| entry.frame.number).collect();
        f.debug_struct("SequenceDenoiser").field("frames", &frames).finish_non_exhaustive()
    }
}

impl PreparedFrame {
    /// Finds what only a pair of frames shows, where `next` comes right after this frame: motion to the next frame where files
    /// hold none (the sky), and the motion of what mirrors show. Done by [`SequenceDenoiser::push`]; for frames of which
    /// only rows will be pushed it must be done before.
    pub fn followed_by(&mut self, next: &mut Self, settings: &SequenceSettings, backend: Backend) {
        if self.is_followed_by(next) {
            let times = &mut StageTimes::default();
            self.link(next, stages_of(backend), &SequencePlan::new(settings), settings, times);
        }
    }

    fn link(
        &mut self,
        next: &mut Self,
        stages: &SequenceStages,
        plan: &SequencePlan,
        s: &SequenceSettings,
        times: &mut StageTimes,
    ) {
        if self.features.lacks_motion_to_next() {
            self.features.derive_motion_to_next(&next.features);
        }
        // Bands of rows bring what was found in the whole picture.
        if self.features.motion.reflection_to_next.is_none() {
            run::link(stages, plan, &mut self.features, &mut next.features, s, times);
        }
    }
}

impl SequenceDenoiser {
    /// On the fastest back end of this processor. Nothing is allocated before the first frame.
    ///
    /// # Errors
    /// [`Error::ParameterValue`] for a setting out of its range.
    pub fn new(settings: SequenceSettings) -> Result<Self, Error> {
        Self::with_backend(settings, Backend::default())
    }

    /// On a chosen back end; [`Backend::Reference`] is slow.
    ///
    /// # Errors
    /// As [`SequenceDenoiser::new`].
    pub fn with_backend(settings: SequenceSettings, backend: Backend) -> Result<Self, Error> {
        settings.check()?;
        let plan = SequencePlan::new(&settings);
        Ok(Self {
            settings,
            plan,
            stages: stages_of(backend),
            entries: VecDeque::new(),
            done: 0,
            accelerator: None,
            device: Device::Unknown,
            times: StageTimes::default(),
            #[cfg(all(feature = "internals", feature = "cpu"))]
            blend_views: None,
        })
    }

    /// Stages that `accelerator` can run, run there.
    ///
    /// # Errors
    /// As [`SequenceDenoiser::new`].
    pub fn with_accelerator(settings: SequenceSettings, accelerator: Arc<dyn Accelerator>) -> Result<Self, Error> {
        let mut denoiser = Self::new(settings)?;
        denoiser.accelerator = Some(accelerator);
        Ok(denoiser)
    }

    /// Keeps what the nets of `stabilise` and `blend` choose from and by, of every frame that comes out, for their training; taps of
    /// one pixel in `every` (0: none).
    #[cfg(all(feature = "internals", feature = "cpu"))]
    pub fn keep_blend_views(&mut self, every: usize) {
        self.blend_views = Some((every, Vec::new()));
    }

    /// Those of the frames that came out since the last call.
    #[cfg(all(feature = "internals", feature = "cpu"))]
    pub fn take_blend_views(&mut self) -> Vec<super::BlendView> {
        self.blend_views.as_mut().map(|(_, views)| std::mem::take(views)).unwrap_or_default()
    }

    /// From now on every stage is timed by `clock`: seconds that only rise, of the clock on the wall or of processors.
    pub fn time_stages(&mut self, clock: fn() -> f64) {
        self.times.clock = Some(clock);
    }

    /// What each stage took since the last call: its name, seconds, and how often it ran. Nothing without [`Self::time_stages`].
    /// Stages on a device are not told apart and stand nowhere.
    pub fn take_stage_times(&mut self) -> Vec<(&'static str, f64, usize)> {
        std::mem::take(&mut self.times.taken)
    }

    /// The stages that run, in order.
    pub fn plan(&self) -> &SequencePlan {
        &self.plan
    }

    /// Frames on each side of a wanted one that take part in it.
    pub fn reach(&self) -> usize {
        self.plan.frames()
    }

    /// Rows above and below a band that decide it, where no surface moves up or down by more than `moved` rows a frame. A
    /// band with as many rows around it is filtered to the bits of the whole picture.
    pub fn margin(&self, moved: f32, picture_height: usize) -> usize {
        self.plan.rows(moved, self.settings.gather.travel * picture_height as f32)
    }

    /// Takes the next frame; `wanted`: it is to come out, not only to help its neighbours. What comes out is complete, in
    /// order. A number that does not follow, another size or other lights are a cut: what waited comes out first.
    ///
    /// # Errors
    /// [`Error::EmptySize`], [`Error::PlaneSize`]: the frame is left out and the denoiser unchanged.
    /// [`Error::Accelerator`]: as [`Self::push_to`].
    pub fn push(&mut self, frame: SequenceFrame, wanted: bool) -> Result<Vec<Filtered>, Error> {
        let mut out = Vec::new();
        self.push_to(PreparedFrame::new(frame, &self.settings)?, wanted, &mut |filtered| {
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
        mut frame: PreparedFrame,
        wanted: bool,
        out: &mut dyn FnMut(Filtered) -> bool,
    ) -> Result<(), Error> {
        if self.entries.back().is_some_and(|last| !last.frame.is_followed_by(&frame)) {
            self.finish_to(out)?;
        }
        if let Some(last) = self.entries.back_mut() {
            last.frame.link(&mut frame, self.stages, &self.plan, &self.settings, &mut self.times);
        }
        self.entries.push_back(Entry { frame, wanted, estimate: None });
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
        self.device = Device::Unknown;
    }

    /// Frames whose window is complete, or all where the sequence ends.
    fn ready(&mut self, ends: bool, out: &mut dyn FnMut(Filtered) -> bool) -> Result<(), Error> {
        let steady = self.settings.stabilise.frames as usize;
        let future = self.settings.gather.future;
        while self.done < self.entries.len() {
            let t = self.done;
            let last = self.entries.len() - 1;
            let needed = if future { t + self.plan.frames() } else { t };
            if !ends && last < needed {
                break;
            }
            let mut go_on = true;
            if self.entries[t].wanted {
                let (from, to) = (t.saturating_sub(steady), if future { (t + steady).min(last) } else { t });
                for i in from..=to {
                    if self.entries[i].estimate.is_none() {
                        let estimate = self.estimate(i).inspect_err(|_| self.clear())?;
                        self.entries[i].estimate = Some(estimate);
                        self.entries[i].frame.estimated();
                        if i < t || !self.entries[i].wanted {
                            // It only helps its neighbours: nobody asks for its lights.
                            self.given_out(i);
                        }
                    }
                }
                if let Some(filtered) = self.result(t, from, to).inspect_err(|_| self.clear())? {
                    // Neighbours still read the picture, nobody the lights: frames are large.
                    self.given_out(t);
                    go_on = out(filtered);
                }
            }
            self.given_out(t);
            self.done += 1;
            self.forget();
            if !go_on {
                break;
            }
        }
        Ok(())
    }

    fn given_out(&mut self, t: usize) {
        let Some(entry) = self.entries.get_mut(t) else { return };
        if let Some(estimate) = &mut entry.estimate {
            estimate.colours = Rows::empty();
            estimate.slots = Vec::new();
            estimate.samples = Plane::filled(Size::new(0, 0), 0.0);
            entry.frame.given_out();
        }
    }

    /// Drops what no later frame can reach.
    fn forget(&mut self) {
        let gather = self.settings.gather.frames as usize;
        let steady = self.settings.stabilise.frames as usize;
        let kept = self.done.saturating_sub(steady);
        // A later frame may need an estimate that is still to be made, and that the frames around it.
        let next =
            (kept..self.entries.len()).find(|&i| self.entries[i].estimate.is_none()).unwrap_or(self.entries.len());
        let kept = kept.min(next.saturating_sub(gather));
        self.entries.drain(..kept);
        self.done -= kept;
    }

    fn estimate(&mut self, i: usize) -> Result<Estimate, Error> {
        let Self { settings: s, plan, stages, entries, accelerator, device, times, .. } = self;
        let gather = s.gather.frames as usize;
        // What came after it takes no part where `gather` looks back alone.
        let to = if s.gather.future { (i + gather).min(entries.len() - 1) } else { i };
        let from = i.saturating_sub(gather);
        let window: Vec<&PreparedFrame> = (from..=to).map(|k| &entries[k].frame).collect();
        let frame = window[i - from];
        if let Some(accelerator) = accelerator.as_deref() {
            if matches!(device, Device::Unknown) {
                *device = accelerator.window().map_or(Device::Absent, Device::Window);
            }
            if let Device::Window(there) = device {
                let mut job = EstimateJob::new(&window, i - from, s);
                if there.estimate(&mut job).map_err(|reason| accelerator::failed(accelerator, reason))? {
                    let (slots, colours, samples) = job.estimated();
                    let picture = (stages.sum)(frame, &slots, &colours);
                    let input = (stages.input)(frame, &slots, &colours);
                    return Ok(Estimate {
                        fits_device: run::fits_device([&picture, &input], frame.alpha.as_ref()),
                        slots,
                        colours,
                        picture,
                        input,
                        samples,
                        likeness: None,
                        signature: None,
                    });
                }
            }
        }
        run::estimate(stages, plan, &window, i - from, s, (accelerator.as_deref(), times))
    }

    fn result(&mut self, t: usize, from: usize, to: usize) -> Result<Option<Filtered>, Error> {
        let made = self.finish_on_device(from, to, t)?;
        let compares = made.is_none();
        #[cfg(all(feature = "internals", feature = "cpu"))]
        let compares = compares || self.blend_views.is_some();
        if compares {
            self.compare_by(from, to);
        }
        let frames = around(&self.entries, from, to);
        let Some((entry, estimate)) = self.entries.get(t).and_then(|e| Some((e, e.estimate.as_ref()?))) else {
            return Ok(None);
        };
        #[cfg(all(feature = "internals", feature = "cpu"))]
        if let Some((every, views)) = &mut self.blend_views {
            views.push(run::blend_view(self.stages, &frames, t - from, *every, &self.settings));
        }
        let times = (made, &mut self.times);
        let run::Finished { passes, alpha, noise } =
            run::finish(self.stages, &self.plan, &frames, t - from, &self.settings, times);
        let samples = estimate.samples.clone();
        let full = self.settings.variance.confident_samples;
        let confidence = par::plane(samples.size(), |x, y| (samples.at(x, y) / full).min(1.0));
        let lights = with_weights(&entry.frame, passes);
        let (number, repaired) = (entry.frame.number, entry.frame.repaired);
        Ok(Some(Filtered { number, lights, alpha, confidence, samples, noise, repaired }))
    }

    /// Stages `stabilise` to `blend`, where the frames of the run are on a device that runs them.
    fn finish_on_device(&mut self, from: usize, to: usize, t: usize) -> Result<Option<Finish>, Error> {
        let (Device::Window(there), Some(accelerator)) = (&mut self.device, self.accelerator.as_deref()) else {
            return Ok(None);
        };
        let frames = around(&self.entries, from, to);
        let Some(mut job) = FinishJob::new(&frames, t - from, &self.plan, &self.settings) else { return Ok(None) };
        let made = there.finish(&mut job).map_err(|reason| accelerator::failed(accelerator, reason))?;
        Ok(if made { job.made() } else { None })
    }

    /// Finds by what `stabilise` compares the pixels of these frames, where it is not known yet.
    fn compare_by(&mut self, from: usize, to: usize) {
        if !self.plan.runs(SequenceStage::Stabilise) {
            return;
        }
        let Self { settings: SequenceSettings { stabilise: s, .. }, stages, entries, times, .. } = self;
        for Entry { frame, estimate, .. } in entries.range_mut(from..=to) {
            let Some(estimate) = estimate.as_mut().filter(|e| e.signature.is_none() && e.likeness.is_none()) else {
                continue;
            };
            times.during("stabilise: signature", || {
                if s.net {
                    estimate.signature = Some(stabilise::kept((stages.signature)(&frame.features, &estimate.picture)));
                } else {
                    estimate.likeness = Some((stages.likeness)(&estimate.picture, &estimate.input, s));
                }
            });
        }
    }
}

/// Frames that take part in one, as far as they were estimated: all.
fn around(entries: &VecDeque<Entry>, from: usize, to: usize) -> Vec<(&PreparedFrame, &Estimate)> {
    entries.range(from..=to).filter_map(|e| Some((&e.frame, e.estimate.as_ref()?))).collect()
}

/// The passes of a frame with their weights as they came; lights of one surface share them.
fn with_weights(frame: &PreparedFrame, planes: Vec<Vec<Plane<Rgb>>>) -> Vec<FilteredLight> {
    let size = frame.features.size;
    let mut shared: Vec<(*const Weight, Arc<Plane<Rgb>>)> = Vec::new();
    let mut whole = |weight: &Arc<Weight>| {
        let known = shared.iter().find(|(other, _)| std::ptr::eq(*other, Arc::as_ptr(weight)));
        let plane = known.map_or_else(|| Arc::new(weight.plane(size)), |(_, plane)| Arc::clone(plane));
        shared.push((Arc::as_ptr(weight), Arc::clone(&plane)));
        plane
    };
    let lights = frame.slots.iter().zip(planes);
    lights
        .map(|(slot, planes)| FilteredLight { planes, weight: frame.weights[slot.light].as_ref().map(&mut whole) })
        .collect()
}
