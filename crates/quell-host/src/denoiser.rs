//! Frames in, frames out.

use crate::device::Gpu;
use crate::error::Error;
use crate::part::{FrameInfo, Part, Shown};
use crate::readback::Readback;
use crate::tiles::Layout;
use quell::denoiser::MAX_EXTENT;
use quell::gpu::{Area, Options, PackedFrame, wgpu};
use quell::pipeline::Stage;
use quell::report::StageTimes;
use quell::{Camera, Frame, Output, OutputBuf, Report, Settings, Size};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// [`quell::Denoiser`]'s twin on a device of this program. Frames larger than the device's textures are filtered in tiles.
#[derive(Debug)]
pub struct Denoiser {
    gpu: Arc<Gpu>,
    layout: Layout,
    /// Which tile takes what from which after each frame.
    exchanges: Vec<(usize, usize, Area)>,
    parts: Vec<Part>,
    info: Option<FrameInfo>,
    /// Of the frame that was uploaded last.
    beyond: u64,
    output: Option<OutputBuf>,
}

/// A frame that has run.
#[derive(Clone, Debug)]
pub struct Ran {
    /// Where it lies: of each tile, margins included.
    pub outputs: Vec<quell::gpu::Output>,
    /// From encoding to the end.
    pub wall: Duration,
    /// Of its stages, where the adapter has timestamps.
    pub times: StageTimes,
}

/// Memory on the device, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// What outlives a frame: history and the guides of the frame before.
    pub persistent: u64,
    /// What is needed within a frame, results included.
    pub transient: u64,
    /// Frames as they are uploaded.
    pub uploaded: u64,
}

/// How a frame is cut into tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiling {
    /// Tiles.
    pub tiles: usize,
    /// Pixels of overlap around each tile's own.
    pub margin: usize,
    /// Pixels of the last frame that moved farther than that, and so begin afresh.
    pub beyond: u64,
}

impl Denoiser {
    /// A denoiser for frames of `size`.
    ///
    /// # Errors
    /// A size or a setting that the denoiser refuses; the device's memory.
    pub fn new(gpu: Arc<Gpu>, size: Size, settings: &Settings) -> Result<Self, Error> {
        let most = gpu.device().limits().max_texture_dimension_2d;
        Self::with_limit(gpu, size, settings, most as usize)
    }

    /// [`Denoiser::new`] with textures of at most `most` pixels a side: larger frames are cut into tiles.
    ///
    /// # Errors
    /// As [`Denoiser::new`]; a limit that leaves nothing between the margins of a tile.
    pub fn with_limit(gpu: Arc<Gpu>, size: Size, settings: &Settings, most: usize) -> Result<Self, Error> {
        settings.check().map_err(quell::gpu::Error::Denoiser)?;
        if size.width > MAX_EXTENT || size.height > MAX_EXTENT {
            return Err(quell::gpu::Error::Denoiser(quell::Error::SizeTooLarge { size, limit: MAX_EXTENT }).into());
        }
        let layout = Layout::new(size, settings, most).ok_or(quell::gpu::Error::Size {
            pass: "denoiser",
            size,
            limit: "max_texture_dimension_2d, tiles with their margins included",
        })?;
        Self::with_layout(gpu, layout, settings, None)
    }

    /// `compiled`: one with the same settings, whose passes are taken over.
    fn with_layout(
        gpu: Arc<Gpu>,
        layout: Layout,
        settings: &Settings,
        compiled: Option<&quell::gpu::Denoiser>,
    ) -> Result<Self, Error> {
        let size = layout.whole;
        let mut options = Options::new(settings);
        options.composite = true;
        options.timings = true;
        let mut parts: Vec<Part> = Vec::with_capacity(layout.pieces.len());
        for &piece in &layout.pieces {
            let guest = match parts.first().map(|part| &part.guest).or(compiled) {
                None => quell::gpu::Denoiser::new(gpu.device(), piece.size(), &options)?,
                Some(compiled) => compiled.another(gpu.device(), piece.size())?,
            };
            parts.push(Part::new(guest, piece, size));
            // A device that has no memory left must not be asked for more.
            gpu.check(&format!("the planes of {size}"))?;
        }
        Ok(Self { gpu, exchanges: layout.exchanges(), layout, parts, info: None, beyond: 0, output: None })
    }

    /// Forgets history: the next frame starts afresh.
    pub fn reset(&mut self) {
        self.parts.iter_mut().for_each(|part| part.guest.reset());
    }

