//! From the plan to the program: which stages share a pass, where each image lies, what every pass binds.

use super::inputs::GuidePlane;
use super::pass::{Binding, BindingKind, Pass, Sample};
use super::program::{Bound, Contents, Dispatch, Holds, Program, Resource, Role, Shown, SignalContents};
use super::slot::Slot;
use super::storage::{Storage, Texel};
use crate::frame::Signal;
use crate::pipeline::{Image, Plan, Stage, Step};

/// A resource and which copy.
type Source = (Slot, bool);

pub(super) struct Builder<'a> {
    plan: &'a Plan,
    contents: Contents,
    resources: Vec<Resource>,
}

const GUIDES: [Source; 3] = [(Slot::Geometry, false), (Slot::Surface, false), (Slot::Moving, false)];
const GUIDES_BEFORE: [Source; 2] = [(Slot::Geometry, true), (Slot::Surface, true)];

impl<'a> Builder<'a> {
    pub(super) const fn new(plan: &'a Plan, contents: Contents) -> Self {
        Self { plan, contents, resources: Vec::new() }
    }

    pub(super) fn build(mut self, storage: Storage, fuse: bool) -> Program {
        let plan = self.plan;
        let step = |stage| plan.steps.iter().find(|s| s.stage == stage);
        let both_temporal = step(Stage::MatteTemporal).zip(step(Stage::GlossyTemporal)).filter(|_| fuse);
        let blend_and_median = step(Stage::Disocclusion)
            .zip(step(Stage::Firefly))
            // What shares stage 6's choice has to see what stage 6 saw.
            .filter(|(blend, median)| fuse && median.input == blend.output && self.contents.joint[0] == 0);
        let mut dispatches = self.border();
        for step in &plan.steps {
            let (pass, places) = match (step.stage, both_temporal, blend_and_median) {
                (Stage::MatteTemporal, Some((matte, glossy)), _) => (Pass::TEMPORAL, {
                    let guides = GUIDES.into_iter().chain(self.guides_before(Signal::Glossy));
                    guides.chain(self.accumulating(matte)).chain(self.accumulating(glossy)).collect()
                }),
                (Stage::Disocclusion, _, Some((blend, median))) => {
                    let mut places = self.blending(blend);
                    places.extend([self.floored(), self.place(median.output)]);
                    (Pass::DISOCCLUSION_FIREFLY, places)
                }
                // Done by the pass of stage 3, or 5.
                (Stage::GlossyTemporal, Some(_), _) | (Stage::Firefly, _, Some(_)) => {
                    dispatches.extend(self.joint(step));
                    continue;
                }
                _ => (Pass::of(step.stage), self.single(step)),
            };
            dispatches.push(self.dispatch(step, pass, places));
            dispatches.extend(self.joint(step));
        }
        let shown = self.shown();
        let joint = self.shown_joint();
        self.set_roles(&shown, &joint);
        Program { storage, resources: self.resources, dispatches, shown, joint }
    }

    fn dispatch(&mut self, step: &Step, pass: Pass, places: Vec<Source>) -> Dispatch {
        Dispatch { pass, host_input: self.filters_host_image(step), bound: self.bound(&pass, places) }
    }

    fn bound(&mut self, pass: &Pass, places: impl IntoIterator<Item = Source>) -> Vec<Bound> {
        places.into_iter().zip(pass.bindings).map(|(place, b)| self.bind(place, b)).collect()
    }

    /// What comes before the stages.
    fn border(&mut self) -> Vec<Dispatch> {
        let contents = self.contents;
        let mut dispatches = Vec::new();
        let mut add = |pass: Pass, slots: Vec<Slot>| {
            let bound = self.bound(&pass, slots.into_iter().map(|slot| (slot, false)));
            dispatches.push(Dispatch { pass, host_input: false, bound });
        };
        if contents.textures {
            let own = [Slot::Prepare, Slot::Repairs].into_iter();
            let given = GuidePlane::ALL.map(Slot::Guide);
            add(Pass::PREPARE, own.chain(given).chain(GUIDES.map(|(slot, _)| slot)).collect());
        }
        if contents.counts {
            let [matte, glossy] = [contents.matte, contents.glossy];
            let has = |signal: Option<SignalContents>, of: fn(SignalContents) -> bool| signal.is_some_and(of);
            let colours = [
                (contents.direct, Slot::Image(Image::DirectInput)),
                (matte.is_some(), Slot::Image(Image::MatteInput)),
                (glossy.is_some(), Slot::Image(Image::GlossyInput)),
                (has(matte, |s| s.direct), Slot::DirectMatte),
                (has(glossy, |s| s.direct), Slot::DirectGlossy),
                (has(matte, |s| s.weight), Slot::MatteWeight),
                (has(glossy, |s| s.weight), Slot::GlossyWeight),
            ];
            let slots = colours.map(|(there, slot)| if there { slot } else { Slot::Absent(Sample::Float) });
            add(Pass::COUNT_REPAIRS, [Slot::Repairs].into_iter().chain(slots).collect());
        }
        dispatches
    }

