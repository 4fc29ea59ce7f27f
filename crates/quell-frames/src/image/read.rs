//! Reading: headers first, then the chosen channels, decoded in the caller's thread pool.

use super::{Channel, ExrImage, Part, SampleKind, Samples, check};
use crate::error::Error;
use bytemuck::Pod;
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates};
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::Vec2;
use half::f16;
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Blocks that are decoded at once, at least and for each thread: enough that threads seldom wait for the last one, little memory.
const BLOCKS_AT_ONCE: usize = 64;
const BLOCKS_OF_A_THREAD: usize = 8;

/// What shows that a file is still the one that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

/// Reads what a file holds: windows, parts, channels, attributes, no samples.
///
/// # Errors
/// [`Error::Invalid`] for what is no whole EXR file or claims more than its length can hold, [`Error::NotSupported`]
/// for deep data and subsampled channels, [`Error::Io`].
pub fn read_headers(path: &Path) -> Result<ExrImage, Error> {
    read_channels(path, |_, _| false)
}

/// Reads a file with all samples. Of several resolutions only the largest is read.
///
/// # Errors
/// As [`read_headers`].
pub fn read_image(path: &Path) -> Result<ExrImage, Error> {
    read_channels(path, |_, _| true)
}

/// Reads the samples of those channels for which `wanted` is true. Parts without such a channel are skipped in the
/// file; channels that are not wanted are not converted or kept.
///
/// # Errors
/// As [`read_headers`].
pub fn read_channels(path: &Path, wanted: impl Fn(&Part, &Channel) -> bool) -> Result<ExrImage, Error> {
    let (file, stamp) = open(path)?;
    let mut image = read_from(BufReader::with_capacity(1 << 16, file), stamp.bytes, path, &wanted)?;
    image.stamp = Some(stamp);
    Ok(image)
}

/// [`read_image`] from bytes in memory; `label` stands for the file in messages.
///
/// # Errors
/// As [`read_headers`].
pub fn read_image_from(mut reader: impl Read + Seek, label: &Path) -> Result<ExrImage, Error> {
    let io = |e| Error::io(label, "read", e);
    let bytes = reader.seek(SeekFrom::End(0)).map_err(io)?;
    reader.seek(SeekFrom::Start(0)).map_err(io)?;
    read_from(reader, bytes, label, &|_, _| true)
}

fn open(path: &Path) -> Result<(File, Stamp), Error> {
    let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let info = file.metadata().map_err(|e| Error::io(path, "read", e))?;
    if !info.is_file() {
        return Err(Error::invalid(path, "this is not a file"));
    }
    Ok((file, Stamp { bytes: info.len(), modified: info.modified().ok() }))
}

impl ExrImage {
    /// Reads the samples of further channels from the file that the image came from.
    ///
    /// # Errors
    /// As [`read_headers`]; [`Error::Invalid`] where the file has changed since.
    pub fn load(&mut self, wanted: impl Fn(&Part, &Channel) -> bool) -> Result<(), Error> {
        let missing = |part: &Part, c: &Channel| c.samples.is_none() && wanted(part, c);
        if !self.parts.iter().any(|part| part.channels.iter().any(|c| missing(part, c))) {
            return Ok(());
        }
        let mut source = Source::reopen(self)?;
        source.fill(&mut self.parts, &missing)
    }
}

fn read_from<R: Read + Seek>(
    reader: R,
    bytes: u64,
    path: &Path,
    wanted: &dyn Fn(&Part, &Channel) -> bool,
) -> Result<ExrImage, Error> {
    let mut source = Source::new(reader, bytes, path)?;
    let mut parts: Vec<Part> = source
        .meta
        .headers
        .iter()
        .enumerate()
        .map(|(index, header)| Part {
            index,
            channels: header
                .channels
                .list
                .iter()
                .map(|channel| Channel {
                    name: super::string(&channel.name),
                    kind: SampleKind::of(channel.sample_type),
                    samples: None,
                    replaced: false,
                })
                .collect(),
            header: header.clone(),
        })
        .collect();
    source.fill(&mut parts, wanted)?;
    Ok(ExrImage { path: path.to_owned(), stamp: None, parts })
}

