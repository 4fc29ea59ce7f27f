//! The fast back end: the stages' `cpu.rs` under the schedules of `passes/`, on all threads, vectorised for the
//! machine at hand. The same bits come out at any number of threads and on every instruction set.
//!
//! Images live in phase order ([`crate::phased`]), signals with their passes in one buffer; a buffer rests as soon as no
//! later step reads its image, and is used again (`buffers.rs`). History is swapped, not copied.

mod buffers;
mod passes;
pub(crate) mod sequence;
pub(crate) mod traffic;

use crate::border::{PlaneName, Sanitised};
use crate::error::Error;
use crate::frame::{Frame, Rgb, Signal};
use crate::history::Validity;
use crate::kernels::edge_cpu::Gains;
use crate::kernels::spiral::{Spiral, SpiralShape};
use crate::kernels::temporal::Blend;
use crate::phased::guides::{CpuGuides, copy_colours, read_colours};
use crate::phased::layout::{Colours, Phases};
use crate::pipeline::{Image, Plan, Stage, Step};
use crate::plane::{Plane, Size};
use crate::report::StageTimes;
use crate::settings::Settings;
use crate::stages::antialiasing::cpu::History as PictureHistory;
use crate::stages::glossy_bilateral::Axis;
use crate::stages::young_filter as young;
use buffers::Buffers;
use fearless_simd::Level;
use passes::{
    antialiasing, change, composite, direct_taa, disocclusion, firefly, glossy_bilateral, sparse_bilateral, temporal,
    young_filter,
};

/// Confidence and history length of a signal.
#[derive(Clone, Debug)]
struct Memory {
    confidence: Plane<f32>,
    length: Plane<f32>,
    /// The length in phase order, of this frame and of the one before.
    kept: Vec<f32>,
    kept_before: Vec<f32>,
    /// The fast history, where light's changes are looked for: the same.
    fast: Vec<f32>,
    fast_before: Vec<f32>,
}

impl Memory {
    fn new(size: Size) -> Self {
        let (one, kept) = (Plane::filled(size, 1.0), vec![1.0; size.pixels()]);
        Self {
            confidence: one.clone(),
            length: one,
            kept: kept.clone(),
            kept_before: kept,
            fast: Vec::new(),
            fast_before: Vec::new(),
        }
    }
}

/// The images that a frame leaves for its caller, in the host's order.
#[derive(Clone, Debug, Default)]
struct Shown {
    image: Option<Image>,
    planes: Vec<Plane<Rgb>>,
}

/// The fast back end for one image size.
#[derive(Clone, Debug)]
pub struct Cpu {
    level: Level,
    phases: Phases,
    guides: Option<CpuGuides>,
    buffers: Buffers,
    /// Buffer lengths in use: planes of the signals.
    planes: [usize; 2],
    memory: [Option<Memory>; 2],
    /// Whether stage 3, and stage 8, ran in the last frame.
    accumulated: [bool; 2],
    history: [Option<Colours>; 2],
    direct_history: Option<Colours>,
    /// Of the frame before, and room for this one's.
    picture_history: Option<PictureHistory>,
    picture_room: PictureHistory,
    /// Matte, glossy, direct, composite.
    shown: [Shown; 4],
    spiral: Spiral,
    /// Radii of the glossy kernel, from stage 9 to stage 10.
    radius: Option<Colours>,
    /// Where stage 3 found each surface, which stage 8 reads, and whether it did so in this frame.
    seen: Vec<f32>,
    seen_now: bool,
    /// Variance of luminance between the levels of `young_filter`, in phase order.
    noise: [Vec<f32>; 2],
    /// Where the light of a history has changed, in phase order, and room to find it.
    change: (change::Room, Vec<f32>),
}

/// Places in `Cpu::shown` after those of the signals.
const DIRECT: usize = 2;
const COMPOSITE: usize = 3;

impl Cpu {
    /// Room for frames of `size`.
    pub fn new(size: Size) -> Self {
        Self::with_level(size, Level::new())
    }

    /// On a chosen instruction set.
    fn with_level(size: Size, level: Level) -> Self {
        Self {
            level,
            phases: Phases::new(size),
            guides: None,
            buffers: Buffers::default(),
            planes: [1; 2],
            memory: [None, None],
            accumulated: [false; 2],
            history: [None, None],
            direct_history: None,
            picture_history: None,
            picture_room: PictureHistory::default(),
            shown: Default::default(),
            spiral: Spiral::empty(),
            radius: None,
            seen: Vec::new(),
            seen_now: false,
            noise: Default::default(),
            change: Default::default(),
        }
    }

