//! From C's pointers to Rust's values, and back: the only place that reads and writes the caller's memory.

use crate::status::Failure;
use crate::types::{QUELL_F16, QUELL_F32};
use half::f16;
use quell::Size;
use quell_frames::Samples;
use std::ffi::{CStr, c_char, c_void};

/// Where the numbers of a plane lie, in bytes from one to the next.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    pub type_: u32,
    pub channels: usize,
    strides: [isize; 3],
}

impl Layout {
    /// Strides of 0 mean: packed.
    pub fn new(
        name: &str,
        type_: u32,
        channels: u32,
        [channel, pixel, row]: [isize; 3],
        size: Size,
    ) -> Result<Self, Failure> {
        let bytes = match type_ {
            QUELL_F16 => 2,
            QUELL_F32 => 4,
            other => return Err(Failure::argument(format!("{name}: type {other}; there are QUELL_F16, QUELL_F32"))),
        };
        if channels == 0 || channels > 4 {
            return Err(Failure::argument(format!("{name}: {channels} channels; passes have one to four")));
        }
        let or = |stride: isize, packed: isize| if stride == 0 { packed } else { stride };
        let channel = or(channel, bytes);
        let pixel = or(pixel, bytes * channels as isize);
        let row = or(row, pixel * size.width as isize);
        Ok(Self { type_, channels: channels as usize, strides: [channel, pixel, row] })
    }

    fn offset(&self, channel: usize, x: usize, y: usize) -> isize {
        channel as isize * self.strides[0] + x as isize * self.strides[1] + y as isize * self.strides[2]
    }
}

/// A struct of which the caller may know fewer members than this library, or more: what it does not know is zero.
///
/// # Safety
/// `from` is null or points to `struct_size` readable bytes, and `T` is a struct of C whose first member is that size and for
/// which zeros are valid.
pub unsafe fn versioned<T: Copy>(name: &str, from: *const T) -> Result<T, Failure> {
    if from.is_null() {
        return Err(Failure::argument(format!("{name}: a null pointer")));
    }
    // SAFETY: the first member of each such struct is its size.
    let bytes = unsafe { from.cast::<usize>().read_unaligned() };
    if bytes < size_of::<usize>() || bytes > 4096 {
        return Err(Failure::argument(format!("{name}: struct_size is {bytes}; set it to the size of the struct")));
    }
    let mut value = std::mem::MaybeUninit::<T>::zeroed();
    let count = bytes.min(size_of::<T>());
    // SAFETY: as many bytes are readable there, and `T` has them; zeros are valid for the rest.
    unsafe {
        std::ptr::copy_nonoverlapping(from.cast::<u8>(), value.as_mut_ptr().cast::<u8>(), count);
        Ok(value.assume_init())
    }
}

/// Text of C; `None` for null.
///
/// # Safety
/// Null, or a string that ends with a zero.
pub unsafe fn text(name: &str, from: *const c_char) -> Result<Option<String>, Failure> {
    if from.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller promises.
    let bytes = unsafe { CStr::from_ptr(from) };
    let text = bytes.to_str().map_err(|_| Failure::argument(format!("{name}: this text is no UTF-8")))?;
    Ok(Some(text.to_owned()))
}

/// Copies text with a zero behind it, cut to the capacity; returns how many bytes the whole takes without the zero.
///
/// # Safety
/// `to` is null, or as many bytes as `capacity` are writable there.
pub unsafe fn put_text(from: &str, to: *mut c_char, capacity: usize) -> usize {
    if let (false, Some(room)) = (to.is_null(), capacity.checked_sub(1)) {
        let mut count = from.len().min(room);
        while !from.is_char_boundary(count) {
            count -= 1;
        }
        // SAFETY: `count` is smaller than the capacity.
        unsafe {
            std::ptr::copy_nonoverlapping(from.as_ptr().cast::<c_char>(), to, count);
            to.add(count).write(0);
        }
    }
    from.len()
}