/// exr's decoders index into what a file claims and panic where it lies (1.74.2: B44, for one). Such a panic ends here,
/// as the error that it should have been.
fn guarded<T>(decode: impl FnOnce() -> exr::error::Result<T>) -> exr::error::Result<T> {
    std::panic::catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(exr::error::Error::Invalid("a block or header is damaged".into())))
}

/// An open file behind its headers.
pub(super) struct Source<R> {
    path: PathBuf,
    reader: R,
    bytes: u64,
    /// Where the tables of block positions begin.
    tables: u64,
    pub meta: MetaData,
}

impl Source<BufReader<File>> {
    /// Opens the file of an image again; it must not have changed.
    pub fn reopen(image: &ExrImage) -> Result<Self, Error> {
        let (file, stamp) = open(&image.path)?;
        if image.stamp != Some(stamp) {
            return Err(Error::invalid(&image.path, "the file has changed since its header was read"));
        }
        Self::new(BufReader::with_capacity(1 << 16, file), stamp.bytes, &image.path)
    }
}

impl<R: Read + Seek> Source<R> {
    fn new(mut reader: R, bytes: u64, path: &Path) -> Result<Self, Error> {
        let meta = guarded(|| MetaData::read_from_buffered(&mut reader, false));
        let meta = meta.map_err(|e| Error::from_exr(path, "read", e))?;
        check::headers(path, &meta, bytes)?;
        let tables = reader.stream_position().map_err(|e| Error::io(path, "read", e))?;
        Ok(Self { path: path.to_owned(), reader, bytes, tables, meta })
    }

    fn failed(&self, error: std::io::Error) -> Error {
        Error::from_exr(&self.path, "read", exr::error::Error::Io(error))
    }

    /// Positions of the blocks of the chosen parts, in the file's order, with part and number in the part's table.
    pub fn blocks(&mut self, chosen: &[bool]) -> Result<Vec<BlockPlace>, Error> {
        let mut places = Vec::new();
        let mut table = self.tables;
        for part in 0..self.meta.headers.len() {
            let count = self.meta.headers[part].chunk_count;
            if chosen.get(part).copied().unwrap_or(false) {
                self.reader.seek(SeekFrom::Start(table)).map_err(|e| self.failed(e))?;
                let mut bytes = vec![0; count * 8];
                self.reader.read_exact(&mut bytes).map_err(|e| self.failed(e))?;
                for (number, entry) in bytes.chunks_exact(8).enumerate() {
                    let mut offset = [0; 8];
                    offset.copy_from_slice(entry);
                    places.push(BlockPlace { offset: u64::from_le_bytes(offset), part, number });
                }
            }
            table += count as u64 * 8;
        }
        places.sort_by_key(|place| place.offset);
        Ok(places)
    }