    /// Filters the next frame: uploads it, runs it, reads it back.
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; what the device reports.
    pub fn denoise(&mut self, frame: &Frame<'_>) -> Result<Output<'_>, Error> {
        let begin = Instant::now();
        self.write(frame)?;
        let uploading = begin.elapsed();
        let mut encoder = self.gpu.encoder("quell host");
        let outputs = self.encode(&mut encoder)?;
        let mut readback = Readback::default();
        for (part, encoded) in self.parts.iter().zip(&outputs) {
            part.copy_back(&self.gpu, &mut encoder, encoded, &mut readback);
        }
        let contents = readback.read(&self.gpu, encoder, "a frame")?;
        let times = self.times();
        let begin = Instant::now();
        let mut read = self.unpack(&outputs, contents)?;
        read.report.times = times;
        read.report.times.border = uploading + begin.elapsed();
        Ok(self.output.insert(read).output())
    }

    /// Brings a frame onto the device, for [`Denoiser::run`].
    ///
    /// # Errors
    /// What [`quell::Frame::check`] finds; what the device reports.
    pub fn upload(&mut self, frame: &Frame<'_>) -> Result<(), Error> {
        self.write(frame)?;
        // Without this the copies would run, and be timed, with the frame.
        self.gpu.queue().submit([]);
        self.gpu.wait("uploading a frame")
    }

    /// Copies a frame to the device with the next submit.
    fn write(&mut self, frame: &Frame<'_>) -> Result<(), Error> {
        let whole = self.layout.whole;
        frame.check(whole).map_err(quell::gpu::Error::Denoiser)?;
        let Some(storage) = self.parts.first().map(|part| part.guest.storage()) else { return Err(Error::NoFrame) };
        let packed = PackedFrame::new(frame, storage).map_err(quell::gpu::Error::Denoiser)?;
        for part in &mut self.parts {
            part.upload(&self.gpu, &packed, whole, storage);
        }
        self.info = Some(FrameInfo::new(frame, &packed));
        self.beyond = frame.motion.map_or(0, |motion| self.layout.beyond(motion));
        Ok(())
    }

    /// Runs what was uploaded, as the frame after the one before; the wall time from encoding to the end.
    ///
    /// # Errors
    /// Nothing was uploaded; what the device reports.
    pub fn run(&mut self) -> Result<Ran, Error> {
        let begin = Instant::now();
        let mut encoder = self.gpu.encoder("quell host");
        let outputs = self.encode(&mut encoder)?;
        self.gpu.run(encoder, "a frame")?;
        let wall = begin.elapsed();
        Ok(Ran { outputs, wall, times: self.times() })
    }

    /// Gives what was uploaded other cameras and another number, so that it can run as a further frame of a sequence without
    /// another upload.
    ///
    /// # Errors
    /// Nothing was uploaded.
    pub fn renumber(&mut self, camera: Camera, previous_camera: Camera, index: i64) -> Result<(), Error> {
        let info = self.info.as_mut().ok_or(Error::NoFrame)?;
        (info.camera, info.previous_camera, info.index) = (camera, previous_camera, index);
        Ok(())
    }

    /// Appends what was uploaded, as the frame after the one before.
    fn encode(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<Vec<quell::gpu::Output>, Error> {
        let Some(info) = &self.info else { return Err(Error::NoFrame) };
        let encode = |part: &mut Part| part.encode(&self.gpu, encoder, info);
        let outputs: Vec<_> = self.parts.iter_mut().map(encode).collect::<Result<_, _>>()?;
        for &(to, from, area) in &self.exchanges {
            if let (Some(to), Some(from)) = (self.parts.get(to), self.parts.get(from)) {
                to.guest.take_margin(encoder, &from.guest, area)?;
            }
        }
        Ok(outputs)
    }

    /// Of the stages of what has run, where the adapter has timestamps.
    fn times(&mut self) -> StageTimes {
        let mut times = StageTimes::default();
        let timings = self.parts.iter_mut().flat_map(|part| part.guest.take_timings(self.gpu.queue()));
        for timing in timings.flatten() {
            // Of stages that share a pass the first has the time of all.
            if let Some(&stage) = timing.stages.first() {
                let so_far = times.get(stage).unwrap_or_default();
                times.set(stage, so_far + Duration::from_secs_f64(timing.milliseconds.max(0.0) * 1e-3));
            }
        }
        times
    }

    /// How frames are cut into tiles; `None`: they fit the device's textures.
    pub fn tiling(&self) -> Option<Tiling> {
        let tiles = self.parts.len();
        (tiles > 1).then_some(Tiling { tiles, margin: self.layout.margin, beyond: self.beyond })
    }

    /// What a user should know of how frames run, in sentences.
    pub fn notes(&self) -> Vec<String> {
        let Some(Tiling { tiles, margin, beyond }) = self.tiling() else { return Vec::new() };
        let mut notes = vec![format!(
            "frames of {} are larger than the device's textures: {tiles} tiles, whose margins of {margin} pixels overlap",
            self.layout.whole
        )];
        if beyond > 0 {
            notes.push("pixels near the edges of tiles moved farther than their margins: they began afresh".to_owned());
        }
        notes
    }

    /// Memory of the textures that the last frame needed, on the device.
    pub fn memory(&self) -> Memory {
        let mut all = Memory::default();
        for part in &self.parts {
            let own = part.guest.memory();
            all.persistent += own.persistent;
            all.transient += own.transient;
            all.uploaded += part.uploaded_bytes();
        }
        all
    }

    /// Names of the passes that ran several stages of the last frame.
    pub fn shared_passes(&self) -> Vec<&'static str> {
        let passes = self.parts.iter().take(1).flat_map(|part| &part.guest.program().dispatches).map(|d| d.pass);
        passes.filter(|pass| pass.stages.len() > 1).map(|pass| pass.name).collect()
    }

    /// Bytes that a stage moves for each pixel of the picture, as the last frame ran; where tiles overlap, they count twice.
    pub fn bytes_per_pixel(&self, stage: Stage) -> Option<u32> {
        let once = self.parts.first()?.guest.program().bytes_per_pixel(stage)?;
        Some((f64::from(once) * self.layout.overlap()).round() as u32)
    }

    fn unpack(&self, encoded: &[quell::gpu::Output], contents: Vec<Vec<u8>>) -> Result<OutputBuf, Error> {
        let Some(info) = &self.info else { return Err(Error::NoFrame) };
        let mut contents = contents.into_iter();
        let mut whole: Option<Shown> = None;
        for (part, encoded) in self.parts.iter().zip(encoded) {
            let shown = part.unpack(&self.gpu, encoded, info, &mut contents)?;
            if self.parts.len() == 1 {
                whole = Some(shown);
            } else {
                let picture = whole.get_or_insert_with(|| Shown::empty(self.layout.whole, &shown));
                picture.paste(&shown, &part.piece);
            }
        }
        let Some(Shown { composite, direct, signals: [matte, glossy], confidence, history_length }) = whole else {
            return Err(Error::NoFrame);
        };
        let report = Report {
            sanitised: info.sanitised,
            reset_pixels: confidence.data().iter().filter(|c| **c == 0.0).count() as u64,
            had_history: encoded.iter().any(|output| output.had_history),
            times: StageTimes::default(),
        };
        Ok(OutputBuf { composite, direct, matte, glossy, confidence, history_length, report })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Wanted, tiles::Layout};
    use glam::Vec3;
    use quell::{FrameBuf, PassBuf, Plane, Rgb, Signal};
    use quell_trace::scene::CameraPath;
    use quell_trace::{Control, RenderOptions, Tracer, builtin};

    fn gpu() -> Option<Arc<Gpu>> {
        match Gpu::open(Wanted::Named("")) {
            Ok(gpu) => Some(Arc::new(gpu)),
            Err(why) => {
                let required = std::env::var_os("QUELL_REQUIRE_GPU").is_some_and(|v| v == "1");
                assert!(!required, "QUELL_REQUIRE_GPU is set, but {why}");
                println!("SKIPPED: {why}");
                None
            }
        }
    }

    /// A camera that moves some pixels a frame, jitter, and a joint pass of either signal.
    fn frames(size: Size, count: i64) -> Vec<FrameBuf> {
        let mut scene = builtin("glossy-room").unwrap();
        let place = |f: f64| (Vec3::new(0.06 * f as f32, 1.2, 2.3), Vec3::new(0.0, 0.7 + 0.04 * f as f32, -1.0));
        scene.cameras = vec![CameraPath::moving(48.0, place)];
        let options = RenderOptions { jitter: true, direct_samples: 1, ..RenderOptions::new(size) };
        let pass = |name: &str, signal, light: &Option<Plane<Rgb>>| {
            let halved = light.as_ref().unwrap().data().iter().map(|c| c.map(|v| 0.5 * v)).collect();
            PassBuf { name: name.to_owned(), signal, plane: Plane::from_vec(size, halved).unwrap() }
        };
        let of = |n| {
            let mut frame = Tracer::new(&scene, n, 1).unwrap().render(&options, &Control::default()).unwrap().frame;
            frame.passes = vec![pass("sun", Signal::Matte, &frame.matte), pass("lamp", Signal::Glossy, &frame.glossy)];
            frame
        };
        (0..count).map(of).collect()
    }

    /// Every value of every plane of every frame, and what was said of it.
    fn bits(denoiser: &mut Denoiser, frames: &[FrameBuf]) -> Vec<(Vec<u32>, u64, bool)> {
        let one = |frame: &FrameBuf| {
            let passes = frame.pass_views();
            let output = denoiser.denoise(&frame.frame(&passes)).unwrap();
            let signals = output.matte.into_iter().chain(output.glossy);
            let passes = Signal::ALL.into_iter().flat_map(|signal| output.passes(signal));
            let colours = [output.composite, output.direct].into_iter().chain(signals).chain(passes);
            let state = [output.confidence, output.history_length].into_iter().flat_map(|p| p.data());
            let values = colours.flat_map(|p| p.data()).flatten().chain(state).map(|v| v.to_bits());
            (values.collect(), output.report.reset_pixels, output.report.had_history)
        };
        frames.iter().map(one).collect()
    }

    #[test]
    fn tiles_give_the_bits_of_the_whole_picture() {
        let Some(gpu) = gpu() else { return };
        let mut settings = Settings::default();
        settings.antialiasing.enabled = true;
        let size = Size::new(80, 80);
        let frames = frames(size, 6);
        let mut whole = Denoiser::new(gpu.clone(), size, &settings).unwrap();
        let expected = bits(&mut whole, &frames);
        let agrees = |tiled: &mut Denoiser, count: usize| {
            let found = bits(tiled, &frames[..count]);
            for (index, (a, b)) in expected.iter().zip(&found).enumerate() {
                let off = a.0.iter().zip(&b.0).filter(|(a, b)| a != b).count();
                assert!(a == b, "frame {index}: {off} of {} values differ", a.0.len());
                assert!(index == 0 || a.2, "frame {index} has no history");
            }
            println!("{:?}: {} values alike", tiled.tiling(), found.len() * found[0].0.len());
        };
        let mut usual = Denoiser::with_limit(gpu.clone(), size, &settings, 79).unwrap();
        agrees(&mut usual, 3);
        // What it costs: overlapping tiles take more, and hold more.
        let bytes = |denoiser: &Denoiser| denoiser.bytes_per_pixel(Stage::GlossyHorizontal).unwrap();
        assert!(bytes(&usual) > bytes(&whole) && usual.memory().persistent > whole.memory().persistent);
        assert_eq!((whole.tiling(), usual.tiling().unwrap().beyond), (None, 0));
        // A cut is one for every tile.
        usual.reset();
        assert!(!bits(&mut usual, &frames[5..])[0].2);

        // Four tiles whose margins just suffice for this motion: what is wrong in them is in the cores after three frames.
        let tight = |margin: usize| {
            let layout = Layout::with_margin(size, margin, 79).unwrap();
            Denoiser::with_layout(gpu.clone(), layout, &settings, Some(&whole.parts[0].guest)).unwrap()
        };
        let margin = 12;
        agrees(&mut tight(margin), frames.len());
        // Differences that must be seen: margins that nobody refreshes, those of one tile, and too narrow ones.
        let seen = |mut planted: Denoiser, what: &str| {
            assert!(bits(&mut planted, &frames) != expected, "{what} went unseen");
        };
        seen(Denoiser { exchanges: Vec::new(), ..tight(margin) }, "margins that are not refreshed");
        // Which of them shows it depends on where the camera goes.
        let without = |tile: usize| {
            let mut one = tight(margin);
            one.exchanges.retain(|(to, ..)| *to != tile);
            bits(&mut one, &frames) != expected
        };
        assert!((0..4).any(without), "one tile's margin that is not refreshed went unseen");
        seen(tight(3), "a margin of 3 pixels");
        gpu.check("the tests").unwrap();
    }
}
