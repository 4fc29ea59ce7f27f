//! What one frame does on the GPU, as data: the resources and the dispatches in order. It is made from the plan without a
//! device; the denoiser walks it, byte counts and listings come from it, and nothing else decides bindings or order.
//!
//! A resource that alternates has two copies. Frame by frame the denoiser's turn changes between 0 and 1: what is bound
//! as `before` is the copy that the frame before wrote, every other binding is the copy of this turn.

use super::pass::{Binding, BindingKind, Pass};
use super::storage::{Storage, Texel};
use crate::frame::Signal;
use crate::pipeline::{Image, Inputs, Plan, Stage, Step};

/// What a frame has of one signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SignalContents {
    /// Its weight.
    pub weight: bool,
    /// Noisy direct light of the lobe.
    pub direct: bool,
}

/// What a frame has; the program depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// The matte signal.
    pub matte: Option<SignalContents>,
    /// The glossy signal.
    pub glossy: Option<SignalContents>,
    /// Direct light.
    pub direct: bool,
    /// Its samples are jittered.
    pub jitter: bool,
    /// Planes that are tied to the matte and to the glossy signal.
    pub joint: [u16; 2],
}

impl Contents {
    /// A frame with both signals and their weights, jittered, without noisy direct light.
    pub const USUAL: Self = {
        let signal = Some(SignalContents { weight: true, direct: false });
        Self { matte: signal, glossy: signal, direct: true, jitter: true, joint: [0; 2] }
    };

    /// What the plan depends on.
    pub const fn inputs(self) -> Inputs {
        let jitter = self.jitter && self.direct;
        Inputs { matte: self.matte.is_some(), glossy: self.glossy.is_some(), jitter }
    }
}

/// Which resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the name says it")]
pub enum Slot {
    /// An image of the pipeline. What is remembered lies in `MatteHistory`, `GlossyHistory`, `DirectHistory`, whichever
    /// stage writes it.
    Image(Image),
    /// What a plane that is tied to a signal has in an image's place; counted from 0 for each signal.
    Joint {
        signal: Signal,
        index: u16,
        image: Image,
    },
    Geometry,
    Surface,
    Moving,
    MatteLength,
    GlossyLength,
    MatteWeight,
    GlossyWeight,
    DirectMatte,
    DirectGlossy,
    PrefilterTaps,
    BilateralTaps,
}

impl Slot {
    /// For listings and labels.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Image(image) | Self::Joint { image, .. } => image.name(),
            Self::Geometry => "guides geometry",
            Self::Surface => "guides surface",
            Self::Moving => "guides moving",
            Self::MatteLength => "matte length",
            Self::GlossyLength => "glossy length",
            Self::MatteWeight => "matte weight",
            Self::GlossyWeight => "glossy weight",
            Self::DirectMatte => "direct matte",
            Self::DirectGlossy => "direct glossy",
            Self::PrefilterTaps => "matte prefilter taps",
            Self::BilateralTaps => "matte bilateral taps",
        }
    }

    const fn alternates(self) -> bool {
        matches!(
            self,
            Self::Geometry
                | Self::Surface
                | Self::MatteLength
                | Self::GlossyLength
                | Self::Image(Image::MatteHistory | Image::GlossyHistory | Image::DirectHistory)
                | Self::Joint { image: Image::MatteHistory | Image::GlossyHistory, .. }
        )
    }

    const fn is_input(self) -> bool {
        matches!(
            self,
            Self::Image(Image::MatteInput | Image::GlossyInput | Image::DirectInput)
                | Self::Joint { image: Image::MatteInput | Image::GlossyInput, .. }
                | Self::MatteWeight
                | Self::GlossyWeight
                | Self::DirectMatte
                | Self::DirectGlossy
        )
    }
}

/// Whose a resource is, and how long it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host's texture: read as it is, of any float format.
    Input,
    /// Packed guides: they are there before the first dispatch. Geometry and surface outlive the frame.
    Guides,
    /// Outlives the frame.
    Persistent,
    /// Shown to the host: holds the frame until the next one is encoded.
    Output,
    /// Needed within the frame only.
    Transient,
    /// A small buffer, new with every frame: the taps of stage 4 or 7 ([`super::pack_spiral`]).
    Taps,
}