    /// One block as it lies in the file, still compressed.
    pub fn chunk(&mut self, place: &BlockPlace) -> Result<Chunk, Error> {
        let part_name = check::part_name(&self.meta.headers, place.part);
        let bad = |path: &Path, what: &str| {
            let reason = format!("{part_name}block {}: {what}; the file is damaged or unfinished", place.number);
            Error::invalid(path, reason)
        };
        if place.offset < self.tables || place.offset >= self.bytes {
            return Err(bad(&self.path, "its place in the table is outside the file"));
        }
        // Seeking in a buffered reader throws its buffer away; blocks mostly follow one another.
        let here = self.reader.stream_position().map_err(|e| self.failed(e))?;
        if here != place.offset {
            self.reader.seek(SeekFrom::Start(place.offset)).map_err(|e| self.failed(e))?;
        }
        if self.meta.requirements.has_multiple_layers && self.int()? != place.part as i32 {
            return Err(bad(&self.path, "it belongs to another part"));
        }
        let tiled = self.meta.headers[place.part].blocks.has_tiles();
        // Scan lines: their y. Tiles: column, row, level in x, level in y.
        let mut at = [0; 4];
        for value in at.iter_mut().take(if tiled { 4 } else { 1 }) {
            *value = self.int()?;
        }
        let length = self.int()?;
        let rest = self.bytes.saturating_sub(place.offset);
        let Some(length) = u64::try_from(length).ok().filter(|length| *length > 0 && *length <= rest) else {
            return Err(bad(&self.path, &format!("a length of {length} bytes")));
        };
        let mut compressed_pixels_le = vec![0; length as usize];
        self.reader.read_exact(&mut compressed_pixels_le).map_err(|e| self.failed(e))?;
        let compressed_block = if tiled {
            let [column, row, level_x, level_y] = at.map(|v| usize::try_from(v).ok().filter(|v| *v < 1 << 24));
            let (Some(column), Some(row), Some(level_x @ 0..32), Some(level_y @ 0..32)) =
                (column, row, level_x, level_y)
            else {
                return Err(bad(&self.path, "a tile outside the picture"));
            };
            let coordinates = TileCoordinates { tile_index: Vec2(column, row), level_index: Vec2(level_x, level_y) };
            CompressedBlock::Tile(CompressedTileBlock { coordinates, compressed_pixels_le })
        } else {
            CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate: at[0], compressed_pixels_le })
        };
        Ok(Chunk { layer_index: place.part, compressed_block })
    }

    fn int(&mut self) -> Result<i32, Error> {
        let mut bytes = [0; 4];
        self.reader.read_exact(&mut bytes).map_err(|e| self.failed(e))?;
        Ok(i32::from_le_bytes(bytes))
    }

    /// Reads the samples of the wanted channels.
    pub fn fill(&mut self, parts: &mut [Part], wanted: &dyn Fn(&Part, &Channel) -> bool) -> Result<(), Error> {
        let mut planes: Vec<Option<Planes>> = parts
            .iter()
            .map(|part| {
                let channels: Vec<bool> = part.channels.iter().map(|c| wanted(part, c)).collect();
                channels.contains(&true).then(|| Planes::new(&part.header, channels))
            })
            .collect();
        let chosen: Vec<bool> = planes.iter().map(Option::is_some).collect();
        if !chosen.contains(&true) {
            return Ok(());
        }
        let places = self.blocks(&chosen)?;
        for some in places.chunks(BLOCKS_AT_ONCE.max(BLOCKS_OF_A_THREAD * rayon::current_num_threads())) {
            let mut chunks = Vec::with_capacity(some.len());
            for place in some {
                let chunk = self.chunk(place)?;
                // Of several resolutions only the largest is wanted.
                if let CompressedBlock::Tile(tile) = &chunk.compressed_block
                    && tile.coordinates.level_index != Vec2(0, 0)
                {
                    continue;
                }
                chunks.push(chunk);
            }
            let meta = &self.meta;
            let decode = |chunk| {
                guarded(|| {
                    check::block(&chunk, meta)?;
                    UncompressedBlock::decompress_chunk(chunk, meta, false)
                })
            };
            let decoded: exr::error::Result<Vec<_>> = chunks.into_par_iter().map(decode).collect();
            let decoded = decoded.map_err(|e| Error::from_exr(&self.path, "read", e))?;
            for block in &decoded {
                if let Some(Some(planes)) = planes.get_mut(block.index.layer) {
                    planes.note(block);
                }
            }
            let mut jobs: Vec<_> = planes.iter_mut().enumerate().filter_map(|(i, p)| Some((i, p.as_mut()?))).collect();
            jobs.par_iter_mut().for_each(|(part, planes)| planes.copy(*part, &decoded));
        }
        for (index, (part, planes)) in parts.iter_mut().zip(planes).enumerate() {
            let Some(planes) = planes else { continue };
            if planes.rows_missing() {
                let name = check::part_name(&self.meta.headers, index);
                return Err(Error::invalid(&self.path, format!("{name}some of its pixels are not in the file")));
            }
            for (channel, plane) in part.channels.iter_mut().zip(planes.channels) {
                if let Some(plane) = plane {
                    channel.samples = Some(plane.samples);
                    channel.replaced = false;
                }
            }
        }
        Ok(())
    }
}

/// Where a block lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockPlace {
    offset: u64,
    pub part: usize,
    /// Its number in the part's table, which counts from the top whatever the order of rows.
    pub number: usize,
}

