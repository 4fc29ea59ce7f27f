//! The sequence filter.

use crate::handle::{self, Handle, Inside, Pool, call};
use crate::memory::{self, Layout};
use crate::status::Failure;
use crate::types::{
    QUELL_OK, quell_frame, quell_ready, quell_sequence_options, quell_status, quell_target, quell_warn,
};
use quell::Size;
use quell::sequence::{SequencePreset, SequenceSettings};
use quell_frames::arrays::{ArrayPass, filtered, image_of};
use quell_frames::driver::{Cleaned, Stream, StreamOptions};
use quell_frames::{AdaptOptions, MapOptions, MotionChoice, Role, Samples};
use std::ffi::{CString, c_char, c_void};
use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::mpsc::sync_channel;

/// The handle of C.
pub type quell_sequence = Handle<Sequence>;

/// What it holds.
pub struct Sequence {
    options: StreamOptions,
    pool: Pool,
    stream: Option<Stream>,
    /// Passes of the frames, and how many channels each has.
    passes: Vec<(String, usize)>,
    size: Size,
    told: bool,
    warn: quell_warn,
    warn_user: *mut c_void,
}

impl Inside for Sequence {
    const WORD: &'static str = "sequence";
    const ALIVE: u64 = 0x7175_656c_6c5f_7365;

    fn reset(&mut self) {
        (self.stream, self.told) = (None, false);
    }
}

/// A frame that came out; it lives as long as the callback runs.
pub struct quell_clean {
    cleaned: Cleaned,
    size: Size,
    /// Name, with a zero behind it, and channels of each pass that was filtered.
    passes: Vec<(CString, usize)>,
}

impl Sequence {
    fn warn(&self, text: &str) {
        if let (Some(warn), Ok(text)) = (self.warn, CString::new(text.replace('\0', " "))) {
            // SAFETY: the caller gave this function and its argument.
            unsafe { warn(self.warn_user, text.as_ptr()) };
        }
    }

    /// Runs the filter in the pool; what comes out is handed over in the calling thread.
    fn run(
        &mut self,
        ready: quell_ready,
        user: *mut c_void,
        work: impl FnOnce(&mut Stream, &mut dyn FnMut(Cleaned) -> bool) -> Result<(), quell_frames::Error> + Send,
    ) -> Result<(), Failure> {
        let Some(mut stream) = self.stream.take() else { return Ok(()) };
        let mut said = Vec::new();
        let mut stopped = false;
        let result = std::thread::scope(|scope| {
            let (to, from) = sync_channel::<Cleaned>(0);
            let (pool, stream) = (&self.pool, &mut stream);
            let worker =
                scope.spawn(move || pool.install(move || work(stream, &mut |cleaned| to.send(cleaned).is_ok())));
            while let Ok(mut cleaned) = from.recv() {
                said.append(&mut cleaned.notes);
                if stopped {
                    continue;
                }
                let found = self.passes.iter().filter_map(|(name, channels)| {
                    let planes = filtered(&cleaned.image, name, *channels)?;
                    Some((CString::new(name.as_str()).ok()?, planes.len()))
                });
                let passes = found.collect();
                let clean = quell_clean { cleaned, size: self.size, passes };
                // SAFETY: the caller gave this function and its argument.
                stopped = ready.is_some_and(|ready| unsafe { ready(user, &raw const clean) } != 0);
                if stopped {
                    // The filter hears of it with the next frame.
                    break;
                }
            }
            drop(from);
            worker.join()
        });
        let result = result.map_err(|_| Failure::panicked())?;
        if stopped {
            self.reset();
            return Err(Failure::stopped());
        }
        if !self.told && !stream.mapping().is_empty() {
            self.told = true;
            said.extend(stream.warnings());
            let others = stream.others();
            if !others.is_empty() {
                said.push(format!(
                    "nothing is known to do with these passes, which are left out: {}",
                    others.join(", ")
                ));
            }
        }
        said.iter().for_each(|text| self.warn(text));
        if !stream.is_empty() {
            self.stream = Some(stream);
        } else {
            self.told = false;
        }
        Ok(result?)
    }