    /// Runs one frame that has been checked.
    #[inline(never)] // benchmarks/instructions.py counts it
    pub fn run(
        &mut self,
        frame: &Frame<'_>,
        settings: &Settings,
        plan: &Plan,
        valid: Validity,
        sanitised: &mut Sanitised,
        times: &mut StageTimes,
    ) -> Result<(), Error> {
        let view = frame.camera.projection(frame.size).ok_or(Error::Camera { which: "camera" })?;
        self.open(frame);
        // Taken out while the passes borrow it.
        let mut guides = self.guides.take().unwrap_or_else(|| CpuGuides::new(self.phases, view));
        let result = guides.read(self.level, frame, sanitised);
        if result.is_ok() {
            for (i, step) in plan.steps.iter().enumerate() {
                if step.stage == Stage::Composite {
                    times.measure(step.stage, || self.composite(frame, plan, sanitised));
                    continue;
                }
                if step.stage == Stage::Antialiasing {
                    times.measure(step.stage, || self.antialias(settings, &guides, valid));
                    continue;
                }
                self.read(frame, step.input, sanitised);
                let later = &plan.steps[i + 1..];
                times.measure(step.stage, || self.step(step, frame.index, settings, &guides, valid));
                times.measure(step.stage, || self.retire(plan, later));
            }
            self.close(plan);
        }
        if !plan.runs(Stage::Antialiasing) {
            self.picture_history = None;
            self.picture_room = PictureHistory::default();
        }
        self.guides = Some(guides);
        result
    }

    /// An image of the last frame in the host's order, the signal, then its passes: of those that [`crate::Output`]
    /// shows.
    pub fn image(&self, image: Image) -> Option<&[Plane<Rgb>]> {
        self.shown.iter().find(|s| s.image == Some(image)).map(|s| s.planes.as_slice())
    }

    /// Confidence and history length of a signal in the last frame.
    pub fn temporal(&self, signal: Signal) -> Option<(&Plane<f32>, &Plane<f32>)> {
        let memory = self.memory[signal as usize].as_ref().filter(|_| self.accumulated[signal as usize])?;
        Some((&memory.confidence, &memory.length))
    }

    fn open(&mut self, frame: &Frame<'_>) {
        for shown in &mut self.shown {
            shown.image = None;
            for plane in shown.planes.drain(..) {
                self.buffers.give_plane(plane);
            }
        }
        self.buffers.clear();
        self.accumulated = [false; 2];
        self.seen_now = false;
        let planes = Signal::ALL.map(|s| 1 + frame.passes.iter().filter(|p| p.signal == s).count());
        if planes != self.planes {
            self.planes = planes;
            let pixels = self.phases.size.pixels();
            self.buffers.retain(&[pixels, pixels * planes[0], pixels * planes[1]]);
        }
        for memory in self.memory.iter_mut().flatten() {
            std::mem::swap(&mut memory.kept, &mut memory.kept_before);
            std::mem::swap(&mut memory.fast, &mut memory.fast_before);
        }
    }

    /// Shows an input image that no stage reads: it stays in the host's order.
    fn show_input(&mut self, frame: &Frame<'_>, image: Image, place: usize, sanitised: &mut Sanitised) {
        let Some((signal, name)) = input_of(image) else { return };
        let source = signal.map_or(frame.direct, |s| frame.signal(s));
        let passes = frame.passes.iter().filter(|p| Some(p.signal) == signal);
        let sources = std::iter::once((source, name)).chain(passes.map(|p| (Some(p.plane), PlaneName::Passes)));
        for (source, name) in sources {
            let buffer = self.buffers.take(self.phases.size.pixels(), 1);
            // The length is right by construction.
            if let Ok(mut target) = Plane::from_vec(self.phases.size, buffer.data) {
                copy_colours(self.level, source, &mut target, name, sanitised);
                self.shown[place].planes.push(target);
            }
        }
    }

