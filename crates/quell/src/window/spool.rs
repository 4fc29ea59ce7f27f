//! A prepared frame outside of memory: its planes as bytes in this machine's order, of which some rows are read back.
//!
//! A job that does not fit in memory is filtered in bands of rows. What a frame decides as a whole (the size of a pixel,
//! whether there is fog) was decided before, so a band of it is filtered to the same bits as the whole.

use super::mirrors::WHITE;
use super::packed::{Packed, Weight};
use super::prepared::{PreparedFrame, Samples};
use super::sparse::Sparse;
use super::vectors::Vectors;
use crate::plane::{Plane, Size};
use bytemuck::Pod;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::Arc;

/// What stays in memory of a frame whose planes were written out.
pub struct SpooledFrame {
    frame: PreparedFrame,
    bytes: u64,
}

impl PreparedFrame {
    /// Writes the planes to `to`.
    ///
    /// # Errors
    /// What `to` answers.
    pub fn spool(mut self, to: &mut dyn Write) -> io::Result<SpooledFrame> {
        let mut writer = Writer { to, bytes: 0 };
        visit(&mut self, &mut writer)?;
        let bytes = writer.bytes;
        Ok(SpooledFrame { frame: self, bytes })
    }
}

impl SpooledFrame {
    /// Frame number.
    pub fn number(&self) -> i64 {
        self.frame.number
    }

    /// Extent of the whole frame.
    pub fn size(&self) -> Size {
        self.frame.features.size
    }

    /// Bytes that were written.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reads rows back from where [`PreparedFrame::spool`] wrote them, from position 0 on. Rows beyond the frame's are
    /// left out.
    ///
    /// # Errors
    /// What `from` answers.
    pub fn rows(&self, from: &mut (impl Read + Seek), rows: Range<usize>) -> io::Result<PreparedFrame> {
        let mut frame = self.frame.clone();
        let size = self.size();
        let to = rows.end.min(size.height);
        let rows = rows.start.min(to)..to;
        let mut reader = Reader { from, size, rows: rows.clone(), at: 0 };
        visit(&mut frame, &mut reader)?;
        frame.features.size = Size::new(size.width, rows.len());
        frame.features.first_row = rows.start;
        Ok(frame)
    }
}

impl std::fmt::Debug for SpooledFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SpooledFrame").field("number", &self.frame.number).finish_non_exhaustive()
    }
}

/// What is done to every plane in turn.
trait Visitor {
    /// `per_pixel` elements a pixel.
    fn elements<T: Pod>(&mut self, data: &mut Vec<T>, per_pixel: usize) -> io::Result<()>;
    /// Extent afterwards.
    fn size(&self) -> Size;
    /// Pixels that remain, of those before; `None`: what lies beside planes stays as it is.
    fn kept(&self) -> Option<Range<usize>>;
}