/// One plane a channel.
///
/// # Safety
/// Numbers lie at `data` as the layout says, for every pixel.
pub unsafe fn read(data: *const c_void, layout: &Layout, size: Size) -> Vec<Samples> {
    let places = |c: usize| (0..size.height).flat_map(move |y| (0..size.width).map(move |x| layout.offset(c, x, y)));
    let bytes = data.cast::<u8>();
    // SAFETY: as the caller promises; numbers need not be aligned.
    let one = |c: usize| unsafe {
        if layout.type_ == QUELL_F16 {
            let value = |at: isize| f16::from_bits(bytes.offset(at).cast::<u16>().read_unaligned());
            Samples::Half(places(c).map(value).collect())
        } else {
            Samples::Float(places(c).map(|at| bytes.offset(at).cast::<f32>().read_unaligned()).collect())
        }
    };
    (0..layout.channels).map(one).collect()
}

/// The numbers of all channels, pixel by pixel, rows from the top.
///
/// # Safety
/// Numbers lie at `data` as the layout says, for every pixel.
pub unsafe fn read_pixels(data: *const c_void, layout: &Layout, size: Size) -> Vec<f32> {
    // SAFETY: as the caller promises.
    let planes = unsafe { read(data, layout, size) };
    (0..size.pixels()).flat_map(|pixel| planes.iter().map(move |plane| plane.get(pixel))).collect()
}

/// Whole numbers of 32 bits, one a pixel.
///
/// # Safety
/// They lie at `data` as the layout says, for every pixel.
pub unsafe fn read_ids(data: *const c_void, layout: &Layout, size: Size) -> Vec<u32> {
    let places = (0..size.height).flat_map(|y| (0..size.width).map(move |x| layout.offset(0, x, y)));
    let bytes = data.cast::<u8>();
    // SAFETY: as the caller promises; numbers need not be aligned.
    places.map(|at| unsafe { bytes.offset(at).cast::<u32>().read_unaligned() }).collect()
}

/// Struct number `index` of the frame's member `list`; each is as long as the first one says.
///
/// # Safety
/// `first` is null or points to more than `index` such structs; `T` as for [`versioned`].
pub unsafe fn listed<T: Copy>(list: &str, word: &str, first: *const T, index: usize) -> Result<T, Failure> {
    if first.is_null() {
        return Err(Failure::argument(format!("frame: {list} is null")));
    }
    // SAFETY: as the caller promises; sizes are the first members, and are checked before any other is read.
    unsafe {
        let length = first.cast::<usize>().read_unaligned();
        versioned(&format!("{word} 0"), first)?;
        let at = first.cast::<u8>().add(index * length).cast::<T>();
        let of = versioned(&format!("{word} {index}"), at)?;
        if at.cast::<usize>().read_unaligned() == length {
            Ok(of)
        } else {
            Err(Failure::argument(format!("{word} {index}: struct_size differs from that of {word} 0")))
        }
    }
}

/// Writes so many channels where the layout says; `value(channel, pixel)` has the numbers.
///
/// # Safety
/// Numbers may be written to `data` as the layout says, for every pixel.
pub unsafe fn write(
    channels: usize,
    value: impl Fn(usize, usize) -> f32,
    data: *mut c_void,
    layout: &Layout,
    size: Size,
) {
    let bytes = data.cast::<u8>();
    for c in 0..channels.min(layout.channels) {
        for y in 0..size.height {
            for x in 0..size.width {
                let (at, value) = (layout.offset(c, x, y), value(c, y * size.width + x));
                // SAFETY: as the caller promises; numbers need not be aligned.
                unsafe {
                    if layout.type_ == QUELL_F16 {
                        bytes.offset(at).cast::<u16>().write_unaligned(f16::from_f32(value).to_bits());
                    } else {
                        bytes.offset(at).cast::<f32>().write_unaligned(value);
                    }
                }
            }
        }
    }
}