    /// The dispatches of a step for the planes that are tied to its signal: after the signal's own.
    fn joint(&mut self, step: &Step) -> Vec<Dispatch> {
        let signal = match step.stage {
            Stage::GlossyTemporal
            | Stage::GlossyYoung1
            | Stage::GlossyYoung3
            | Stage::GlossyYoung9
            | Stage::GlossyHorizontal
            | Stage::GlossyVertical => Signal::Glossy,
            Stage::DirectTaa | Stage::Composite | Stage::Antialiasing => return Vec::new(),
            _ => Signal::Matte,
        };
        let count = self.contents.joint[signal as usize];
        (0..count)
            .map(|index| {
                let own = |place: Source| match place {
                    (Slot::Image(image), before) => (Slot::Joint { signal, index, image }, before),
                    shared => shared,
                };
                let (input, output) = (self.place(step.input), self.place(step.output));
                let (pass, places) = match step.stage {
                    Stage::MatteTemporal | Stage::GlossyTemporal => {
                        let [current, history, length, ..] = self.accumulating(step);
                        let planes = [current, history, length, own(current), own(history), own(output)];
                        let pass = match signal {
                            Signal::Matte => Pass::MATTE_TEMPORAL_JOINT,
                            Signal::Glossy => Pass::GLOSSY_TEMPORAL_JOINT,
                        };
                        (pass, GUIDES.into_iter().chain(self.guides_before(signal)).chain(planes).collect())
                    }
                    Stage::Firefly => (Pass::FIREFLY_JOINT, vec![GUIDES[0], input, own(input), own(output)]),
                    Stage::MatteYoung1
                    | Stage::MatteYoung3
                    | Stage::MatteYoung9
                    | Stage::MatteYoung27
                    | Stage::GlossyYoung1
                    | Stage::GlossyYoung3
                    | Stage::GlossyYoung9 => {
                        let pass = match step.stage {
                            Stage::MatteYoung1 => Pass::MATTE_YOUNG_1_JOINT,
                            Stage::MatteYoung3 => Pass::MATTE_YOUNG_3_JOINT,
                            Stage::MatteYoung9 => Pass::MATTE_YOUNG_9_JOINT,
                            Stage::MatteYoung27 => Pass::MATTE_YOUNG_27_JOINT,
                            Stage::GlossyYoung1 => Pass::GLOSSY_YOUNG_1_JOINT,
                            Stage::GlossyYoung3 => Pass::GLOSSY_YOUNG_3_JOINT,
                            _ => Pass::GLOSSY_YOUNG_9_JOINT,
                        };
                        let length = (Self::young_length(step.stage), false);
                        let planes = [input, length, own(input), own(output)];
                        (pass, GUIDES.into_iter().take(2).chain(planes).collect())
                    }
                    _ => (Pass::of(step.stage), self.single(step).into_iter().map(own).collect()),
                };
                self.dispatch(step, pass, places)
            })
            .collect()
    }

    /// Where an image of the plan lies.
    pub(super) fn place(&self, image: Image) -> Source {
        let plan = self.plan;
        let remembered = |history| (Slot::Image(history), false);
        match image {
            Image::MatteHistory | Image::GlossyHistory | Image::DirectHistory | Image::PictureHistory => {
                (Slot::Image(image), true)
            }
            image if plan.matte_feedback == Some(image) => remembered(Image::MatteHistory),
            image if plan.glossy_feedback == Some(image) => remembered(Image::GlossyHistory),
            Image::DirectAntialiased => remembered(Image::DirectHistory),
            image => (Slot::Image(image), false),
        }
    }

    /// The history of stage 3 or 8, and the slot of its length.
    const fn history_of(stage: Stage) -> (Image, Slot) {
        match stage {
            Stage::GlossyTemporal => (Image::GlossyHistory, Slot::GlossyLength),
            _ => (Image::MatteHistory, Slot::MatteLength),
        }
    }

    const fn young_length(stage: Stage) -> Slot {
        match stage.young_level() {
            Some((Signal::Glossy, _)) => Slot::GlossyLength,
            _ => Slot::MatteLength,
        }
    }