    /// Reads an input image when the first step asks for it.
    fn read(&mut self, frame: &Frame<'_>, image: Image, sanitised: &mut Sanitised) {
        if self.buffers.get(image).is_some() {
            return;
        }
        let Some((signal, name)) = input_of(image) else { return };
        let source = signal.map_or(frame.direct, |s| frame.signal(s));
        let planes = signal.map_or(1, |s| self.planes[s as usize]);
        let mut colours = self.buffers.take(self.phases.size.pixels(), planes);
        match source {
            Some(source) => read_colours(self.level, &self.phases, source, &mut colours, 0, name, sanitised),
            None => colours.elements_mut().fill(0.0),
        }
        let passes = frame.passes.iter().filter(|p| Some(p.signal) == signal);
        for (k, pass) in passes.enumerate() {
            read_colours(self.level, &self.phases, pass.plane, &mut colours, k + 1, PlaneName::Passes, sanitised);
        }
        self.buffers.insert(image, colours);
    }

    fn step(&mut self, step: &Step, index: i64, settings: &Settings, guides: &CpuGuides, validity: Validity) {
        let (phases, level) = (self.phases, self.level);
        let pixels = phases.size.pixels();
        // The plan guarantees it; a mistake in it shows as a missing output, not as a panic.
        let Some(input) = self.buffers.remove(step.input) else { return };
        let mut output = self.buffers.take(pixels, input.planes);
        match step.stage {
            Stage::MatteTemporal | Stage::GlossyTemporal => {
                let (signal, valid) = match step.stage {
                    Stage::MatteTemporal => (Signal::Matte, validity.matte),
                    _ => (Signal::Glossy, validity.glossy),
                };
                let memory = self.memory[signal as usize].get_or_insert_with(|| Memory::new(phases.size));
                self.accumulated[signal as usize] = true;
                let Memory { confidence, length, kept, kept_before, fast, fast_before } = memory;
                let change = match signal {
                    Signal::Matte => Blend::matte(settings).change,
                    Signal::Glossy => Blend::glossy(settings).change,
                };
                // Without the detector there is no fast history.
                fast.resize(if change.is_some() { pixels } else { 0 }, 0.0);
                let mut fast = Some(fast.as_mut_slice()).filter(|fast| !fast.is_empty());
                let history = self.history[signal as usize].take();
                match history.as_ref().filter(|h| valid && h.planes == input.planes) {
                    Some(colours) => {
                        // A fast history that begins with this frame says nothing of the long one.
                        let change = change.filter(|_| fast_before.len() == pixels);
                        let (room, changed) = &mut self.change;
                        if let Some(change) = &change {
                            changed.resize(pixels, 0.0);
                            let left = change::Left { colours, length: kept_before, fast: fast_before };
                            change::run(level, &phases, change, left, room, changed);
                        }
                        let found = change.map(|_| (changed.as_slice(), fast_before.as_slice()));
                        let remembered = temporal::Remembered { colours, length: kept_before, change: found };
                        let reads = self.seen_now && signal == Signal::Glossy;
                        let writes = signal == Signal::Matte
                            && settings.glossy_temporal.enabled
                            && validity.glossy
                            && temporal::mirrors(settings, guides);
                        if writes {
                            self.seen.resize(pixels, 0.0);
                            self.seen_now = true;
                        }
                        let (seen, written) = match (reads, writes) {
                            (true, _) => (Some(&*self.seen), None),
                            (_, true) => (None, Some(&mut *self.seen)),
                            _ => (None, None),
                        };
                        let filter = temporal::Filter { level, guides, settings, signal, seen };
                        let memory = temporal::Memory { confidence, length, kept, seen: written, fast: fast.take() };
                        temporal::run(&filter, &input, remembered, &mut output, memory);
                    }
                    None => {
                        let memory = temporal::Memory { confidence, length, kept, seen: None, fast: fast.take() };
                        temporal::begin(guides, &input, memory);
                        output.data.copy_from_slice(&input.data);
                    }
                }
                if let Some(history) = history {
                    self.buffers.give(history);
                }
            }
            Stage::MattePrefilter | Stage::MatteBilateral => {
                let rows = phases.size.height;
                let shape = match step.stage {
                    Stage::MattePrefilter => SpiralShape::prefilter(&settings.matte_prefilter, rows, index),
                    _ => SpiralShape::bilateral(&settings.matte_bilateral, rows, index),
                };
                self.spiral.fill(&shape);
                let gains = Gains::matte(&settings.edge);
                let filter = sparse_bilateral::Filter { level, guides, gains, spiral: &self.spiral, shape };
                sparse_bilateral::run(&filter, &input, &mut output);
            }
            Stage::MatteYoung1
            | Stage::MatteYoung3
            | Stage::MatteYoung9
            | Stage::MatteYoung27
            | Stage::GlossyYoung1
            | Stage::GlossyYoung3
            | Stage::GlossyYoung9 => self.young(step, settings, guides, &input, &mut output),
            Stage::Disocclusion => self.disocclusion(step, settings, &input, &mut output),
            Stage::Firefly => firefly::run(level, guides, &settings.firefly, &input, &mut output),
            Stage::GlossyHorizontal | Stage::GlossyVertical => {
                let axis = if step.stage == Stage::GlossyHorizontal { Axis::Horizontal } else { Axis::Vertical };
                let stage = &settings.glossy_bilateral;
                let mut scratch = match self.radius.take() {
                    Some(radius) => radius,
                    None => {
                        let mut scratch = self.buffers.take(pixels, 1);
                        let (across, rest) = scratch.elements_mut().split_at_mut(pixels);
                        let (down, rest) = rest.split_at_mut(pixels);
                        glossy_bilateral::radius(level, guides, stage, (across, down), &mut rest[..pixels]);
                        scratch
                    }
                };
                let first = if axis == Axis::Horizontal { 0 } else { pixels };
                let radius = &scratch.elements_mut()[first..][..pixels];
                let filter = glossy_bilateral::Filter { level, guides, settings, axis, radius };
                glossy_bilateral::run(&filter, &input, &mut output);
                match axis {
                    Axis::Horizontal => self.radius = Some(scratch),
                    Axis::Vertical => self.buffers.give(scratch),
                }
            }
            Stage::DirectTaa => {
                let history = self.direct_history.take();
                match history.as_ref().filter(|_| validity.direct) {
                    Some(history) => {
                        direct_taa::run(level, guides, &settings.direct_taa, (&input, history), &mut output);
                    }
                    None => output.data.copy_from_slice(&input.data),
                }
                if let Some(history) = history {
                    self.buffers.give(history);
                }
            }
            // Those work in the host's order.
            Stage::Composite | Stage::Antialiasing => {}
        }
        self.buffers.insert(step.input, input);
        self.buffers.insert(step.output, output);
    }

