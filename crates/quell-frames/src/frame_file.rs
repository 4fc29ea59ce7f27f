//! A frame with all that quell writes beside it, and the way from planes to channels and back.

use crate::channels as c;
use crate::error::Error;
use crate::exr_file::{AttributeValue, ExrPart, read_attributes, read_part, string, text, write_part};
use crate::files::write_whole;
use crate::image::Samples;
use crate::metadata::{Content, Metadata};
use half::f16;
use quell::{Camera, Frame, FrameBuf, PassBuf, Plane, PlaneRef, Rgb, Signal, Size};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

/// How colours are stored. Guides, variances and confidence are always float.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Precision {
    /// 11 bits of mantissa; beyond 65504 clamped and counted. Files are less than half as large.
    Half,
    /// To the bit.
    #[default]
    Float,
}

/// How a frame is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct WriteOptions {
    /// How colours are stored.
    pub colours: Precision,
    /// Also replace a file that quell did not write. quell's own files are always replaced.
    pub overwrite: bool,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Written {
    /// Length of the file.
    pub bytes: u64,
    /// Colour components beyond the largest finite half float (65504), stored as that. Infinities and NaN are kept.
    pub clamped_to_half: usize,
}

/// One of two independent halves of a frame's samples, borrowed. All parts may be absent.
#[derive(Clone, Copy, Debug, Default)]
pub struct Half<'a> {
    /// The whole picture from this half's samples.
    pub composite: Option<PlaneRef<'a, Rgb>>,
    /// The matte signal from this half's samples, without its weight.
    pub matte: Option<PlaneRef<'a, Rgb>>,
    /// The same of the glossy signal.
    pub glossy: Option<PlaneRef<'a, Rgb>>,
}

/// An owned [`Half`]; the fields mean the same.
#[derive(Clone, Debug, PartialEq, Default)]
#[expect(missing_docs, reason = "the fields of `Half`, owned")]
pub struct HalfBuf {
    pub composite: Option<Plane<Rgb>>,
    pub matte: Option<Plane<Rgb>>,
    pub glossy: Option<Plane<Rgb>>,
}

/// Everything that goes into one file. Planes have the frame's extent.
///
/// Noisy frames, denoised ones and references are all written this way. For a denoised frame put the filtered signals
/// and passes into a copy of the input: `Frame { matte: Some(filtered.view()), ..frame }`.
#[derive(Clone, Debug)]
pub struct FrameToWrite<'a> {
    /// Cameras, number, guides, weights, signals, passes.
    pub frame: Frame<'a>,
    /// The picture. Absent: direct plus every signal times its weight.
    pub composite: Option<PlaneRef<'a, Rgb>>,
    /// The denoiser's confidence, 0..1.
    pub confidence: Option<PlaneRef<'a, f32>>,
    /// The denoiser's history length, frames.
    pub history_length: Option<PlaneRef<'a, f32>>,
    /// Motion to the next frame: next = current + `next_motion`, in pixels, y down. Absent: only the motion to the
    /// previous frame is written.
    pub next_motion: Option<PlaneRef<'a, [f32; 2]>>,
    /// Two independent halves.
    pub halves: [Half<'a>; 2],
    /// Header attributes.
    pub metadata: Metadata,
}

impl<'a> FrameToWrite<'a> {
    /// A frame with nothing beside it.
    pub fn new(frame: Frame<'a>) -> Self {
        Self {
            frame,
            composite: None,
            confidence: None,
            history_length: None,
            next_motion: None,
            halves: [Half::default(); 2],
            metadata: Metadata::default(),
        }
    }
}

/// Everything that was read from one file.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameFile {
    /// Cameras, number, guides, weights, signals, passes.
    pub frame: FrameBuf,
    /// The picture that the file holds.
    pub composite: Option<Plane<Rgb>>,
    /// The denoiser's confidence, 0..1.
    pub confidence: Option<Plane<f32>>,
    /// The denoiser's history length, frames.
    pub history_length: Option<Plane<f32>>,
    /// Motion to the next frame, where the file holds it: next = current + `next_motion`, in pixels, y down.
    pub next_motion: Option<Plane<[f32; 2]>>,
    /// Two independent halves.
    pub halves: [HalfBuf; 2],
    /// Header attributes.
    pub metadata: Metadata,
}