/// A plane of the image's extent, or a table of taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Which.
    pub slot: Slot,
    /// What a texel holds; `None`: a storage buffer of taps.
    pub texel: Option<Texel>,
    /// Whose it is.
    pub role: Role,
    /// There are two of it, which change places at every frame.
    pub alternates: bool,
}

/// A resource at a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bound {
    /// Index into [`Program::resources`].
    pub resource: usize,
    /// The copy of the frame before.
    pub before: bool,
}

/// A dispatch over the whole image: one workgroup for every 8x8 pixels.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// Shader, entry point, names of bindings, stages.
    pub pass: Pass,
    /// The image that it filters comes from the host as it is: see [`Pass::source`].
    pub host_input: bool,
    /// One for each of [`Pass::bindings`], in their order.
    pub bound: Vec<Bound>,
}

/// Which resources the host is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The sum; `None`: nobody asked for it, or there is nothing to add.
    pub composite: Option<usize>,
    /// Direct light, where there is any.
    pub direct: Option<usize>,
    /// The matte signal.
    pub matte: Option<usize>,
    /// The glossy signal.
    pub glossy: Option<usize>,
    /// The image whose fourth value is the confidence (its magnitude; negative: background): of the matte signal, or of
    /// the glossy one where there is no matte.
    pub confidence: Option<usize>,
    /// History length in frames, likewise.
    pub length: Option<usize>,
}

/// Device memory in bytes; inputs are the host's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// What outlives a frame: history and the guides of the frame before.
    pub persistent: u64,
    /// What is needed within a frame, outputs included: another user of the device may have it in between.
    pub transient: u64,
}

/// Resources and dispatches of a frame.
#[derive(Clone, Debug)]
pub struct Program {
    /// How planes are stored.
    pub storage: Storage,
    /// Every plane and table.
    pub resources: Vec<Resource>,
    /// In the order in which they run.
    pub dispatches: Vec<Dispatch>,
    /// What comes out.
    pub shown: Shown,
    /// Likewise of the planes that are tied to the matte and to the glossy signal, in their order.
    pub joint: [Vec<usize>; 2],
}

impl Program {
    /// The program of a plan. `fuse`: stages that can share a pass do; else each has its own.
    pub fn new(plan: &Plan, contents: Contents, storage: Storage, fuse: bool) -> Self {
        Builder { plan, contents, resources: Vec::new() }.build(storage, fuse)
    }

    /// Bytes a pixel that a dispatch moves: each plane once that it reads or writes (host's colours as if they were in
    /// the program's storage).
    pub fn bytes_of(&self, dispatch: &Dispatch) -> u32 {
        let mut seen: Vec<Bound> = Vec::new();
        for bound in &dispatch.bound {
            if !seen.contains(bound) {
                seen.push(*bound);
            }
        }
        let texels = seen.iter().filter_map(|bound| self.resources.get(bound.resource)?.texel);
        texels.map(|texel| texel.bytes(self.storage)).sum()
    }