/// All planes of a frame, in one order.
fn visit(frame: &mut PreparedFrame, v: &mut impl Visitor) -> io::Result<()> {
    // None where the planes are to be filled.
    let pixels = frame.features.surface.len();
    packed(&mut frame.samples, v)?;
    let lights = frame.means.lights;
    v.elements(&mut frame.means.data, 2 * lights)?;
    let mut weights: Vec<Option<Arc<Weight>>> = Vec::with_capacity(frame.weights.len());
    for (i, weight) in frame.weights.iter().enumerate() {
        let Some(weight) = weight else {
            weights.push(None);
            continue;
        };
        // Lights of one surface share it.
        let shared = frame.weights[..i].iter().position(|other| other.as_ref().is_some_and(|o| Arc::ptr_eq(o, weight)));
        weights.push(match shared.and_then(|at| weights[at].clone()) {
            Some(shared) => Some(shared),
            None => {
                let mut weight = weight.as_ref().clone();
                exact(&mut weight, v)?;
                Some(Arc::new(weight))
            }
        });
    }
    frame.weights = weights;
    for stored in &mut frame.stored {
        if let Samples::Own(planes) = stored {
            planes.iter_mut().try_for_each(|own| exact(own, v))?;
        }
    }
    let features = &mut frame.features;
    v.elements(&mut features.surface, 1)?;
    if let Some(colour) = &mut features.mirror_colour {
        let mut all = colour.dense(pixels, |_| WHITE);
        v.elements(&mut all, 1)?;
        *colour = Sparse::new(all.len(), |p| all[p], |_| WHITE);
    }
    let images = [&mut features.seen, &mut features.albedo_around, &mut features.surface_albedo, &mut features.albedo];
    for image in images {
        image.as_mut().map_or(Ok(()), |image| packed(image, v))?;
    }
    let m = &mut features.motion;
    let directions = [(&mut m.to_previous, &mut m.reflection_to_previous), (&mut m.to_next, &mut m.reflection_to_next)];
    for (motion, reflection) in directions {
        let Some(motion) = motion else { continue };
        let mut all = reflection.as_ref().map(|reflection| reflection.dense(pixels, |p| motion.at(p)));
        match motion {
            Vectors::Half(size, data) => {
                v.elements(data, 1)?;
                *size = v.size();
            }
            Vectors::Full(motion) => plane(motion, v)?,
        }
        if let (Some(all), Some(reflection)) = (&mut all, reflection) {
            v.elements(all, 1)?;
            *reflection = Sparse::new(all.len(), |p| all[p], |p| motion.at(p));
        }
    }
    for values in [&mut frame.alpha, &mut frame.variance] {
        values.as_mut().map_or(Ok(()), |values| plane(values, v))?;
    }
    Ok(())
}

fn packed(packed: &mut Packed, v: &mut impl Visitor) -> io::Result<()> {
    v.elements(&mut packed.data, 3 * packed.planes)?;
    if let Some(kept) = v.kept() {
        let places = kept.start * packed.planes..kept.end * packed.planes;
        packed.beyond.retain(|(at, _)| places.contains(at));
        packed.beyond.iter_mut().for_each(|(at, _)| *at -= places.start);
    }
    Ok(())
}

fn exact(colours: &mut Weight, v: &mut impl Visitor) -> io::Result<()> {
    match colours {
        Weight::Half(data) => v.elements(data, 1),
        Weight::Full(data) => plane(data, v),
    }
}

fn plane<T: Pod>(plane: &mut Plane<T>, v: &mut impl Visitor) -> io::Result<()> {
    let taken = Plane::from_vec(Size::new(0, 0), Vec::new()).map_err(io::Error::other)?;
    let mut data = std::mem::replace(plane, taken).into_vec();
    v.elements(&mut data, 1)?;
    *plane = Plane::from_vec(v.size(), data).map_err(io::Error::other)?;
    Ok(())
}

/// Writes planes and empties them.
struct Writer<'w> {
    to: &'w mut dyn Write,
    bytes: u64,
}

impl Visitor for Writer<'_> {
    fn elements<T: Pod>(&mut self, data: &mut Vec<T>, _: usize) -> io::Result<()> {
        let data = std::mem::take(data);
        let bytes: &[u8] = bytemuck::cast_slice(&data);
        self.to.write_all(bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn size(&self) -> Size {
        Size::new(0, 0)
    }

    fn kept(&self) -> Option<Range<usize>> {
        None
    }
}

/// Fills planes with some of the rows that were written.
struct Reader<'r, R> {
    from: &'r mut R,
    /// Of the whole frame.
    size: Size,
    rows: Range<usize>,
    /// Where the next plane begins.
    at: u64,
}

impl<R: Read + Seek> Visitor for Reader<'_, R> {
    fn elements<T: Pod>(&mut self, data: &mut Vec<T>, per_pixel: usize) -> io::Result<()> {
        let row = self.size.width * per_pixel;
        let row_bytes = row * size_of::<T>();
        self.from.seek(SeekFrom::Start(self.at + (self.rows.start * row_bytes) as u64))?;
        *data = vec![T::zeroed(); row * self.rows.len()];
        self.from.read_exact(bytemuck::cast_slice_mut(data))?;
        self.at += (self.size.height * row_bytes) as u64;
        Ok(())
    }

    fn size(&self) -> Size {
        Size::new(self.size.width, self.rows.len())
    }

    fn kept(&self) -> Option<Range<usize>> {
        Some(self.rows.start * self.size.width..self.rows.end * self.size.width)
    }
}