    /// The image whose fourth value a level of `young_filter` may hand on: what stage 5 reads has the confidence again.
    fn keeping(&self, step: &Step) -> Source {
        let is_read = |s: &&Step| s.stage == Stage::Disocclusion && s.input == step.output;
        let accumulated = |s: &&Step| s.stage == Stage::MatteTemporal;
        match (self.plan.steps.iter().find(is_read), self.plan.steps.iter().find(accumulated)) {
            (Some(_), Some(temporal)) => self.place(temporal.output),
            _ => self.place(step.input),
        }
    }

    /// What the frame before showed: stage 8 may want its hit distances, too, and binds this frame's where it does not.
    fn guides_before(&self, signal: Signal) -> impl Iterator<Item = Source> + use<> {
        let hits = (signal == Signal::Glossy).then_some((Slot::Moving, self.plan.compares_hits));
        GUIDES_BEFORE.into_iter().chain(hits)
    }

    /// What stages 3 and 8 bind after the guides.
    fn accumulating(&self, step: &Step) -> [Source; 5] {
        let (history, length) = Self::history_of(step.stage);
        [self.place(step.input), self.place(history), (length, true), self.place(step.output), (length, false)]
    }

    /// What stage 5 reads.
    fn blending(&self, step: &Step) -> Vec<Source> {
        let prefiltered = step.also_reads.first().copied().unwrap_or(step.input);
        vec![self.place(step.input), self.place(prefiltered)]
    }

    fn floored(&self) -> Source {
        self.place(Image::MatteFloored)
    }

    /// The bindings of a stage's own pass.
    fn single(&self, step: &Step) -> Vec<Source> {
        let (input, output) = (self.place(step.input), self.place(step.output));
        let guides = GUIDES.into_iter();
        match step.stage {
            Stage::MatteTemporal => {
                guides.chain(self.guides_before(Signal::Matte)).chain(self.accumulating(step)).collect()
            }
            Stage::GlossyTemporal => {
                guides.chain(self.guides_before(Signal::Glossy)).chain(self.accumulating(step)).collect()
            }
            Stage::MattePrefilter => guides.take(2).chain([(Slot::PrefilterTaps, false), input, output]).collect(),
            Stage::MatteBilateral => guides.take(2).chain([(Slot::BilateralTaps, false), input, output]).collect(),
            Stage::MatteYoung1
            | Stage::MatteYoung3
            | Stage::MatteYoung9
            | Stage::MatteYoung27
            | Stage::GlossyYoung1
            | Stage::GlossyYoung3
            | Stage::GlossyYoung9 => {
                let length = (Self::young_length(step.stage), false);
                guides.take(2).chain([input, length, self.keeping(step), output]).collect()
            }
            Stage::Disocclusion => {
                let mut places = self.blending(step);
                places.extend([output, self.floored()]);
                places
            }
            Stage::Firefly => guides.take(1).chain([input, output]).collect(),
            Stage::GlossyHorizontal | Stage::GlossyVertical => guides.chain([input, output]).collect(),
            Stage::DirectTaa => {
                vec![(Slot::Geometry, false), (Slot::Moving, false), input, self.place(Image::DirectHistory), output]
            }
            // The picture is shown in the same texture at every frame; its history, beside it, alternates.
            Stage::Antialiasing => {
                let history = Slot::Image(Image::PictureHistory);
                vec![(Slot::Geometry, false), (Slot::Moving, false), input, (history, true), (history, false), output]
            }
            Stage::Composite => {
                let (plan, contents) = (self.plan, self.contents);
                // What the frame lacks is not read: any colour will do.
                let any = match (contents.direct, contents.matte) {
                    (true, _) => input,
                    (false, Some(_)) => self.place(plan.matte_output),
                    (false, None) => self.place(plan.glossy_output),
                };
                let or_any = |there: bool, place: Source| if there { place } else { any };
                let of = |signal: Option<SignalContents>| {
                    (signal.is_some(), signal.is_some_and(|s| s.direct), signal.is_some_and(|s| s.weight))
                };
                let (matte, glossy) = (of(contents.matte), of(contents.glossy));
                vec![
                    or_any(contents.direct, input),
                    or_any(matte.0, self.place(plan.matte_output)),
                    or_any(glossy.0, self.place(plan.glossy_output)),
                    or_any(matte.1, (Slot::DirectMatte, false)),
                    or_any(glossy.1, (Slot::DirectGlossy, false)),
                    or_any(matte.2, (Slot::MatteWeight, false)),
                    or_any(glossy.2, (Slot::GlossyWeight, false)),
                    output,
                ]
            }
        }
    }