    /// Bytes a pixel of a stage; `None`: it does not run. Of stages that share a dispatch the first counts all of it, the
    /// others 0.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        let dispatch = self.dispatches.iter().find(|d| d.pass.stages.contains(&stage))?;
        Some(if dispatch.pass.stages.first() == Some(&stage) { self.bytes_of(dispatch) } else { 0 })
    }

    /// Milliseconds that a stage takes at the least where memory is the limit: `bytes_per_pixel` for this many pixels at
    /// `bandwidth` bytes a second.
    pub fn floor_ms(&self, stage: Stage, pixels: usize, bandwidth: f64) -> Option<f64> {
        let bytes = self.bytes_per_pixel(stage)?;
        Some(f64::from(bytes) * pixels as f64 / bandwidth * 1e3)
    }

    /// Device memory of the program's own planes for this many pixels.
    pub fn memory(&self, pixels: usize) -> Memory {
        let mut memory = Memory::default();
        for resource in &self.resources {
            let Some(texel) = resource.texel.filter(|_| resource.role != Role::Input) else { continue };
            let bytes = u64::from(texel.bytes(self.storage)) * pixels as u64;
            if resource.alternates {
                memory.persistent += 2 * bytes;
            } else {
                memory.transient += bytes;
            }
        }
        memory
    }

    /// Where an image of the plan lies that this program makes; inputs are the host's.
    pub(super) fn slot_of(&self, plan: &Plan, image: Image) -> Option<Slot> {
        let builder = Builder { plan, contents: Contents::USUAL, resources: Vec::new() };
        let slot = builder.place(image).0;
        self.resources.iter().find(|r| r.slot == slot && r.role != Role::Input).map(|r| r.slot)
    }

    /// The bindings of a dispatch with what is bound, in order.
    pub fn bindings<'a>(&'a self, dispatch: &'a Dispatch) -> impl Iterator<Item = (&'a Binding, &'a Resource, bool)> {
        let bound = dispatch.bound.iter().filter_map(|b| Some((self.resources.get(b.resource)?, b.before)));
        dispatch.pass.bindings.iter().zip(bound).map(|(binding, (resource, before))| (binding, resource, before))
    }
}

/// A resource and which copy.
type Place = (Slot, bool);

struct Builder<'a> {
    plan: &'a Plan,
    contents: Contents,
    resources: Vec<Resource>,
}

const GUIDES: [Place; 3] = [(Slot::Geometry, false), (Slot::Surface, false), (Slot::Moving, false)];
const GUIDES_BEFORE: [Place; 2] = [(Slot::Geometry, true), (Slot::Surface, true)];