    /// A level of `young_filter`; the plan has it only after the stage whose history lengths it reads.
    fn young(&mut self, step: &Step, settings: &Settings, guides: &CpuGuides, input: &Colours, output: &mut Colours) {
        let Some((signal, level)) = step.stage.young_level() else { return };
        let Some(memory) = self.memory[signal as usize].as_ref() else { return };
        let s = &settings.young_filter;
        let (gains, has_lobe) = match signal {
            Signal::Matte => (Gains::matte(&settings.edge), false),
            Signal::Glossy => (Gains::glossy(&settings.edge), guides.has_roughness),
        };
        // The levels' noise: two buffers that change places.
        let pixels = self.phases.size.pixels();
        let [mut before, mut after] = std::mem::take(&mut self.noise);
        let stops = s.deviations > 0.0;
        let hands_on = young::hands_on(s, signal, level);
        if hands_on {
            after.resize(pixels, 0.0);
        }
        let contrast = young::squared_contrast(s, signal, level);
        let filter = young_filter::Filter {
            level: self.level,
            guides,
            gains,
            length: &memory.kept,
            step: young::step_px(level),
            end: young::ends(s, signal)[level as usize],
            lobe: has_lobe.then(|| young::Lobe::new(s, guides.now.view.focal_px, level)),
            frames: s.frames,
            squared: s.deviations * s.deviations,
            first: if level == 0 { contrast } else { 0.0 },
            further: if level == 0 { 0.0 } else { contrast },
            isolated: if level == 0 { s.isolated } else { 0.0 },
            contact_noise: if s.contact_noise > 0.0 { 1.0 / s.contact_noise } else { 0.0 },
            noise: (stops && level > 0).then_some(before.as_slice()).filter(|noise| noise.len() == pixels),
        };
        let left = hands_on.then_some(after.as_mut_slice());
        young_filter::run(&filter, input, output, left);
        std::mem::swap(&mut before, &mut after);
        self.noise = [before, after];
    }