/// The planes of one part while they are filled.
struct Planes {
    width: usize,
    channels: Vec<Option<Filling>>,
    /// Bytes of a row of a block before each channel, per pixel of its width.
    bytes_per_pixel: usize,
    /// Blocks of the largest level that are still to come; a block counts once.
    missing: Vec<bool>,
    block: Vec2<usize>,
    columns: usize,
}

struct Filling {
    samples: Samples,
    /// Bytes of the channels before this one, per pixel of a block's width.
    bytes_before: usize,
}

impl Planes {
    fn new(header: &Header, wanted: Vec<bool>) -> Self {
        let Vec2(width, height) = header.layer_size;
        let pixels = width * height;
        let mut bytes_before = 0;
        let mut channels = Vec::with_capacity(wanted.len());
        for (channel, wanted) in header.channels.list.iter().zip(wanted) {
            channels.push(wanted.then(|| Filling {
                samples: match channel.sample_type {
                    SampleType::F16 => Samples::Half(vec![f16::ZERO; pixels]),
                    SampleType::F32 => Samples::Float(vec![0.0; pixels]),
                    SampleType::U32 => Samples::Uint(vec![0; pixels]),
                },
                bytes_before,
            }));
            bytes_before += channel.sample_type.bytes_per_sample();
        }
        let block = match header.blocks {
            BlockDescription::ScanLines => header.max_block_pixel_size(),
            BlockDescription::Tiles(tiles) => tiles.tile_size,
        };
        let columns = width.div_ceil(block.width().max(1));
        let rows = height.div_ceil(block.height().max(1));
        Self { width, channels, bytes_per_pixel: bytes_before, missing: vec![true; columns * rows], block, columns }
    }

    fn note(&mut self, block: &UncompressedBlock) {
        let Vec2(x, y) = block.index.pixel_position;
        let at = y / self.block.height().max(1) * self.columns + x / self.block.width().max(1);
        if let Some(missing) = self.missing.get_mut(at) {
            *missing = false;
        }
    }

    fn rows_missing(&self) -> bool {
        self.missing.contains(&true)
    }

    fn copy(&mut self, part: usize, blocks: &[UncompressedBlock]) {
        let (width, bytes_per_pixel) = (self.width, self.bytes_per_pixel);
        self.channels.par_iter_mut().flatten().for_each(|filling| {
            for block in blocks.iter().filter(|block| block.index.layer == part) {
                let Vec2(columns, rows) = block.index.pixel_size;
                let Vec2(x, y) = block.index.pixel_position;
                for row in 0..rows {
                    let from = row * columns * bytes_per_pixel + columns * filling.bytes_before;
                    let Some(line) = block.data.get(from..) else { continue };
                    filling.samples.copy_row((y + row) * width + x, columns, line);
                }
            }
        });
    }
}

impl Samples {
    /// Copies `count` samples in the machine's byte order to position `at`.
    fn copy_row(&mut self, at: usize, count: usize, bytes: &[u8]) {
        fn copy<T: Pod>(into: &mut [T], at: usize, count: usize, bytes: &[u8]) {
            let Some(into) = into.get_mut(at..at + count) else { return };
            let whole = count.min(bytes.len() / size_of::<T>());
            bytemuck::cast_slice_mut(&mut into[..whole]).copy_from_slice(&bytes[..whole * size_of::<T>()]);
        }
        match self {
            Self::Half(v) => copy(v, at, count, bytes),
            Self::Float(v) => copy(v, at, count, bytes),
            Self::Uint(v) => copy(v, at, count, bytes),
        }
    }

    /// Appends the bytes of `count` samples from position `at` in the machine's byte order.
    pub(super) fn append_row(&self, at: usize, count: usize, bytes: &mut Vec<u8>) {
        let range = at..at + count;
        match self {
            Self::Half(v) => bytes.extend(bytemuck::cast_slice::<_, u8>(v.get(range).unwrap_or_default())),
            Self::Float(v) => bytes.extend(bytemuck::cast_slice::<_, u8>(v.get(range).unwrap_or_default())),
            Self::Uint(v) => bytes.extend(bytemuck::cast_slice::<_, u8>(v.get(range).unwrap_or_default())),
        }
    }
}