    fn push(&mut self, frame: &quell_frame, ready: quell_ready, user: *mut c_void) -> Result<(), Failure> {
        let size = Size::new(frame.width as usize, frame.height as usize);
        if size.width == 0 || size.height == 0 || size.width > 1 << 16 || size.height > 1 << 16 {
            return Err(Failure::argument(format!("frame: {size}; each extent must be 1 to 65536")));
        }
        if self.stream.is_some() && size != self.size {
            return Err(Failure::argument(format!("frame: {size}, but the sequence is {}", self.size)));
        }
        let mut passes = Vec::with_capacity(frame.pass_count.min(64));
        let mut names = Vec::new();
        for index in 0..frame.pass_count {
            // SAFETY: the header asks for as many structs.
            let pass = unsafe { memory::listed("passes", "pass", frame.passes, index)? };
            let name = format!("pass {index}");
            // SAFETY: the header asks for strings that end with a zero.
            let (given, role) = unsafe { (memory::text(&name, pass.name)?, memory::text("role", pass.role)?) };
            let name = given.ok_or_else(|| Failure::argument(format!("{name}: without a name")))?;
            let role = match &role {
                Some(word) => Some(
                    Role::from_name(word).ok_or_else(|| Failure::argument(format!("{name}: `{word}` is no role")))?,
                ),
                None => None,
            };
            let strides = [pass.channel_stride, pass.pixel_stride, pass.row_stride];
            let layout = Layout::new(&name, pass.type_, pass.channels, strides, size)?;
            if pass.data.is_null() {
                return Err(Failure::argument(format!("{name}: data is null")));
            }
            // SAFETY: the header asks for numbers laid out like this.
            let components: Vec<Samples> = unsafe { memory::read(pass.data, &layout, size) };
            names.push((name.clone(), layout.channels));
            passes.push(ArrayPass { name, role, components });
        }
        let camera = (!frame.clip_from_world.is_null()).then(|| {
            // SAFETY: the header asks for sixteen numbers.
            std::array::from_fn(|i| unsafe { frame.clip_from_world.add(i).read_unaligned() })
        });
        let label = format!("frame {}", frame.number);
        let (image, wishes) = image_of(Path::new(&label), size, passes, camera)?;
        if self.stream.is_none() {
            self.options.map.map = wishes;
            self.stream = Some(Stream::new(self.options.clone())?);
            (self.size, self.passes) = (size, names);
        }
        let number = frame.number;
        self.run(ready, user, |stream, out| stream.push(number, image, out))
    }
}