    fn disocclusion(&mut self, step: &Step, settings: &Settings, input: &Colours, output: &mut Colours) {
        let (phases, level) = (self.phases, self.level);
        let pixels = phases.size.pixels();
        let prefiltered = step.also_reads.iter().find_map(|i| self.buffers.remove(*i).map(|c| (*i, c)));
        let Some((name, prefiltered)) = prefiltered else { return };
        let mut scratch = self.buffers.take(pixels, 1);
        if let Some(memory) = &self.memory[Signal::Matte as usize] {
            let (distrust, rest) = scratch.elements_mut().split_at_mut(pixels);
            let stage = &settings.disocclusion;
            disocclusion::distrust(level, &phases, &memory.confidence, stage, distrust, &mut rest[..pixels]);
            let images = (input, &prefiltered);
            let output = (output, stage.floor);
            if step.also_writes.contains(&Image::MatteFloored) {
                let floor = stage.floor.max(stage.feedback_floor);
                let mut floored = self.buffers.take(pixels, input.planes);
                disocclusion::run(level, &phases, images, distrust, output, Some((&mut floored, floor)));
                self.buffers.insert(Image::MatteFloored, floored);
            } else {
                disocclusion::run(level, &phases, images, distrust, output, None);
            }
        }
        self.buffers.give(scratch);
        self.buffers.insert(name, prefiltered);
    }

    /// Shows the images that no later step filters, and frees their buffers.
    fn retire(&mut self, plan: &Plan, later: &[Step]) {
        let outputs = [plan.matte_output, plan.glossy_output, plan.direct_output];
        let feedback = [plan.matte_feedback, plan.glossy_feedback];
        for image in ALL_IMAGES {
            let direct_feedback = image == Image::DirectAntialiased;
            if later.iter().any(|s| reads(s, image)) {
                continue;
            }
            let Some(colours) = self.buffers.remove(image) else { continue };
            let unshown = outputs.iter().position(|o| *o == image).filter(|p| self.shown[*p].image.is_none());
            if let Some(place) = unshown {
                self.buffers.show(self.level, &self.phases, &colours, &mut self.shown[place].planes);
                self.shown[place].image = Some(image);
            }
            if feedback.contains(&Some(image)) || direct_feedback {
                self.buffers.insert(image, colours);
            } else {
                self.buffers.give(colours);
            }
        }
    }

    fn composite(&mut self, frame: &Frame<'_>, plan: &Plan, sanitised: &mut Sanitised) {
        // Images that no stage has touched are still with the frame.
        let outputs = [
            frame.matte.map(|_| plan.matte_output),
            frame.glossy.map(|_| plan.glossy_output),
            Some(plan.direct_output),
        ];
        for (place, image) in outputs.into_iter().enumerate() {
            let Some(image) = image.filter(|_| self.shown[place].image.is_none()) else { continue };
            self.show_input(frame, image, place, sanitised);
            self.shown[place].image = Some(image);
        }
        let Ok(mut output) = Plane::from_vec(self.phases.size, self.buffers.take(self.phases.size.pixels(), 1).data)
        else {
            return; // the length is right by construction
        };
        let signals = [0, 1].map(|s| self.shown[s].planes.first());
        if let Some(direct) = self.shown[DIRECT].planes.first() {
            composite::run(self.level, frame, direct, signals, &mut output, sanitised);
            self.shown[COMPOSITE].image = Some(Image::Composite);
            self.shown[COMPOSITE].planes.push(output);
        }
    }

    /// The picture takes the place of the sum.
    fn antialias(&mut self, settings: &Settings, guides: &CpuGuides, validity: Validity) {
        let Some(sum) = self.shown[COMPOSITE].planes.pop() else { return };
        let Ok(mut output) = Plane::from_vec(self.phases.size, self.buffers.take(self.phases.size.pixels(), 1).data)
        else {
            return; // the length is right by construction
        };
        let history = self.picture_history.take();
        let mut kept = std::mem::take(&mut self.picture_room);
        let before = history.as_ref().filter(|_| validity.picture);
        antialiasing::run(self.level, guides, &settings.antialiasing, (&sum, before), &mut output, &mut kept);
        self.picture_room = history.unwrap_or_default();
        self.picture_history = Some(kept);
        self.buffers.give_plane(sum);
        self.shown[COMPOSITE].image = Some(Image::Antialiased);
        self.shown[COMPOSITE].planes.push(output);
    }

    fn close(&mut self, plan: &Plan) {
        for (history, feedback) in self.history.iter_mut().zip([plan.matte_feedback, plan.glossy_feedback]) {
            // A history that no stage has consumed is out of date.
            if let Some(old) = history.take() {
                self.buffers.give(old);
            }
            *history = feedback.and_then(|image| self.buffers.remove(image));
        }
        if let Some(old) = self.direct_history.take() {
            self.buffers.give(old);
        }
        self.direct_history = self.buffers.remove(Image::DirectAntialiased);
    }
}