/// Names of the header attributes.
mod attribute {
    pub const VERSION: &str = "quell.version";
    pub const CONTENT: &str = "quell.content";
    pub const FRAME: &str = "quell.frame";
    pub const EXPOSURE: &str = "quell.exposure";
    /// Imath's matrices multiply row vectors and are stored row by row: the same sixteen numbers in the same order as
    /// `Camera::clip_from_world`, which multiplies column vectors and is stored column by column.
    pub const CAMERA: [&str; 3] = ["quell.clip_from_world", "quell.camera_position", "quell.camera_jitter"];
    pub const PREVIOUS_CAMERA: [&str; 3] =
        ["quell.previous_clip_from_world", "quell.previous_camera_position", "quell.previous_camera_jitter"];
    pub const SCENE: &str = "quell.scene";
    pub const SCENE_HASH: &str = "quell.scene_hash";
    pub const SAMPLING: &str = "quell.sampling";
    pub const SETTINGS: &str = "quell.settings";
    pub const MAPPING: &str = "quell.mapping";
    pub const FRAMES_PER_SECOND: &str = "quell.frames_per_second";
    /// Signal and name of every joint pass, in their order.
    pub const PASSES: &str = "quell.passes";
    /// Layers that the frame does not have and that were written with the value that absence stands for, because
    /// other programs expect them.
    pub const IMPLIED: &str = "quell.implied";
}

/// Writes one frame. The file appears whole or not at all; missing folders are made.
///
/// # Errors
/// [`Error::Frame`] where extents differ, [`Error::Foreign`] where another program's file stands at `path` and
/// `options.overwrite` is off, [`Error::NotSupported`] for names that EXR cannot hold, [`Error::Io`].
pub fn write_frame(path: &Path, frame: &FrameToWrite<'_>, options: &WriteOptions) -> Result<Written, Error> {
    if !options.overwrite && path.exists() && !is_quells(path) {
        return Err(Error::Foreign { path: path.to_owned() });
    }
    let (part, clamped_to_half) = part_of(path, frame, options.colours)?;
    write_whole(path, |writer| write_part(path, writer, part))?;
    let bytes = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
    Ok(Written { bytes, clamped_to_half })
}

/// The file that [`write_frame`] would write, in memory: for hosts without files. `name` stands in errors.
///
/// # Errors
/// As [`write_frame`], but for files.
pub fn frame_bytes(name: &Path, frame: &FrameToWrite<'_>, colours: Precision) -> Result<Vec<u8>, Error> {
    let (part, _) = part_of(name, frame, colours)?;
    let mut bytes = Cursor::new(Vec::new());
    write_part(name, &mut bytes, part)?;
    Ok(bytes.into_inner())
}

/// What is written, and how many components were clamped.
fn part_of(path: &Path, frame: &FrameToWrite<'_>, colours: Precision) -> Result<(ExrPart, usize), Error> {
    let mut layers = LayerWriter::new(path, frame.frame.size, colours);
    layers.add_frame(frame)?;
    let clamped_to_half = layers.clamped_to_half;
    let attributes = header(path, frame, &layers.implied)?;
    Ok((ExrPart { size: frame.frame.size, attributes, channels: layers.channels }, clamped_to_half))
}

/// True for a file that [`write_frame`] wrote.
pub fn is_quells(path: &Path) -> bool {
    read_attributes(path).is_ok_and(|attributes| attributes.contains_key(attribute::VERSION))
}

/// Planes to channels.
struct LayerWriter<'p> {
    path: &'p Path,
    size: Size,
    colours: Precision,
    channels: BTreeMap<String, Samples>,
    implied: Vec<&'static str>,
    clamped_to_half: usize,
}

impl<'p> LayerWriter<'p> {
    fn new(path: &'p Path, size: Size, colours: Precision) -> Self {
        Self { path, size, colours, channels: BTreeMap::new(), implied: Vec::new(), clamped_to_half: 0 }
    }