fn create(options: *const quell_sequence_options) -> Result<Sequence, Failure> {
    let none = quell_sequence_options {
        struct_size: size_of::<quell_sequence_options>(),
        threads: 0,
        motion: std::ptr::null(),
        renderer: std::ptr::null(),
        warn: None,
        warn_user: std::ptr::null_mut(),
        preset: std::ptr::null(),
    };
    // SAFETY: the header asks for a struct that begins with its size, and for strings that end with a zero.
    let (given, motion, renderer, preset) = unsafe {
        let given = if options.is_null() { none } else { memory::versioned("options", options)? };
        let text = |name, from| memory::text(name, from);
        (given, text("motion", given.motion)?, text("renderer", given.renderer)?, text("preset", given.preset)?)
    };
    let preset: SequencePreset = preset.as_deref().map_or(Ok(SequencePreset::default()), str::parse)?;
    let motion = match motion.as_deref() {
        None => MotionChoice::Renderer,
        Some("auto") => MotionChoice::Auto,
        Some("none") => MotionChoice::None,
        Some(name) => MotionChoice::Preset(name.to_owned()),
    };
    let pool = Pool::new(given.threads as usize)?;
    let options = StreamOptions {
        map: MapOptions { renderer, ..MapOptions::default() },
        adapt: AdaptOptions { motion, ..AdaptOptions::default() },
        settings: SequenceSettings::preset(preset),
        cuts: None,
        backend: quell::Backend::default(),
        accelerator: None,
    };
    Ok(Sequence {
        options,
        pool,
        stream: None,
        passes: Vec::new(),
        size: Size::new(0, 0),
        told: false,
        warn: given.warn,
        warn_user: given.warn_user,
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_create(
    options: *const quell_sequence_options,
    sequence: *mut *mut quell_sequence,
    message: *mut c_char,
    capacity: usize,
) -> quell_status {
    handle::create(sequence, message, capacity, || create(options))
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_set(
    sequence: *mut quell_sequence,
    parameter: *const c_char,
    value: *const c_char,
) -> quell_status {
    call(sequence, |inner| {
        // SAFETY: the header asks for strings that end with a zero.
        let (name, value) = unsafe { (memory::text("parameter", parameter)?, memory::text("value", value)?) };
        let (Some(name), Some(value)) = (name, value) else {
            return Err(Failure::argument("parameter, value: a null pointer"));
        };
        if inner.stream.is_some() {
            return Err(Failure::argument(format!(
                "parameter `{name}`: frames are inside; set it before the first one"
            )));
        }
        Ok(inner.options.settings.set(&name, &value)?)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_push(
    sequence: *mut quell_sequence,
    frame: *const quell_frame,
    ready: quell_ready,
    user: *mut c_void,
) -> quell_status {
    call(sequence, |inner| {
        // SAFETY: the header asks for a struct that begins with its size.
        let frame = unsafe { memory::versioned("frame", frame)? };
        inner.push(&frame, ready, user)
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_flush(
    sequence: *mut quell_sequence,
    ready: quell_ready,
    user: *mut c_void,
) -> quell_status {
    call(sequence, |inner| {
        inner.run(ready, user, Stream::decide)?;
        let result = inner.run(ready, user, Stream::flush);
        inner.reset();
        result
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_message(sequence: *const quell_sequence, text: *mut c_char, capacity: usize) -> usize {
    handle::message(sequence, text, capacity)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_sequence_free(sequence: *mut quell_sequence) {
    handle::free(sequence);
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_clean_number(clean: *const quell_clean) -> i64 {
    // SAFETY: the header asks for what the callback was given.
    unsafe { clean.as_ref() }.map_or(0, |clean| clean.cleaned.number)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_clean_pass(clean: *const quell_clean, index: usize, channels: *mut u32) -> *const c_char {
    // SAFETY: the header asks for what the callback was given.
    let pass = unsafe { clean.as_ref() }.and_then(|clean| clean.passes.get(index));
    let Some((name, count)) = pass else { return std::ptr::null() };
    if !channels.is_null() {
        // SAFETY: it is not null, and the header asks for room for a number.
        unsafe { channels.write(*count as u32) };
    }
    name.as_ptr()
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn quell_clean_read(
    clean: *const quell_clean,
    name: *const c_char,
    target: *const quell_target,
) -> quell_status {
    let read = || -> Result<(), Failure> {
        // SAFETY: the header asks for what the callback was given, a string that ends with a zero, and a struct that begins
        // with its size.
        let (clean, name, target) =
            unsafe { (clean.as_ref(), memory::text("name", name)?, memory::versioned("target", target)?) };
        let clean = clean.ok_or_else(|| Failure::argument("clean: a null pointer"))?;
        let strides = [target.channel_stride, target.pixel_stride, target.row_stride];
        let layout = Layout::new("target", target.type_, target.channels, strides, clean.size)?;
        if target.data.is_null() {
            return Err(Failure::argument("target: data is null"));
        }
        let Some(name) = name else {
            // The expected error of the picture.
            let noise = clean.cleaned.noise.as_ref().ok_or_else(|| Failure::argument("the stage `blend` is off"))?;
            let value = |_: usize, pixel: usize| noise.data().get(pixel).copied().unwrap_or(0.0);
            // SAFETY: the header asks for room laid out like this.
            unsafe { memory::write(1, value, target.data, &layout, clean.size) };
            return Ok(());
        };
        let known = clean.passes.iter().find(|(other, _)| other.as_bytes() == name.as_bytes());
        let planes = known.and_then(|(_, count)| filtered(&clean.cleaned.image, &name, *count));
        let planes = planes.ok_or_else(|| Failure::argument(format!("{name}: it was not filtered")))?;
        if planes.len() < layout.channels {
            let reason = format!("target: {} channels, and {name} has {}", layout.channels, planes.len());
            return Err(Failure::argument(reason));
        }
        let value = |channel: usize, pixel: usize| planes.get(channel).map_or(0.0, |plane| plane.get(pixel));
        // SAFETY: the header asks for room laid out like this.
        unsafe { memory::write(planes.len(), value, target.data, &layout, clean.size) };
        Ok(())
    };
    match std::panic::catch_unwind(AssertUnwindSafe(read)) {
        Ok(Ok(())) => QUELL_OK,
        Ok(Err(failure)) => failure.status,
        Err(_) => Failure::panicked().status,
    }
}
