//! From a file's passes to a frame of the filter, and from filtered light back to the file's passes.
//!
//! [`Adapter::new`] decides on the first frame what can be seen in pixels (does the colour lie inside the light
//! passes, do they add up, how are normals encoded, what do vectors mean). [`Adapter::frame`] makes a
//! [`SequenceFrame`]; [`Adapter::write_back`] puts filtered light into the images.

mod back;
mod camera;
mod error_pass;
mod footprint;
pub(crate) mod guides;
mod lights;
mod moving;
pub(crate) mod noise;
pub(crate) mod planes;
mod reflectance;

pub use back::WriteBack;
pub use camera::PixelCamera;
pub use error_pass::{FrameNoise, NOISE_PASS};
pub use footprint::Footprint;
pub use lights::SumRule;

use crate::error::Error;
use crate::image::{Channel, ExrImage, Part, Window};
use crate::motion::{MotionConvention, MotionGuides, find_motion};
use crate::roles::{ChannelId, Mapping, Role};
use quell::sequence::SequenceFrame;
use quell::{Plane, Rgb};
use std::collections::BTreeSet;

/// What to make of vectors.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum MotionChoice {
    /// The renderer's preset where it is known, else [`MotionChoice::Auto`].
    #[default]
    Renderer,
    /// Every convention is tried on two frames.
    Auto,
    /// A preset by name ([`MotionConvention::PRESETS`]).
    Preset(String),
    /// No vectors: motion comes from cameras where positions give them, else there is none.
    None,
}

/// What the user may choose.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct AdaptOptions {
    /// What vectors mean.
    pub motion: MotionChoice,
    /// Only the beauty is filtered and written; light passes go through untouched.
    pub beauty_only: bool,
    /// Passes that are written filtered, by role or name; the others go through untouched, and the beauty becomes the sum
    /// of what is written. Absent: all.
    pub passes: Option<Vec<String>>,
    /// The expected error of the picture is written as a further pass, [`NOISE_PASS`].
    pub noise_pass: bool,
}

/// How one view layer's files become frames and come back.
#[derive(Clone, Debug)]
pub struct Adapter {
    mapping: Mapping,
    canvas: Window,
    display: Window,
    rule: SumRule,
    vectors: Option<[MotionConvention; 2]>,
    guides: guides::Encodings,
    cameras: bool,
    /// Names of the passes that are written filtered; absent: all.
    written: Option<BTreeSet<String>>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

/// What a frame needs to know of its predecessor. Frames come in order; after a gap begin with a new one.
#[derive(Clone, Debug, Default)]
pub struct Links {
    last: Option<noise::Trace>,
}

/// A frame made, and what there is to say about it.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// The frame.
    pub frame: SequenceFrame,
    /// Sentences for the user; most come once.
    pub notes: Vec<String>,
    /// The camera, where the file has it.
    pub camera: Option<PixelCamera>,
}