    fn add_frame(&mut self, file: &FrameToWrite<'_>) -> Result<(), Error> {
        let frame = &file.frame;
        let wrong = |source| Error::Frame { path: self.path.to_owned(), source };
        frame.check(self.size).map_err(wrong)?;
        match file.composite {
            Some(composite) => self.colour(c::COMPOSITE, Some(composite))?,
            None => {
                let composite = frame.composite();
                self.colour(c::COMPOSITE, Some(composite.view()))?;
            }
        }
        match frame.alpha {
            Some(alpha) => self.float(c::ALPHA, Some(alpha))?,
            None => {
                self.implied.push(c::ALPHA);
                self.float(c::ALPHA, Some(Plane::filled(self.size, 1.0).view()))?;
            }
        }
        self.colour(c::DIRECT, frame.direct)?;
        for (light, direct, weight, names) in [
            (frame.matte, frame.direct_matte, frame.matte_weight, [c::MATTE, c::DIRECT_MATTE, c::MATTE_WEIGHT]),
            (frame.glossy, frame.direct_glossy, frame.glossy_weight, [c::GLOSSY, c::DIRECT_GLOSSY, c::GLOSSY_WEIGHT]),
        ] {
            self.colour(names[0], light)?;
            self.colour(names[1], direct)?;
            self.colour(names[2], weight)?;
            if weight.is_none() && (light.is_some() || direct.is_some()) {
                self.implied.push(names[2]);
                self.colour(names[2], Some(Plane::filled(self.size, [1.0; 3]).view()))?;
            }
        }
        self.float(c::DEPTH, frame.view_depth)?;
        self.components(c::NORMAL, &c::XYZ, frame.normal)?;
        self.vector("X", "Y", frame.motion, |m| [m[0], -m[1]])?;
        self.vector("Z", "W", file.next_motion, |m| [-m[0], m[1]])?;
        self.float(c::ROUGHNESS, frame.roughness)?;
        self.float(c::MATTE_HIT_DISTANCE, frame.matte_hit_distance)?;
        self.float(c::GLOSSY_HIT_DISTANCE, frame.glossy_hit_distance)?;
        if let Some(ids) = frame.surface_id {
            let ids = self.checked(c::SURFACE_ID, ids)?;
            self.channels.insert(c::SURFACE_ID.to_owned(), Samples::Uint(ids));
        }
        self.float(c::MATTE_VARIANCE, frame.matte_variance)?;
        self.float(c::GLOSSY_VARIANCE, frame.glossy_variance)?;
        self.float(c::CONFIDENCE_IN, frame.confidence_in)?;
        self.float(c::CONFIDENCE, file.confidence)?;
        self.float(c::HISTORY, file.history_length)?;
        for pass in frame.passes {
            let layer = pass_layer(pass.signal, pass.name);
            if self.channels.contains_key(&c::channel(&layer, "R")) {
                let reason = format!("two passes of the {} signal are called `{}`", pass.signal.name(), pass.name);
                return Err(Error::invalid(self.path, reason));
            }
            self.colour(&layer, Some(pass.plane))?;
        }
        for (half, layer) in file.halves.iter().zip(c::HALVES) {
            self.colour(&c::channel(layer, "composite"), half.composite)?;
            self.colour(&c::channel(layer, "matte"), half.matte)?;
            self.colour(&c::channel(layer, "glossy"), half.glossy)?;
        }
        Ok(())
    }

    fn checked<T: Copy>(&self, name: &str, plane: PlaneRef<'_, T>) -> Result<Vec<T>, Error> {
        if plane.size() != self.size {
            let source = quell::Error::PlaneSize { plane: name.to_owned(), expected: self.size, found: plane.size() };
            return Err(Error::Frame { path: self.path.to_owned(), source });
        }
        Ok((0..self.size.height).flat_map(|y| plane.row(y).iter().copied()).collect())
    }

    fn float(&mut self, name: &str, plane: Option<PlaneRef<'_, f32>>) -> Result<(), Error> {
        if let Some(plane) = plane {
            let samples = self.checked(name, plane)?;
            self.channels.insert(name.to_owned(), Samples::Float(samples));
        }
        Ok(())
    }

    fn components<const N: usize>(
        &mut self,
        layer: &str,
        names: &[&str; N],
        plane: Option<PlaneRef<'_, [f32; N]>>,
    ) -> Result<(), Error> {
        if let Some(plane) = plane {
            let samples = self.checked(layer, plane)?;
            for (i, name) in names.iter().enumerate() {
                let component = samples.iter().map(|v| v[i]).collect();
                self.channels.insert(c::channel(layer, name), Samples::Float(component));
            }
        }
        Ok(())
    }

    fn vector(
        &mut self,
        first: &str,
        second: &str,
        plane: Option<PlaneRef<'_, [f32; 2]>>,
        convention: fn([f32; 2]) -> [f32; 2],
    ) -> Result<(), Error> {
        if let Some(plane) = plane {
            let turned =
                Plane::from_vec(self.size, self.checked(c::VECTOR, plane)?.into_iter().map(convention).collect())
                    .map_err(|source| Error::Frame { path: self.path.to_owned(), source })?;
            self.components(c::VECTOR, &[first, second], Some(turned.view()))?;
        }
        Ok(())
    }