    /// Whether a filter, that in other places of the plan reads what another stage wrote, reads the host's own image.
    fn filters_host_image(&self, step: &Step) -> bool {
        let can_come_first = !matches!(
            step.stage,
            Stage::MatteTemporal | Stage::GlossyTemporal | Stage::DirectTaa | Stage::Composite | Stage::Antialiasing
        );
        can_come_first && self.place(step.input).0.is_input()
    }

    fn bind(&mut self, (slot, before): Source, binding: &Binding) -> Bound {
        let holds = match (binding.kind, slot) {
            (_, Slot::Absent(sample)) | (BindingKind::Host(sample), _) => Holds::Host(sample),
            (BindingKind::Sampled(texel) | BindingKind::Stored(texel), _) => Holds::Plane(texel),
            (BindingKind::Taps, _) => Holds::Taps,
            (BindingKind::Counts(count), _) => Holds::Counts(count),
            (BindingKind::Uniform(name), _) => Holds::Uniform(name),
            // No pass of a program has such bindings: those of the sequence filter and the debug views do.
            (
                BindingKind::Frames
                | BindingKind::Read(_)
                | BindingKind::Write(_)
                | BindingKind::Picture(_)
                | BindingKind::Layers(_),
                _,
            ) => Holds::Host(Sample::Float),
        };
        Bound { resource: self.index(slot, holds), before }
    }

    fn index(&mut self, slot: Slot, holds: Holds) -> usize {
        if let Some(index) = self.resources.iter().position(|r| r.slot == slot) {
            return index;
        }
        let is_packed = !self.contents.textures;
        let alternates = slot.alternates() || (slot == Slot::Moving && self.plan.compares_hits);
        let role = match slot {
            Slot::Geometry | Slot::Surface | Slot::Moving if is_packed => Role::Guides,
            Slot::PrefilterTaps | Slot::BilateralTaps => Role::Taps,
            Slot::Prepare => Role::Uniform,
            Slot::Repairs => Role::Counts,
            Slot::Absent(_) => Role::Absent,
            slot if slot.is_input() => Role::Input,
            _ if alternates => Role::Persistent,
            _ => Role::Transient,
        };
        let absent = match slot {
            Slot::Guide(plane) => Some(self.index(Slot::Absent(plane.sample()), Holds::Host(plane.sample()))),
            _ => None,
        };
        self.resources.push(Resource { slot, holds, role, alternates, absent, shares: None, lasts: true });
        self.resources.len() - 1
    }

    fn shown(&mut self) -> Shown {
        let (plan, contents) = (self.plan, self.contents);
        let mut image = |image| {
            let slot = self.place(image).0;
            self.index(slot, Holds::Plane(Texel::Colour))
        };
        let composite = plan.runs(Stage::Composite).then(|| image(plan.picture_output));
        let direct = contents.direct.then(|| image(plan.direct_output));
        let matte = contents.matte.map(|_| image(plan.matte_output));
        let glossy = contents.glossy.map(|_| image(plan.glossy_output));
        let temporal = [Stage::MatteTemporal, Stage::GlossyTemporal]
            .into_iter()
            .find_map(|stage| plan.steps.iter().find(|s| s.stage == stage));
        let confidence = temporal.map(|step| image(step.output));
        let length = temporal.map(|step| self.index(Self::history_of(step.stage).1, Holds::Plane(Texel::Number)));
        Shown { composite, direct, matte, glossy, confidence, length }
    }

    fn shown_joint(&mut self) -> [Vec<usize>; 2] {
        Signal::ALL.map(|signal| {
            let image = match signal {
                Signal::Matte => self.plan.matte_output,
                Signal::Glossy => self.plan.glossy_output,
            };
            let image = match self.place(image).0 {
                Slot::Image(image) => image,
                _ => image,
            };
            let count = self.contents.joint[signal as usize];
            (0..count)
                .map(|index| self.index(Slot::Joint { signal, index, image }, Holds::Plane(Texel::Colour)))
                .collect()
        })
    }

    fn set_roles(&mut self, shown: &Shown, joint: &[Vec<usize>; 2]) {
        let indices = [shown.composite, shown.direct, shown.matte, shown.glossy, shown.confidence];
        for index in indices.into_iter().flatten().chain(joint.iter().flatten().copied()) {
            if let Some(resource) = self.resources.get_mut(index).filter(|r| r.role == Role::Transient) {
                resource.role = Role::Output;
            }
        }
    }
}
