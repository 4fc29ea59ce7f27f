//! What the passes are run on: the reference's own images of a fourth frame, after three of history.

use super::device::{By, Job, Output, colour_and_bytes, colour_bytes, number_bytes};
use crate::suite::frames::{Scene, guides};
use quell::border::Guides;
use quell::gpu::{FrameUniforms, Pass, SettingsUniforms, Storage, beside, pack_guides, pack_spiral};
use quell::kernels::spiral::{Spiral, SpiralShape};
use quell::stages::antialiasing::reference::Accumulated;
use quell::stages::glossy_bilateral::Axis;
use quell::stages::matte_temporal::reference::{Remembered, Temporal};
use quell::stages::{
    antialiasing, composite, direct_taa, disocclusion, firefly, glossy_bilateral, glossy_temporal, matte_bilateral,
    matte_prefilter, matte_temporal, young_filter,
};
use quell::{FrameBuf, Plane, Rgb, Settings, Signal, Size};

/// Frames before the one that is compared.
const BEFORE: usize = 3;

/// A frame and the guides of it and of its predecessors.
pub struct Inputs {
    /// Of the jobs that are made from it.
    pub storage: Storage,
    frames: Vec<FrameBuf>,
    guides: Vec<Guides>,
}

/// Runs a temporal stage over all frames but the last; `None`: there is no history.
type Run = fn(&[Plane<Rgb>], Option<Remembered<'_>>, &Guides, &Settings) -> Temporal;

fn remembered<'a>(temporal: &'a Temporal, guides: &'a Guides) -> Remembered<'a> {
    Remembered { planes: &temporal.planes, length: &temporal.length, fast: temporal.fast.as_ref(), guides }
}

/// History length and fast history as a device keeps them.
fn texels(temporal: &Temporal) -> Option<Plane<f32>> {
    let fast = temporal.fast.as_ref()?;
    Some(Plane::from_fn(fast.size(), |x, y| beside(temporal.length.at(x, y), fast.at(x, y))))
}

fn length_bytes(temporal: &Temporal) -> Vec<u8> {
    number_bytes(texels(temporal).as_ref().unwrap_or(&temporal.length))
}

impl Inputs {
    /// Of a scene, each frame changed by `change`.
    pub fn new(scene: &Scene, size: Size, change: impl Fn(&mut FrameBuf)) -> Self {
        let frames: Vec<FrameBuf> = (0..=BEFORE as i64)
            .map(|i| {
                let mut frame = scene.frame(size, i);
                change(&mut frame);
                frame
            })
            .collect();
        let guides = frames.iter().map(guides).collect();
        Self { storage: Storage::Float, frames, guides }
    }

    fn size(&self) -> Size {
        self.now().size
    }

    fn frame(&self) -> &FrameBuf {
        &self.frames[BEFORE]
    }

    fn now(&self) -> &Guides {
        &self.guides[BEFORE]
    }

    fn before(&self) -> &Guides {
        &self.guides[BEFORE - 1]
    }

    /// A signal, tinted from pixel to pixel: on grey light a swap of channels would not show.
    fn signal(&self, signal: Signal, i: usize) -> Plane<Rgb> {
        let frame = &self.frames[i];
        let plane = if signal == Signal::Matte { &frame.matte } else { &frame.glossy };
        let tint = |x: usize, y: usize, c: usize| 0.5 + 0.1 * ((7 * x + 13 * y + 5 * c + 3 * i) % 11) as f32;
        Plane::from_fn(frame.size, |x, y| {
            let light = plane.as_ref().map_or([0.0; 3], |p| p.at(x, y));
            [0, 1, 2].map(|c| light[c] * tint(x, y, c))
        })
    }

    /// What a temporal stage remembers before the last frame.
    fn history(&self, signal: Signal, run: Run, settings: &Settings) -> Temporal {
        let mut last: Option<Temporal> = None;
        for i in 0..BEFORE {
            let remembered = last.as_ref().map(|t| remembered(t, &self.guides[i - 1]));
            last = Some(run(&[self.signal(signal, i)], remembered, &self.guides[i], settings));
        }
        last.unwrap()
    }

    /// The three planes of guides of this frame.
    fn guide_planes(&self) -> [Vec<u8>; 3] {
        let texels = pack_guides(self.now(), self.storage);
        [texels.geometry, texels.surface, texels.moving]
    }

    /// Those of the frame before that stage 3 or 8 reads.
    fn guide_planes_before(&self, signal: Signal) -> Vec<Vec<u8>> {
        let texels = pack_guides(self.before(), self.storage);
        let mut planes = vec![texels.geometry, texels.surface];
        planes.extend((signal == Signal::Glossy).then_some(texels.moving));
        planes
    }

    fn job(&self, pass: Pass, settings: &Settings, inputs: Vec<Vec<u8>>, colours: Vec<Plane<Rgb>>) -> Job {
        let names = ["first output", "second output"];
        Job {
            pass,
            storage: self.storage,
            size: self.size(),
            frame: FrameUniforms::new(self.now(), Some(self.before())),
            settings: SettingsUniforms::new(settings, self.size()),
            inputs,
            expected: Output {
                by: By::Reference,
                colours: names.into_iter().zip(colours).collect(),
                scalars: Vec::new(),
            },
        }
    }

    /// Stage 3 or 8; `with_history` false: the frame after a cut.
    pub fn temporal(&self, signal: Signal, settings: &Settings, with_history: bool) -> Job {
        let (pass, run): (Pass, Run) = match signal {
            Signal::Matte => (Pass::MATTE_TEMPORAL, matte_temporal::reference::run),
            Signal::Glossy => (Pass::GLOSSY_TEMPORAL, glossy_temporal::reference::run),
        };
        let history = self.history(signal, run, settings);
        let remembered = remembered(&history, self.before());
        let current = self.signal(signal, BEFORE);
        let temporal = run(std::slice::from_ref(&current), with_history.then_some(remembered), self.now(), settings);
        let mut inputs: Vec<Vec<u8>> =
            self.guide_planes().into_iter().chain(self.guide_planes_before(signal)).collect();
        inputs.extend([colour_bytes(&current), colour_bytes(&history.planes[0]), length_bytes(&history)]);
        let mut job = self.job(pass, settings, inputs, temporal.planes.clone());
        if !with_history {
            job.frame = FrameUniforms::new(self.now(), None);
        }
        job.expected.scalars = vec![("confidence", temporal.confidence), ("history length", temporal.length)];
        job.expected.scalars.extend(temporal.fast.map(|fast| ("fast history", fast)));
        job
    }

    /// A plane tied to a signal: a share of it that differs from pixel to pixel.
    fn tied(&self, signal: Signal, i: usize) -> Plane<Rgb> {
        let light = self.signal(signal, i);
        let share = |x: usize, y: usize, c: usize| 0.2 + 0.1 * ((5 * x + 3 * y + 7 * c + i) % 7) as f32;
        Plane::from_fn(light.size(), |x, y| [0, 1, 2].map(|c| light.at(x, y)[c] * share(x, y, c)))
    }

    /// Stage 3 or 8 of a plane tied to its signal.
    pub fn temporal_joint(&self, signal: Signal, settings: &Settings) -> Job {
        let (pass, run): (Pass, Run) = match signal {
            Signal::Matte => (Pass::MATTE_TEMPORAL_JOINT, matte_temporal::reference::run),
            Signal::Glossy => (Pass::GLOSSY_TEMPORAL_JOINT, glossy_temporal::reference::run),
        };
        let planes = |i| [self.signal(signal, i), self.tied(signal, i)];
        let mut last: Option<Temporal> = None;
        for i in 0..BEFORE {
            let remembered = last.as_ref().map(|t| remembered(t, &self.guides[i - 1]));
            last = Some(run(&planes(i), remembered, &self.guides[i], settings));
        }
        let history = last.unwrap();
        let remembered = remembered(&history, self.before());
        let [current, own] = planes(BEFORE);
        let mut inputs: Vec<Vec<u8>> =
            self.guide_planes().into_iter().chain(self.guide_planes_before(signal)).collect();
        inputs.extend([colour_bytes(&current), colour_bytes(&history.planes[0]), length_bytes(&history)]);
        inputs.extend([colour_bytes(&own), colour_bytes(&history.planes[1])]);
        let mut temporal = run(&[current, own], Some(remembered), self.now(), settings);
        let mut job = self.job(pass, settings, inputs, temporal.planes.split_off(1));
        job.expected.scalars = vec![("confidence", temporal.confidence)];
        job
    }

    /// Stage 6 of a plane tied to the matte signal.
    pub fn firefly_joint(&self, settings: &Settings) -> Job {
        let planes = [self.signal(Signal::Matte, BEFORE), self.tied(Signal::Matte, BEFORE)];
        let output = firefly::reference::run(&planes, self.now(), &settings.firefly).split_off(1);
        let [geometry, ..] = self.guide_planes();
        let [input, own] = planes.each_ref().map(colour_bytes);
        self.job(Pass::FIREFLY_JOINT, settings, vec![geometry, input, own], output)
    }

    fn accumulated(&self, settings: &Settings) -> Temporal {
        let history = self.history(Signal::Matte, matte_temporal::reference::run, settings);
        let remembered = remembered(&history, self.before());
        let current = [self.signal(Signal::Matte, BEFORE)];
        matte_temporal::reference::run(&current, Some(remembered), self.now(), settings)
    }

    /// What stage 3 writes: background's confidence is negative.
    fn accumulated_bytes(&self, temporal: &Temporal) -> Vec<u8> {
        let depth = &self.now().depth;
        let signed = Plane::from_fn(self.size(), |x, y| {
            let confidence = temporal.confidence.at(x, y);
            if depth.at(x, y).is_finite() { confidence } else { -confidence }
        });
        colour_and_bytes(&temporal.planes[0], &signed)
    }

    /// Stage 4 or 7, on the accumulated signal.
    pub fn sparse(&self, second: bool, settings: &Settings) -> Job {
        let input = self.accumulated(settings).planes;
        let (index, rows) = (self.frame().index, self.size().height);
        let (pass, shape, output) = if second {
            let shape = SpiralShape::bilateral(&settings.matte_bilateral, rows, index);
            (Pass::MATTE_BILATERAL, shape, matte_bilateral::reference::run(&input, self.now(), settings, index))
        } else {
            let shape = SpiralShape::prefilter(&settings.matte_prefilter, rows, index);
            (Pass::MATTE_PREFILTER, shape, matte_prefilter::reference::run(&input, self.now(), settings, index))
        };
        let [geometry, surface, _] = self.guide_planes();
        let inputs = vec![geometry, surface, pack_spiral(&Spiral::new(&shape)), colour_bytes(&input[0])];
        self.job(pass, settings, inputs, output)
    }

    /// What a level of the filter of young history reads beside guides: the accumulated matte signal, or the glossy one as it came, a
    /// plane tied to it, and the fourth value: confidence, or from level 1 on, with a luminance stop, the noise's deviation.
    fn young_inputs(&self, signal: Signal, level: u32, settings: &Settings) -> (Vec<Plane<Rgb>>, Temporal, Plane<f32>) {
        let temporal = self.accumulated(settings);
        let own = match signal {
            Signal::Matte => temporal.planes[0].clone(),
            Signal::Glossy => self.signal(signal, BEFORE),
        };
        let input = vec![own, self.tied(signal, BEFORE)];
        let read = young_filter::reference::Input { planes: &input, length: &temporal.length, noise: None };
        let noise = young_filter::reference::run(read, self.now(), settings, signal, 0).noise;
        let fourth = match noise.filter(|_| level > 0) {
            Some(noise) => Plane::from_fn(self.size(), |x, y| noise.at(x, y).sqrt()),
            None => temporal.confidence.clone(),
        };
        (input, temporal, fourth)
    }

    fn young_filtered(
        &self,
        (planes, temporal, fourth): &(Vec<Plane<Rgb>>, Temporal, Plane<f32>),
        settings: &Settings,
        (signal, level): (Signal, u32),
    ) -> young_filter::reference::Filtered {
        let noise = Plane::from_fn(self.size(), |x, y| fourth.at(x, y) * fourth.at(x, y));
        let read = young_filter::reference::Input { planes, length: &temporal.length, noise: Some(&noise) };
        young_filter::reference::run(read, self.now(), settings, signal, level)
    }

    /// A level of the filter of young history.
    pub fn young(&self, signal: Signal, level: u32, settings: &Settings) -> Job {
        let inputs = self.young_inputs(signal, level, settings);
        let filtered = self.young_filtered(&inputs, settings, (signal, level));
        let (planes, temporal, fourth) = inputs;
        let pass = match (signal, level) {
            (Signal::Matte, 0) => Pass::MATTE_YOUNG_1,
            (Signal::Matte, 1) => Pass::MATTE_YOUNG_3,
            (Signal::Matte, 2) => Pass::MATTE_YOUNG_9,
            (Signal::Matte, _) => Pass::MATTE_YOUNG_27,
            (Signal::Glossy, 0) => Pass::GLOSSY_YOUNG_1,
            (Signal::Glossy, 1) => Pass::GLOSSY_YOUNG_3,
            (Signal::Glossy, _) => Pass::GLOSSY_YOUNG_9,
        };
        let [geometry, surface, _] = self.guide_planes();
        let accumulated = colour_and_bytes(&temporal.planes[0], &temporal.confidence);
        let signal_bytes = colour_and_bytes(&planes[0], &fourth);
        let read = vec![geometry, surface, signal_bytes, length_bytes(&temporal), accumulated];
        let mut job = self.job(pass, settings, read, filtered.planes[..1].to_vec());
        // The last level before stage 5 hands the confidence on.
        let keeps = signal == Signal::Matte && level == 2 && settings.disocclusion.enabled;
        job.expected.scalars = vec![match filtered.noise.filter(|_| !keeps) {
            Some(noise) => ("deviation", Plane::from_fn(self.size(), |x, y| noise.at(x, y).sqrt())),
            None => ("confidence", temporal.confidence),
        }];
        job
    }

    /// A level for a plane tied to a signal.
    pub fn young_joint(&self, signal: Signal, level: u32, settings: &Settings) -> Job {
        let inputs = self.young_inputs(signal, level, settings);
        let filtered = self.young_filtered(&inputs, settings, (signal, level));
        let (planes, temporal, fourth) = inputs;
        let pass = match (signal, level) {
            (Signal::Matte, 0) => Pass::MATTE_YOUNG_1_JOINT,
            (Signal::Matte, 1) => Pass::MATTE_YOUNG_3_JOINT,
            (Signal::Matte, 2) => Pass::MATTE_YOUNG_9_JOINT,
            (Signal::Matte, _) => Pass::MATTE_YOUNG_27_JOINT,
            (Signal::Glossy, 0) => Pass::GLOSSY_YOUNG_1_JOINT,
            (Signal::Glossy, 1) => Pass::GLOSSY_YOUNG_3_JOINT,
            (Signal::Glossy, _) => Pass::GLOSSY_YOUNG_9_JOINT,
        };
        let [geometry, surface, _] = self.guide_planes();
        let signal_bytes = colour_and_bytes(&planes[0], &fourth);
        let own = colour_bytes(&planes[1]);
        let read = vec![geometry, surface, signal_bytes, length_bytes(&temporal), own];
        self.job(pass, settings, read, filtered.planes[1..].to_vec())
    }

    /// Stage 5, on the outputs of stages 3 and 4.
    pub fn disocclusion(&self, settings: &Settings) -> Job {
        let temporal = self.accumulated(settings);
        let prefiltered = matte_prefilter::reference::run(&temporal.planes, self.now(), settings, self.frame().index);
        let distrust = disocclusion::reference::distrust(&temporal.confidence, &settings.disocclusion);
        let floor = settings.disocclusion.floor;
        let outputs = [floor, floor.max(settings.disocclusion.feedback_floor)]
            .into_iter()
            .flat_map(|least| disocclusion::reference::run(&temporal.planes, &prefiltered, &distrust, least))
            .collect();
        let inputs = vec![self.accumulated_bytes(&temporal), colour_bytes(&prefiltered[0])];
        self.job(Pass::DISOCCLUSION, settings, inputs, outputs)
    }

    /// Stages 5 and 6 in one.
    pub fn disocclusion_firefly(&self, settings: &Settings) -> Job {
        let mut job = self.disocclusion(settings);
        job.pass = Pass::DISOCCLUSION_FIREFLY;
        let [(_, shown), (_, floored)] = &job.expected.colours[..] else { return job };
        let median = firefly::reference::run(std::slice::from_ref(shown), self.now(), &settings.firefly);
        let floored = floored.clone();
        job.expected.colours = vec![("floored", floored), ("median", median[0].clone())];
        job
    }

    /// Stages 3 and 8 in one.
    pub fn both_temporal(&self, settings: &Settings) -> Job {
        let mut job = self.temporal(Signal::Matte, settings, true);
        let mut glossy = self.temporal(Signal::Glossy, settings, true);
        job.pass = Pass::TEMPORAL;
        let matte = job.inputs.split_off(5);
        job.inputs = glossy.inputs.drain(..6).collect();
        job.inputs.extend(matte);
        job.inputs.append(&mut glossy.inputs);
        job.expected.colours.append(&mut glossy.expected.colours);
        job.expected.scalars.append(&mut glossy.expected.scalars);
        job
    }

    /// Stage 6, on the noisy signal.
    pub fn firefly(&self, settings: &Settings) -> Job {
        let input = self.signal(Signal::Matte, BEFORE);
        let output = firefly::reference::run(std::slice::from_ref(&input), self.now(), &settings.firefly);
        let [geometry, ..] = self.guide_planes();
        self.job(Pass::FIREFLY, settings, vec![geometry, colour_bytes(&input)], output)
    }

    /// Stage 9 or 10, on the noisy signal.
    pub fn glossy(&self, axis: Axis, settings: &Settings) -> Job {
        let input = self.signal(Signal::Glossy, BEFORE);
        let pass = match axis {
            Axis::Horizontal => Pass::GLOSSY_HORIZONTAL,
            Axis::Vertical => Pass::GLOSSY_VERTICAL,
        };
        let output = glossy_bilateral::reference::run(std::slice::from_ref(&input), self.now(), settings, axis);
        let inputs = self.guide_planes().into_iter().chain([colour_bytes(&input)]).collect();
        self.job(pass, settings, inputs, output)
    }

    /// Stage 11, on the two noisy signals as direct light and its history.
    pub fn direct_taa(&self, settings: &Settings, with_history: bool) -> Job {
        let (input, history) = (self.signal(Signal::Matte, BEFORE), self.signal(Signal::Matte, BEFORE - 1));
        let remembered = with_history.then_some(&history);
        let output = direct_taa::reference::run(&input, remembered, self.now(), &settings.direct_taa);
        let [geometry, _, moving] = self.guide_planes();
        let inputs = vec![geometry, moving, colour_bytes(&input), colour_bytes(&history)];
        let mut job = self.job(Pass::DIRECT_TAA, settings, inputs, vec![output]);
        if !with_history {
            job.frame = FrameUniforms::new(self.now(), None);
        }
        job
    }

    /// The picture's anti-aliasing, on two noisy signals as the sum and its history, which holds other numbers of frames from pixel to
    /// pixel, none here and there.
    pub fn antialiasing(&self, settings: &Settings, with_history: bool) -> Job {
        let input = self.signal(Signal::Matte, BEFORE);
        let frames = Plane::from_fn(self.size(), |x, y| ((5 * x + 3 * y) % 7).saturating_sub(1) as f32 * 1.7);
        let history = Accumulated { picture: self.signal(Signal::Matte, BEFORE - 1), frames };
        let remembered = with_history.then_some(&history);
        let found = antialiasing::reference::run(&input, remembered, self.now(), &settings.antialiasing);
        let [geometry, _, moving] = self.guide_planes();
        let inputs = vec![geometry, moving, colour_bytes(&input), colour_and_bytes(&history.picture, &history.frames)];
        let outputs = vec![found.picture.clone(), found.picture];
        let mut job = self.job(Pass::ANTIALIASING, settings, inputs, outputs);
        job.expected.scalars = vec![("frames of history", found.frames)];
        if !with_history {
            job.frame = FrameUniforms::new(self.now(), None);
        }
        job
    }

    /// The sum of direct light and the terms that `there` names: matte, glossy, noisy direct light of each.
    pub fn composite(&self, settings: &Settings, there: [bool; 4]) -> Job {
        let frame = self.frame();
        let plane = |p: &Option<Plane<Rgb>>| p.clone().unwrap_or(Plane::filled(frame.size, [0.0; 3]));
        let direct = plane(&frame.direct);
        let signals = [
            self.signal(Signal::Matte, BEFORE),
            self.signal(Signal::Glossy, BEFORE),
            self.signal(Signal::Matte, 0),
            self.signal(Signal::Glossy, 1),
        ];
        let weights = [plane(&frame.matte_weight), plane(&frame.glossy_weight)];
        let terms: Vec<_> = (0..4).filter(|i| there[*i]).map(|i| (&signals[i], &weights[i % 2])).collect();
        let output = composite::reference::run(&direct, &terms);
        let inputs = std::iter::once(&direct).chain(&signals).chain(&weights).map(colour_bytes).collect();
        let mut job = self.job(Pass::COMPOSITE, settings, inputs, vec![output]);
        job.settings = job.settings.with_terms(there[0], there[1], there[2], there[3]);
        job
    }

    /// The sum of direct light and both signals as they are, whatever is bound as weights.
    pub fn unweighted(&self, settings: &Settings) -> Job {
        let mut job = self.composite(settings, [true, true, false, false]);
        job.settings = job.settings.with_weights(false, false);
        let direct = self.frame().direct.clone().unwrap_or(Plane::filled(self.size(), [0.0; 3]));
        let one = Plane::filled(self.size(), [1.0; 3]);
        let signals = Signal::ALL.map(|signal| self.signal(signal, BEFORE));
        let terms: Vec<_> = signals.iter().map(|signal| (signal, &one)).collect();
        job.expected.colours[0].1 = composite::reference::run(&direct, &terms);
        job
    }
}