    fn colour(&mut self, layer: &str, plane: Option<PlaneRef<'_, Rgb>>) -> Result<(), Error> {
        let Some(plane) = plane else { return Ok(()) };
        if self.colours == Precision::Float {
            return self.components(layer, &c::RGB, Some(plane));
        }
        let samples = self.checked(layer, plane)?;
        for (i, name) in c::RGB.iter().enumerate() {
            let mut clamped = 0;
            let component = samples
                .iter()
                .map(|v| {
                    let half = f16::from_f32(v[i]);
                    if half.is_infinite() && v[i].is_finite() {
                        clamped += 1;
                        return if v[i] > 0.0 { f16::MAX } else { f16::MIN };
                    }
                    half
                })
                .collect();
            self.clamped_to_half += clamped;
            self.channels.insert(c::channel(layer, name), Samples::Half(component));
        }
        Ok(())
    }
}

fn pass_layer(signal: Signal, name: &str) -> String {
    format!("{}.{}.{name}", c::PASS, signal.name())
}

fn header(path: &Path, file: &FrameToWrite<'_>, implied: &[&str]) -> Result<BTreeMap<String, AttributeValue>, Error> {
    use AttributeValue as V;
    let mut header = BTreeMap::new();
    let mut put = |name: &str, value| header.insert(name.to_owned(), value);
    let words = |value: &str| text(path, value).map(V::Text);
    let (frame, metadata) = (&file.frame, &file.metadata);
    put(attribute::VERSION, words(env!("CARGO_PKG_VERSION"))?);
    put(attribute::CONTENT, words(metadata.content.name())?);
    // An integer where it fits, so that other programs can use it; any i64 must survive.
    put(attribute::FRAME, i32::try_from(frame.index).map_or(words(&frame.index.to_string())?, V::I32));
    put(attribute::EXPOSURE, V::F32(metadata.exposure));
    for (names, camera) in [(attribute::CAMERA, &frame.camera), (attribute::PREVIOUS_CAMERA, &frame.previous_camera)] {
        let [x, y, z] = camera.position;
        put(names[0], V::Matrix4x4(camera.clip_from_world));
        put(names[1], V::FloatVec3((x, y, z)));
        put(names[2], V::FloatVec2(exr::math::Vec2(camera.jitter[0], camera.jitter[1])));
    }
    for (name, value) in [
        (attribute::SCENE, &metadata.scene),
        (attribute::SCENE_HASH, &metadata.scene_hash),
        (attribute::SAMPLING, &metadata.sampling),
        (attribute::SETTINGS, &metadata.settings),
        (attribute::MAPPING, &metadata.mapping),
    ] {
        if !value.is_empty() {
            put(name, words(value)?);
        }
    }
    if metadata.frames_per_second != 0.0 {
        put(attribute::FRAMES_PER_SECOND, V::F32(metadata.frames_per_second));
    }
    if !frame.passes.is_empty() {
        let lines = frame.passes.iter().map(|pass| {
            if pass.name.contains('\n') {
                return Err(Error::not_supported(path, format!("pass name {:?} has a line break", pass.name)));
            }
            Ok(format!("{} {}", pass.signal.name(), pass.name))
        });
        put(attribute::PASSES, words(&lines.collect::<Result<Vec<_>, _>>()?.join("\n"))?);
    }
    if !implied.is_empty() {
        put(attribute::IMPLIED, words(&implied.join(" "))?);
    }
    Ok(header)
}

/// Reads a frame that [`write_frame`] wrote; every plane, camera and text comes back, colours in the precision that
/// they were written with.
///
/// # Errors
/// [`Error::Invalid`] for files that are cut short, contradict themselves or lack part of a colour or of a camera,
/// [`Error::NotSupported`] for files of other programs, [`Error::Io`].
pub fn read_frame(path: &Path) -> Result<FrameFile, Error> {
    LayerReader { path, part: read_part(path)? }.frame_file()
}

/// Channels to planes. Every method takes what it reads out of the part.
struct LayerReader<'p> {
    path: &'p Path,
    part: ExrPart,
}

