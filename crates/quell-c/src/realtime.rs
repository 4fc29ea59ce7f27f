//! The real-time filter.

use crate::handle::{self, Handle, Inside, Pool, call};
use crate::memory::{self, Layout};
use crate::status::Failure;
use crate::types::{
    QUELL_F32, QUELL_U32, quell_camera, quell_pass, quell_realtime_frame, quell_realtime_options, quell_status,
    quell_target,
};
use quell::{Camera, Denoiser, FrameBuf, Output, Plane, Preset, Settings, Size};
use quell_frames::arrays::set_plane;
use std::ffi::{c_char, c_int};

/// The handle of C.
pub type quell_realtime = Handle<Realtime>;

/// What it holds.
pub struct Realtime {
    denoiser: Denoiser,
    pool: Pool,
    /// Of the last frame.
    camera: Option<Camera>,
    output: Option<Shown>,
}

/// What a frame became.
struct Shown {
    colours: [(&'static str, Option<Plane<[f32; 3]>>); 4],
    numbers: [(&'static str, Plane<f32>); 2],
}

impl Shown {
    fn of(frame: &FrameBuf, output: &Output<'_>) -> Self {
        let of = |signal: &Option<Plane<[f32; 3]>>, plane| signal.as_ref().and_then(|_| cloned(plane));
        Self {
            colours: [
                ("color", Some(output.composite.clone())),
                ("direct", Some(output.direct.clone())),
                ("matte", of(&frame.matte, output.matte)),
                ("glossy", of(&frame.glossy, output.glossy)),
            ],
            numbers: [("confidence", output.confidence.clone()), ("history_length", output.history_length.clone())],
        }
    }
}

/// Not inlined, so that it is asked only of signals that are there: the filter computes that an absent one has no plane in a way that
/// valgrind takes for a use of memory without a value.
#[inline(never)]
fn cloned(plane: Option<&Plane<[f32; 3]>>) -> Option<Plane<[f32; 3]>> {
    plane.cloned()
}

impl Inside for Realtime {
    const WORD: &'static str = "denoiser";
    const ALIVE: u64 = 0x7175_656c_6c5f_7274;

    fn reset(&mut self) {
        self.denoiser.reset();
        (self.camera, self.output) = (None, None);
    }
}

impl Realtime {
    fn denoise(&mut self, given: &quell_realtime_frame) -> Result<bool, Failure> {
        // SAFETY: the header asks for structs that begin with their size.
        let (camera, previous) = unsafe {
            let previous = given.previous_camera;
            let previous = if previous.is_null() { None } else { Some(camera("previous_camera", previous)?) };
            (camera("camera", given.camera)?, previous)
        };
        let size = self.denoiser.size();
        let mut frame = FrameBuf::new(size, camera);
        frame.previous_camera = previous.or(self.camera).unwrap_or(camera);
        frame.index = given.index;
        for index in 0..given.plane_count {
            // SAFETY: the header asks for as many structs.
            let pass = unsafe { memory::listed("planes", "plane", given.planes, index)? };
            put(&mut frame, index, &pass)?;
        }
        let Self { denoiser, pool, .. } = self;
        let (shown, had_history) = pool.install(|| {
            denoiser.denoise(&frame.frame(&[])).map(|output| (Shown::of(&frame, &output), output.report.had_history))
        })?;
        (self.camera, self.output) = (Some(camera), Some(shown));
        Ok(had_history)
    }

    fn read(&self, name: &str, target: &quell_target) -> Result<(), Failure> {
        let shown = self.output.as_ref().ok_or_else(|| Failure::argument("name: no frame was denoised yet"))?;
        let size = self.denoiser.size();
        let strides = [target.channel_stride, target.pixel_stride, target.row_stride];
        let layout = Layout::new("target", target.type_, target.channels, strides, size)?;
        if target.data.is_null() {
            return Err(Failure::argument("target: data is null"));
        }
        let fits = |has: usize| {
            let reason = format!("target: {} channels, and {name} has {has}", layout.channels);
            if layout.channels <= has { Ok(()) } else { Err(Failure::argument(reason)) }
        };
        if let Some((_, plane)) = shown.colours.iter().find(|(known, _)| *known == name) {
            let reason = || Failure::argument(format!("{name}: the frame had no such signal"));
            let data = plane.as_ref().ok_or_else(reason)?.data();
            fits(3)?;
            let value = |c: usize, pixel: usize| data.get(pixel).and_then(|p| p.get(c)).copied().unwrap_or(0.0);
            // SAFETY: the header asks for room laid out like this.
            unsafe { memory::write(3, value, target.data, &layout, size) };
            return Ok(());
        }
        let Some((_, plane)) = shown.numbers.iter().find(|(known, _)| *known == name) else {
            let known = "color, direct, matte, glossy, confidence, history_length";
            return Err(Failure::argument(format!("name: `{name}`; there are {known}")));
        };
        fits(1)?;
        let value = |_: usize, pixel: usize| plane.data().get(pixel).copied().unwrap_or(0.0);
        // SAFETY: the header asks for room laid out like this.
        unsafe { memory::write(1, value, target.data, &layout, size) };
        Ok(())
    }
}

/// # Safety
/// Null, or a struct that begins with its size.
unsafe fn camera(name: &str, from: *const quell_camera) -> Result<Camera, Failure> {
    // SAFETY: as the caller promises.
    let quell_camera { clip_from_world, position, jitter, .. } = unsafe { memory::versioned(name, from)? };
    Ok(Camera { clip_from_world, position, jitter })
}

/// Copies a plane of the caller's into the frame.
fn put(frame: &mut FrameBuf, index: usize, pass: &quell_pass) -> Result<(), Failure> {
    let word = format!("plane {index}");
    // SAFETY: the header asks for strings that end with a zero.
    let name = unsafe { memory::text(&word, pass.name)? };
    let name = name.ok_or_else(|| Failure::argument(format!("{word}: without a name")))?;
    let are_ids = name == "surface_id" && pass.type_ == QUELL_U32;
    let type_ = if are_ids { QUELL_F32 } else { pass.type_ };
    let strides = [pass.channel_stride, pass.pixel_stride, pass.row_stride];
    let layout = Layout::new(&name, type_, pass.channels, strides, frame.size)?;
    if pass.data.is_null() {
        return Err(Failure::argument(format!("{name}: data is null")));
    }
    if are_ids {
        if pass.channels != 1 {
            return Err(Failure::argument(format!("{name}: {} channels, expected 1", pass.channels)));
        }
        // SAFETY: the header asks for numbers laid out like this.
        let ids = unsafe { memory::read_ids(pass.data, &layout, frame.size) };
        frame.surface_id = Some(Plane::from_vec(frame.size, ids)?);
        return Ok(());
    }
    // SAFETY: the header asks for numbers laid out like this.
    let values = unsafe { memory::read_pixels(pass.data, &layout, frame.size) };
    Ok(set_plane(frame, &name, values, layout.channels)?)
}

fn create(options: *const quell_realtime_options) -> Result<Realtime, Failure> {
    // SAFETY: the header asks for a struct that begins with its size, and for strings that end with a zero.
    let (given, preset) = unsafe {
        let given = memory::versioned("options", options)?;
        (given, memory::text("preset", given.preset)?)
    };
    let size = Size::new(given.width as usize, given.height as usize);
    if size.width == 0 || size.height == 0 || size.width > 1 << 16 || size.height > 1 << 16 {
        return Err(Failure::argument(format!("options: {size}; each extent must be 1 to 65536")));
    }
    let preset: Preset = preset.as_deref().map_or(Ok(Preset::default()), str::parse)?;
    let denoiser = Denoiser::new(size, &Settings::preset(preset))?;
    Ok(Realtime { denoiser, pool: Pool::new(given.threads as usize)?, camera: None, output: None })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_create(
    options: *const quell_realtime_options,
    denoiser: *mut *mut quell_realtime,
    message: *mut c_char,
    capacity: usize,
) -> quell_status {
    handle::create(denoiser, message, capacity, || create(options))
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_set(
    denoiser: *mut quell_realtime,
    parameter: *const c_char,
    value: *const c_char,
) -> quell_status {
    call(denoiser, |inner| {
        // SAFETY: the header asks for strings that end with a zero.
        let (name, value) = unsafe { (memory::text("parameter", parameter)?, memory::text("value", value)?) };
        let (Some(name), Some(value)) = (name, value) else {
            return Err(Failure::argument("parameter, value: a null pointer"));
        };
        let mut settings = inner.denoiser.settings().clone();
        settings.set(&name, &value)?;
        Ok(inner.denoiser.set_settings(&settings)?)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_denoise(
    denoiser: *mut quell_realtime,
    frame: *const quell_realtime_frame,
    had_history: *mut c_int,
) -> quell_status {
    call(denoiser, |inner| {
        // SAFETY: the header asks for a struct that begins with its size.
        let frame = unsafe { memory::versioned("frame", frame)? };
        let had = inner.denoise(&frame)?;
        if !had_history.is_null() {
            // SAFETY: it is not null, and the header asks for room for a number.
            unsafe { had_history.write(c_int::from(had)) };
        }
        Ok(())
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_read(
    denoiser: *mut quell_realtime,
    name: *const c_char,
    target: *const quell_target,
) -> quell_status {
    call(denoiser, |inner| {
        // SAFETY: the header asks for a string that ends with a zero, and a struct that begins with its size.
        let (name, target) = unsafe { (memory::text("name", name)?, memory::versioned("target", target)?) };
        inner.read(&name.ok_or_else(|| Failure::argument("name: a null pointer"))?, &target)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_reset(denoiser: *mut quell_realtime) -> quell_status {
    call(denoiser, |inner| {
        inner.reset();
        Ok(())
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_message(denoiser: *const quell_realtime, text: *mut c_char, capacity: usize) -> usize {
    handle::message(denoiser, text, capacity)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_realtime_free(denoiser: *mut quell_realtime) {
    handle::free(denoiser);
}