impl Builder<'_> {
    fn build(mut self, storage: Storage, fuse: bool) -> Program {
        let plan = self.plan;
        let step = |stage| plan.steps.iter().find(|s| s.stage == stage);
        let both_temporal = step(Stage::MatteTemporal).zip(step(Stage::GlossyTemporal)).filter(|_| fuse);
        let blend_and_median = step(Stage::Disocclusion)
            .zip(step(Stage::Firefly))
            // What shares stage 6's choice has to see what stage 6 saw.
            .filter(|(blend, median)| fuse && median.input == blend.output && self.contents.joint[0] == 0);
        let mut dispatches = Vec::new();
        for step in &plan.steps {
            let (pass, places) = match (step.stage, both_temporal, blend_and_median) {
                (Stage::MatteTemporal, Some((matte, glossy)), _) => (Pass::TEMPORAL, {
                    let guides = GUIDES.into_iter().chain(GUIDES_BEFORE);
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

    fn dispatch(&mut self, step: &Step, pass: Pass, places: Vec<Place>) -> Dispatch {
        let bound = places.into_iter().zip(pass.bindings).map(|(place, b)| self.bind(place, b)).collect();
        Dispatch { pass, host_input: self.filters_host_image(step), bound }
    }

    /// The dispatches of a step for the planes that are tied to its signal: after the signal's own.
    fn joint(&mut self, step: &Step) -> Vec<Dispatch> {
        let signal = match step.stage {
            Stage::GlossyTemporal | Stage::GlossyHorizontal | Stage::GlossyVertical => Signal::Glossy,
            Stage::DirectTaa | Stage::Composite => return Vec::new(),
            _ => Signal::Matte,
        };
        let count = self.contents.joint[signal as usize];
        (0..count)
            .map(|index| {
                let own = |place: Place| match place {
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
                        (pass, GUIDES.into_iter().chain(GUIDES_BEFORE).chain(planes).collect())
                    }
                    Stage::Firefly => (Pass::FIREFLY_JOINT, vec![GUIDES[0], input, own(input), own(output)]),
                    _ => (Pass::of(step.stage), self.single(step).into_iter().map(own).collect()),
                };
                self.dispatch(step, pass, places)
            })
            .collect()
    }

    /// Where an image of the plan lies.
    fn place(&self, image: Image) -> Place {
        let plan = self.plan;
        let remembered = |history| (Slot::Image(history), false);
        match image {
            Image::MatteHistory | Image::GlossyHistory | Image::DirectHistory => (Slot::Image(image), true),
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

    /// What stages 3 and 8 bind after the guides.
    fn accumulating(&self, step: &Step) -> [Place; 5] {
        let (history, length) = Self::history_of(step.stage);
        [self.place(step.input), self.place(history), (length, true), self.place(step.output), (length, false)]
    }

    /// What stage 5 reads.
    fn blending(&self, step: &Step) -> Vec<Place> {
        let prefiltered = step.also_reads.first().copied().unwrap_or(step.input);
        vec![self.place(step.input), self.place(prefiltered)]
    }

    fn floored(&self) -> Place {
        self.place(Image::MatteFloored)
    }

    /// The bindings of a stage's own pass.
    fn single(&self, step: &Step) -> Vec<Place> {
        let (input, output) = (self.place(step.input), self.place(step.output));
        let guides = GUIDES.into_iter();
        match step.stage {
            Stage::MatteTemporal | Stage::GlossyTemporal => {
                guides.chain(GUIDES_BEFORE).chain(self.accumulating(step)).collect()
            }
            Stage::MattePrefilter => guides.take(2).chain([(Slot::PrefilterTaps, false), input, output]).collect(),
            Stage::MatteBilateral => guides.take(2).chain([(Slot::BilateralTaps, false), input, output]).collect(),
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
            Stage::Composite => {
                let (plan, contents) = (self.plan, self.contents);
                // What the frame lacks is not read: any colour will do.
                let any = match (contents.direct, contents.matte) {
                    (true, _) => input,
                    (false, Some(_)) => self.place(plan.matte_output),
                    (false, None) => self.place(plan.glossy_output),
                };
                let or_any = |there: bool, place: Place| if there { place } else { any };
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

    /// Whether a filter, that elsewhere reads what another stage wrote, reads the host's own image.
    fn filters_host_image(&self, step: &Step) -> bool {
        let can_come_first =
            !matches!(step.stage, Stage::MatteTemporal | Stage::GlossyTemporal | Stage::DirectTaa | Stage::Composite);
        can_come_first && self.place(step.input).0.is_input()
    }

    fn bind(&mut self, (slot, before): Place, binding: &Binding) -> Bound {
        let texel = match binding.kind {
            BindingKind::Sampled(texel) | BindingKind::Stored(texel) => Some(texel),
            BindingKind::Taps => None,
        };
        Bound { resource: self.index(slot, texel), before }
    }

    fn index(&mut self, slot: Slot, texel: Option<Texel>) -> usize {
        if let Some(index) = self.resources.iter().position(|r| r.slot == slot) {
            return index;
        }
        let role = match slot {
            Slot::Geometry | Slot::Surface | Slot::Moving => Role::Guides,
            Slot::PrefilterTaps | Slot::BilateralTaps => Role::Taps,
            slot if slot.is_input() => Role::Input,
            slot if slot.alternates() => Role::Persistent,
            _ => Role::Transient,
        };
        self.resources.push(Resource { slot, texel, role, alternates: slot.alternates() });
        self.resources.len() - 1
    }

    fn shown(&mut self) -> Shown {
        let (plan, contents) = (self.plan, self.contents);
        let mut image = |image| {
            let slot = self.place(image).0;
            self.index(slot, Some(Texel::Colour))
        };
        let composite = plan.runs(Stage::Composite).then(|| image(Image::Composite));
        let direct = contents.direct.then(|| image(plan.direct_output));
        let matte = contents.matte.map(|_| image(plan.matte_output));
        let glossy = contents.glossy.map(|_| image(plan.glossy_output));
        let temporal = [Stage::MatteTemporal, Stage::GlossyTemporal]
            .into_iter()
            .find_map(|stage| plan.steps.iter().find(|s| s.stage == stage));
        let confidence = temporal.map(|step| image(step.output));
        let length = temporal.map(|step| self.index(Self::history_of(step.stage).1, Some(Texel::Number)));
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
            (0..count).map(|index| self.index(Slot::Joint { signal, index, image }, Some(Texel::Colour))).collect()
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