/// The signal of an input image, and the name of its plane; direct light belongs to no signal.
fn input_of(image: Image) -> Option<(Option<Signal>, PlaneName)> {
    match image {
        Image::MatteInput => Some((Some(Signal::Matte), PlaneName::Matte)),
        Image::GlossyInput => Some((Some(Signal::Glossy), PlaneName::Glossy)),
        Image::DirectInput => Some((None, PlaneName::Direct)),
        _ => None,
    }
}

/// Whether a step filters or blends an image (the composite reads what is shown).
fn reads(step: &Step, image: Image) -> bool {
    !matches!(step.stage, Stage::Composite | Stage::Antialiasing)
        && (step.input == image || step.also_reads.contains(&image))
}

/// Images that hold colours.
const ALL_IMAGES: [Image; 19] = [
    Image::MatteInput,
    Image::MatteTemporal,
    Image::MatteYoung1,
    Image::MatteYoung3,
    Image::MatteYoung9,
    Image::MatteYoung27,
    Image::MattePrefiltered,
    Image::MatteBlended,
    Image::MatteFloored,
    Image::MatteMedian,
    Image::MatteFiltered,
    Image::GlossyInput,
    Image::GlossyTemporal,
    Image::GlossyYoung1,
    Image::GlossyYoung3,
    Image::GlossyYoung9,
    Image::GlossyHorizontal,
    Image::GlossyFiltered,
    Image::DirectAntialiased,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::frame::FrameBuf;
    use crate::pipeline::Inputs;

    /// A bumpy plane seen by a camera that moves.
    fn frame(size: Size, index: i64) -> FrameBuf {
        let camera = |i: i64| {
            let mut c = Camera::perspective([0.02 * i as f32, 0.0, 3.0], [0.1, -0.1, -1.0], [0.0, 1.0, 0.0], 0.9, 1.6);
            c.jitter = [0.3, -0.2];
            c
        };
        let mut f = FrameBuf::new(size, camera(index));
        (f.previous_camera, f.index) = (camera(index - 1), index);
        let noise = |k: usize| {
            Plane::from_fn(size, |x, y| [(x * 7 + y * 13 + k * 5) % 11, (x * k) % 5, y % 3].map(|v| v as f32 * 0.3))
        };
        (f.matte, f.glossy, f.direct) = (Some(noise(index as usize)), Some(noise(9)), Some(noise(4)));
        f.view_depth = Some(Plane::from_fn(size, |x, y| 2.5 + 0.003 * ((x * x + y) % 17) as f32));
        f.normal = Some(Plane::from_fn(size, |x, _| [0.1 * (x % 3) as f32, 0.0, 1.0]));
        f.roughness = Some(Plane::from_fn(size, |x, _| (x % 10) as f32 * 0.1));
        f.glossy_hit_distance = Some(Plane::filled(size, 2.0));
        f
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let best = Level::new();
        let mut levels = vec![Level::baseline(), best];
        #[cfg(target_arch = "x86_64")]
        levels.extend(best.as_avx2().map(Level::Avx2));
        let size = Size::new(75, 33);
        let mut settings = Settings::default();
        settings.antialiasing.enabled = true;
        settings.matte_prefilter.radius = 200.0;
        settings.glossy_bilateral.max_radius = 64.0;
        let mut first: Option<Vec<Plane<Rgb>>> = None;
        for level in levels {
            let mut cpu = Cpu::with_level(size, level);
            for index in 0..4 {
                let buffer = frame(size, index);
                let frame = buffer.frame(&[]);
                let plan = Plan::new(&settings, Inputs::of(&frame));
                let valid = Validity { matte: index > 0, glossy: index > 0, direct: index > 0, picture: index > 0 };
                let (mut sanitised, mut times) = (Sanitised::default(), StageTimes::default());
                cpu.run(&frame, &settings, &plan, valid, &mut sanitised, &mut times).unwrap();
            }
            let planes: Vec<Plane<Rgb>> = cpu.shown.iter().map(|s| s.planes[0].clone()).collect();
            match &first {
                None => first = Some(planes),
                Some(first) => assert!(*first == planes, "{level:?}"),
            }
        }
    }
}