impl Adapter {
    /// Decides how frames are made, from the first frame and, where vectors are to be understood, the one after it.
    ///
    /// `canvas` is the extent of the frames: [`ExrImage::full_window`], united over all frames. The images need the
    /// channels of [`Mapping::channels`].
    ///
    /// # Errors
    /// [`Error::Invalid`] where channels are missing, the preset is unknown (the known ones are listed), or the canvas
    /// has no pixels.
    pub fn new(
        mapping: Mapping,
        canvas: Window,
        first: &[ExrImage],
        second: Option<&[ExrImage]>,
        options: &AdaptOptions,
    ) -> Result<Self, Error> {
        let path = first.first().map_or_else(std::path::PathBuf::new, |image| image.path().to_owned());
        if canvas.size.pixels() == 0 {
            return Err(Error::invalid(&path, "the frames have no pixels"));
        }
        let display = first.first().map_or(canvas, ExrImage::display_window);
        let mut notes = Vec::new();
        let mut warnings = Vec::new();
        let mut mapping = mapping;
        let beyond = lights::beyond_reflectance(&mapping, canvas, first)?;
        if beyond > lights::MOST_BEYOND {
            mapping.passes.retain(|pass| pass.role != Role::Albedo);
            warnings.push(format!(
                "the albedo is above 1 in {:.1} % of the pixels: it is noise or light, not the colour of surfaces, and is left \
                 out; write the colour alone, clamped to 1",
                100.0 * beyond
            ));
        }
        let rule = SumRule::find(&mapping, canvas, first, options.beauty_only)?;
        notes.push(rule.describe());
        warnings.extend(rule.warning());
        let written = back::chosen(&path, &mapping, options.passes.as_deref())?;
        if let Some(chosen) = &written {
            let names = chosen.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
            notes.push(format!("filtered and written: {names}"));
        }
        if let Some(kind) = guides::depth_kind(&mapping, canvas, first)?
            && kind != mapping.renderer.depth
        {
            notes
                .push(format!("positions say that depth is {kind:?}, not {:?}", mapping.renderer.depth).to_lowercase());
            mapping.renderer.depth = kind;
        }
        let guides = guides::Encodings::find(&mapping, canvas, first)?;
        let cameras = guides::has_cameras(&mapping, canvas, first);
        let mut adapter =
            Self { mapping, canvas, display, rule, vectors: None, guides, cameras, written, notes, warnings };
        adapter.warnings.extend(adapter.says_of_chosen());
        adapter.vectors = adapter.find_vectors(&path, first, second, &options.motion)?;
        if adapter.vectors.is_none() && !adapter.cameras {
            adapter.warnings.push(
                "nothing tells what moves (no motion vectors that are understood, no world positions, no camera): every \
                 frame is filtered by itself, and noise that is left will flicker"
                    .to_owned(),
            );
        }
        if let Some(denoised) = adapter.mapping.denoised() {
            adapter.warnings.push(format!(
                "the renderer denoised `{}` itself: the raw picture beside it is filtered, and both become the result. \
                 Switch its denoiser off (Render > Sampling > Denoise, `cycles.use_denoising`): it costs time for nothing",
                denoised.name
            ));
        }
        if !adapter.has_guides() {
            let steers = if adapter.mapping.denoised().is_some() { "the denoised picture" } else { "colour" };
            adapter.warnings.push(format!(
                "no normal, depth or albedo: {steers} alone steers the filter. Let the renderer write these passes"
            ));
        }
        Ok(adapter)
    }

    /// What the passes are.
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// The extent of every frame.
    pub fn canvas(&self) -> Window {
        self.canvas
    }

    /// The display window that every frame must have; one of another is another shot, with an adapter of its own.
    pub fn display_window(&self) -> Window {
        self.display
    }

    /// How the passes make the beauty.
    pub fn rule(&self) -> &SumRule {
        &self.rule
    }

    /// What was decided, for `-v`.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What may spoil the result, and what to do.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What the file's vectors are taken for: the first two numbers, and those for the other direction of time.
    pub(crate) const fn vectors(&self) -> Option<[MotionConvention; 2]> {
        self.vectors
    }

    /// True where world positions give the camera.
    pub(crate) fn has_positions(&self) -> bool {
        self.mapping.get(Role::Position).is_some() && self.mapping.renderer.position == crate::roles::Space::World
    }

    /// True where frames can be brought together by cameras: from positions, or from matrices in the header.
    pub(crate) const fn has_cameras(&self) -> bool {
        self.cameras
    }

    /// True where normals lie in 0..1.
    pub(crate) const fn normals_unsigned(&self) -> bool {
        self.guides.normal_unsigned
    }

    /// For the attribute `quell.mapping`: roles, rules, conventions.
    pub fn describe(&self) -> String {
        let mut text = self.mapping.describe();
        for note in &self.notes {
            text += note;
            text.push('\n');
        }
        text
    }

    /// True for the channels that must be read of file number `file`.
    pub fn reads(&self, file: usize) -> impl Fn(&Part, &Channel) -> bool + use<> {
        reads(&self.mapping, file)
    }

    fn has_guides(&self) -> bool {
        let roles = [Role::Normal, Role::Depth, Role::Position, Role::Albedo, Role::MatteColour, Role::SeenAlbedo];
        roles.iter().any(|role| self.mapping.get(*role).is_some())
    }

    /// Makes a frame. The images need the channels for which [`Adapter::reads`] is true.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a channel is missing or was not read, or the display window is another; file and channel
    /// are named.
    pub fn frame(&self, number: i64, images: &[ExrImage], links: &mut Links) -> Result<Adapted, Error> {
        if let Some(other) = images.iter().find(|image| image.display_window() != self.display) {
            let (found, expected) = (other.display_window(), self.display);
            let reason = format!("the picture is {found}, not {expected} as the first frame");
            return Err(Error::invalid(other.path(), reason));
        }
        let mut frame = SequenceFrame::new(number, self.canvas.size);
        let mut notes = Vec::new();
        frame.lights = lights::make(&self.mapping, &self.rule, self.canvas, images)?;
        let camera = guides::fill(self, &mut frame, images, &mut notes)?;
        let beauty =
            self.mapping.get(Role::Beauty).map(|pass| planes::colour(images, pass, self.canvas)).transpose()?;
        let last = links.last.take().filter(|last| last.number + 1 == number && last.size == frame.size);
        moving::motion(self, &mut frame, images, camera.as_ref(), last.as_ref(), &mut notes)?;
        let beauty: Plane<Rgb> = beauty.unwrap_or_else(|| frame.beauty());
        let trace = noise::Trace::of(&frame, &beauty, camera);
        if let Some(last) = &last
            && trace.repeats(last)
        {
            frame.repeats_noise = true;
            notes.push(format!(
                "frame {number} has the same noise as the one before: vary the seed by frame ({})",
                noise::seed_setting(&self.mapping.renderer.name)
            ));
        }
        links.last = Some(trace);
        Ok(Adapted { frame, notes, camera })
    }