impl LayerReader<'_> {
    fn frame_file(mut self) -> Result<FrameFile, Error> {
        if !self.part.attributes.contains_key(attribute::VERSION) {
            return Err(Error::not_supported(
                self.path,
                "this file was not written by quell; files of other programs cannot be read yet",
            ));
        }
        let metadata = Metadata {
            content: self.content()?,
            version: self.words(attribute::VERSION)?,
            scene: self.words(attribute::SCENE)?,
            scene_hash: self.words(attribute::SCENE_HASH)?,
            sampling: self.words(attribute::SAMPLING)?,
            settings: self.words(attribute::SETTINGS)?,
            mapping: self.words(attribute::MAPPING)?,
            frames_per_second: match self.part.attributes.get(attribute::FRAMES_PER_SECOND) {
                None => 0.0,
                Some(AttributeValue::F32(value)) => *value,
                Some(_) => return Err(self.wrong_kind(attribute::FRAMES_PER_SECOND)),
            },
            exposure: match self.part.attributes.get(attribute::EXPOSURE) {
                Some(AttributeValue::F32(value)) => *value,
                _ => return Err(self.wrong_kind(attribute::EXPOSURE)),
            },
        };
        for layer in self.words(attribute::IMPLIED)?.split_whitespace() {
            self.part.channels.remove(layer);
            for component in c::RGB {
                self.part.channels.remove(&c::channel(layer, component));
            }
        }

        let mut frame = FrameBuf::new(self.part.size, self.camera(attribute::CAMERA)?);
        frame.previous_camera = self.camera(attribute::PREVIOUS_CAMERA)?;
        frame.index = self.index()?;
        frame.direct = self.colour(c::DIRECT)?;
        frame.matte = self.colour(c::MATTE)?;
        frame.glossy = self.colour(c::GLOSSY)?;
        frame.direct_matte = self.colour(c::DIRECT_MATTE)?;
        frame.direct_glossy = self.colour(c::DIRECT_GLOSSY)?;
        frame.matte_weight = self.colour(c::MATTE_WEIGHT)?;
        frame.glossy_weight = self.colour(c::GLOSSY_WEIGHT)?;
        frame.view_depth = self.float(c::DEPTH)?;
        frame.normal = self.components(c::NORMAL, c::XYZ)?;
        frame.motion = self.components(c::VECTOR, ["X", "Y"])?.map(|p| turned(p, |v| [v[0], -v[1]]));
        let next_motion = self.components(c::VECTOR, ["Z", "W"])?.map(|p| turned(p, |v| [-v[0], v[1]]));
        frame.roughness = self.float(c::ROUGHNESS)?;
        frame.matte_hit_distance = self.float(c::MATTE_HIT_DISTANCE)?;
        frame.glossy_hit_distance = self.float(c::GLOSSY_HIT_DISTANCE)?;
        frame.surface_id = match self.part.channels.remove(c::SURFACE_ID) {
            None => None,
            Some(Samples::Uint(ids)) => Some(self.plane(ids)?),
            Some(_) => return Err(self.wrong_samples(c::SURFACE_ID, "unsigned integers")),
        };
        frame.alpha = self.float(c::ALPHA)?;
        frame.matte_variance = self.float(c::MATTE_VARIANCE)?;
        frame.glossy_variance = self.float(c::GLOSSY_VARIANCE)?;
        frame.confidence_in = self.float(c::CONFIDENCE_IN)?;
        for line in self.words(attribute::PASSES)?.lines() {
            let found = line
                .split_once(' ')
                .and_then(|(signal, name)| Some((Signal::ALL.into_iter().find(|s| s.name() == signal)?, name)));
            let Some((signal, name)) = found else {
                return Err(Error::invalid(self.path, format!("the header's pass list has `{line}`")));
            };
            let Some(plane) = self.colour(&pass_layer(signal, name))? else {
                return Err(Error::invalid(self.path, format!("pass `{name}` is listed but has no channels")));
            };
            frame.passes.push(PassBuf { name: name.to_owned(), signal, plane });
        }

        let mut halves = [HalfBuf::default(), HalfBuf::default()];
        for (half, layer) in halves.iter_mut().zip(c::HALVES) {
            half.composite = self.colour(&c::channel(layer, "composite"))?;
            half.matte = self.colour(&c::channel(layer, "matte"))?;
            half.glossy = self.colour(&c::channel(layer, "glossy"))?;
        }
        Ok(FrameFile {
            composite: self.colour(c::COMPOSITE)?,
            confidence: self.float(c::CONFIDENCE)?,
            history_length: self.float(c::HISTORY)?,
            next_motion,
            halves,
            metadata,
            frame,
        })
    }

    fn wrong_kind(&self, name: &str) -> Error {
        Error::invalid(self.path, format!("header attribute `{name}` is missing or of another kind"))
    }

    fn wrong_samples(&self, channel: &str, expected: &str) -> Error {
        Error::invalid(self.path, format!("channel `{channel}` does not hold {expected}"))
    }

    fn words(&self, name: &str) -> Result<String, Error> {
        match self.part.attributes.get(name) {
            None => Ok(String::new()),
            Some(AttributeValue::Text(value)) => Ok(string(value)),
            Some(_) => Err(self.wrong_kind(name)),
        }
    }

    fn content(&self) -> Result<Content, Error> {
        let word = self.words(attribute::CONTENT)?;
        Content::ALL
            .into_iter()
            .find(|content| content.name() == word)
            .ok_or_else(|| Error::invalid(self.path, format!("`{word}` is not a known kind of content")))
    }

    fn index(&self) -> Result<i64, Error> {
        match self.part.attributes.get(attribute::FRAME) {
            Some(AttributeValue::I32(value)) => Ok(i64::from(*value)),
            Some(AttributeValue::Text(value)) => string(value).parse().map_err(|_| self.wrong_kind(attribute::FRAME)),
            _ => Err(self.wrong_kind(attribute::FRAME)),
        }
    }

    fn camera(&self, names: [&str; 3]) -> Result<Camera, Error> {
        let attributes = &self.part.attributes;
        let Some(AttributeValue::Matrix4x4(clip_from_world)) = attributes.get(names[0]) else {
            return Err(self.wrong_kind(names[0]));
        };
        let Some(AttributeValue::FloatVec3((x, y, z))) = attributes.get(names[1]) else {
            return Err(self.wrong_kind(names[1]));
        };
        let Some(AttributeValue::FloatVec2(jitter)) = attributes.get(names[2]) else {
            return Err(self.wrong_kind(names[2]));
        };
        Ok(Camera { clip_from_world: *clip_from_world, position: [*x, *y, *z], jitter: [jitter.0, jitter.1] })
    }

    fn plane<T: Copy>(&self, samples: Vec<T>) -> Result<Plane<T>, Error> {
        Plane::from_vec(self.part.size, samples).map_err(|e| Error::invalid(self.path, e.to_string()))
    }

    fn samples(&mut self, channel: &str) -> Result<Option<Vec<f32>>, Error> {
        match self.part.channels.remove(channel) {
            None => Ok(None),
            Some(Samples::Float(values)) => Ok(Some(values)),
            Some(Samples::Half(values)) => Ok(Some(values.into_iter().map(f16::to_f32).collect())),
            Some(Samples::Uint(_)) => Err(self.wrong_samples(channel, "numbers with a fraction")),
        }
    }

    fn float(&mut self, channel: &str) -> Result<Option<Plane<f32>>, Error> {
        self.samples(channel)?.map(|values| self.plane(values)).transpose()
    }

    fn colour(&mut self, layer: &str) -> Result<Option<Plane<Rgb>>, Error> {
        self.components(layer, c::RGB)
    }

    fn components<const N: usize>(&mut self, layer: &str, names: [&str; N]) -> Result<Option<Plane<[f32; N]>>, Error> {
        let mut merged: Option<Vec<[f32; N]>> = None;
        for (i, name) in names.iter().enumerate() {
            let channel = c::channel(layer, name);
            let samples = self.samples(&channel)?;
            match (samples, &mut merged) {
                (Some(samples), merged) if i == 0 => {
                    *merged = Some(samples.into_iter().map(|first| [first; N]).collect());
                }
                (Some(samples), Some(merged)) => {
                    for (pixel, value) in merged.iter_mut().zip(samples) {
                        pixel[i] = value;
                    }
                }
                (None, None) => {}
                (None, Some(_)) | (Some(_), None) => {
                    let reason = format!("of `{}` only some channels are there", c::channel(layer, &names.join("/")));
                    return Err(Error::invalid(self.path, reason));
                }
            }
        }
        merged.map(|values| self.plane(values)).transpose()
    }
}

fn turned(plane: Plane<[f32; 2]>, convention: fn([f32; 2]) -> [f32; 2]) -> Plane<[f32; 2]> {
    let mut plane = plane;
    for value in plane.data_mut() {
        *value = convention(*value);
    }
    plane
}
