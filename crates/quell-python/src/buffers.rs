//! Python's buffers to planes, planes to bytearrays. Numbers lie pixel by pixel, rows from the top.

use crate::failure::Failure;
use half::f16;
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use quell::{Plane, Size};
use quell_frames::Samples;

/// A pass as it comes from `python/quell/_arrays.py`: name, role or none, buffer, whether its 16-bit words are halves. Shape
/// (height, width, channels), any strides.
pub type PyPass<'py> = (String, Option<String>, Bound<'py, PyAny>, bool);

/// Numbers of a buffer in C order, with its number of channels.
pub enum Numbers {
    /// 32-bit floats.
    Float(Vec<f32>),
    /// 16-bit floats.
    Half(Vec<u16>),
}

/// Copies a buffer out of Python's memory, whatever its strides.
pub fn numbers(name: &str, buffer: &Bound<'_, PyAny>, halves: bool, size: Size) -> PyResult<(Numbers, usize)> {
    let py = buffer.py();
    let channels = |shape: &[usize]| match shape {
        [height, width, channels] if *height == size.height && *width == size.width => Ok(*channels),
        _ => Err(Failure::input(format!(
            "{name}: shape {shape:?}, expected ({}, {}, channels)",
            size.height, size.width
        ))),
    };
    if halves {
        let buffer = PyBuffer::<u16>::get(buffer)?;
        let count = channels(buffer.shape())?;
        return Ok((Numbers::Half(buffer.to_vec(py)?), count));
    }
    let buffer = PyBuffer::<f32>::get(buffer)?;
    let count = channels(buffer.shape())?;
    Ok((Numbers::Float(buffer.to_vec(py)?), count))
}

/// One plane a channel.
pub fn channels(numbers: &Numbers, count: usize) -> Vec<Samples> {
    let one = |c: usize| match numbers {
        Numbers::Float(all) => Samples::Float(all.iter().skip(c).step_by(count).copied().collect()),
        Numbers::Half(all) => Samples::Half(all.iter().skip(c).step_by(count).map(|b| f16::from_bits(*b)).collect()),
    };
    (0..count).map(one).collect()
}

/// The planes of a pass side by side again, in the machine's byte order; true with it: halves.
pub fn interleaved<'py>(py: Python<'py>, planes: &[&Samples]) -> PyResult<(Bound<'py, PyByteArray>, bool)> {
    fn fill<T: Copy, const N: usize>(
        bytes: &mut [u8],
        plane: &[T],
        at: usize,
        count: usize,
        to: impl Fn(T) -> [u8; N],
    ) {
        for (into, value) in bytes.chunks_exact_mut(N).skip(at).step_by(count).zip(plane) {
            into.copy_from_slice(&to(*value));
        }
    }
    let halves = planes.iter().all(|plane| matches!(plane, Samples::Half(_)));
    let count = planes.len();
    let pixels = planes.first().map_or(0, |plane| plane.len());
    let array = PyByteArray::new_with(py, pixels * count * if halves { 2 } else { 4 }, |bytes| {
        for (at, plane) in planes.iter().enumerate() {
            match plane {
                Samples::Half(values) if halves => fill(bytes, values, at, count, f16::to_ne_bytes),
                Samples::Float(values) => fill(bytes, values, at, count, f32::to_ne_bytes),
                other => fill(bytes, &other.to_f32(), at, count, f32::to_ne_bytes),
            }
        }
        Ok(())
    })?;
    Ok((array, halves))
}

/// A plane of numbers.
pub fn scalar_bytes<'py>(py: Python<'py>, plane: &Plane<f32>) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, plane.data().len() * 4, |bytes| {
        for (into, value) in bytes.chunks_exact_mut(4).zip(plane.data()) {
            into.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}

/// A plane of colours.
pub fn colour_bytes<'py>(py: Python<'py>, plane: &Plane<[f32; 3]>) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, plane.data().len() * 12, |bytes| {
        for (into, value) in bytes.chunks_exact_mut(4).zip(plane.data().iter().flatten()) {
            into.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}