    fn find_vectors(
        &mut self,
        path: &std::path::Path,
        first: &[ExrImage],
        second: Option<&[ExrImage]>,
        choice: &MotionChoice,
    ) -> Result<Option<[MotionConvention; 2]>, Error> {
        let role =
            [Role::Motion, Role::MotionPrevious, Role::MotionNext].into_iter().find(|r| self.mapping.get(*r).is_some());
        let Some(role) = role else {
            return Ok(None);
        };
        let preset = match choice {
            MotionChoice::None => return Ok(None),
            MotionChoice::Auto => None,
            MotionChoice::Preset(name) => match MotionConvention::preset(name) {
                Some(found) => Some((found, name.clone())),
                None => {
                    let known = MotionConvention::PRESETS.join(", ");
                    return Err(Error::invalid(
                        path,
                        format!("`{name}` is no motion preset; there are auto, none, {known}"),
                    ));
                }
            },
            MotionChoice::Renderer => {
                let name = self.mapping.renderer.motion.clone();
                MotionConvention::preset(&name).map(|found| (found, name))
            }
        };
        if let Some((found, name)) = preset {
            self.notes.push(format!("motion by the preset `{name}`: {}", found[0]));
            return Ok(Some(found));
        }
        let Some(second) = second else {
            self.warnings
                .push("one frame alone does not tell what its motion vectors mean; they are not used".to_owned());
            return Ok(None);
        };
        let evidence = {
            let a = moving::for_motion(self, first, role)?;
            let b = moving::for_motion(self, second, role)?;
            find_motion(&a.guides(), &b.guides())
        };
        match evidence {
            Some(evidence) if evidence.good => {
                self.notes.push(format!("motion found: {evidence}"));
                let best = evidence.best;
                // The other pair, where there is one, leads the other way: Blender's habit, which is checked by nobody.
                let other = MotionConvention {
                    direction: match best.direction {
                        crate::motion::Direction::Previous => crate::motion::Direction::Next,
                        crate::motion::Direction::Next => crate::motion::Direction::Previous,
                    },
                    sign: [-best.sign[0], -best.sign[1]],
                    ..best
                };
                Ok(Some([best, other]))
            }
            Some(evidence) => {
                self.warnings.push(format!(
                    "no reading of the motion vectors warps one frame onto the next (best: {evidence}); they are not \
                     used. Name their convention with --motion, if you know it"
                ));
                Ok(None)
            }
            None => {
                self.warnings.push(
                    "without position, depth, normal or albedo nothing tells what the motion vectors mean; they are not \
                     used. Name their convention with --motion"
                        .to_owned(),
                );
                Ok(None)
            }
        }
    }
}

/// True for the channels that a mapping reads of file number `file`; before there is an [`Adapter`].
pub fn reads(mapping: &Mapping, file: usize) -> impl Fn(&Part, &Channel) -> bool + use<> {
    let ids: BTreeSet<ChannelId> = mapping.channels().into_iter().filter(|id| id.file == file).collect();
    move |part, channel| {
        let at = part.channels().iter().position(|c| std::ptr::eq(c, channel));
        at.is_some_and(|channel| ids.iter().any(|id| id.channel == channel && id.part == part.index()))
    }
}

/// The planes that `--motion auto` compares, owned.
struct MotionPlanes {
    vectors: Plane<[f32; 2]>,
    position: Option<Plane<[f32; 3]>>,
    depth: Option<Plane<f32>>,
    normal: Option<Plane<[f32; 3]>>,
    albedo: Option<Plane<[f32; 3]>>,
}

impl MotionPlanes {
    fn guides(&self) -> MotionGuides<'_> {
        MotionGuides {
            vectors: &self.vectors,
            position: self.position.as_ref(),
            depth: self.depth.as_ref(),
            normal: self.normal.as_ref(),
            albedo: self.albedo.as_ref(),
        }
    }
}
