//! Writing an image back: replaced channels anew, everything else as it was.

use super::order::sort_attributes;
use super::read::{BlockPlace, Source};
use super::{Channel, ExrImage, Part, compression_name};
use crate::error::Error;
use crate::files::write_whole;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::meta::attribute::{LevelMode, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, compute_chunk_count};
use exr::prelude::{Compression, LineOrder, Vec2};
use flate2::{Compress, FlushCompress, Status};
use rayon::prelude::*;
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

/// Blocks that are held compressed before they are written.
const BLOCKS_AT_ONCE: usize = 64;

/// How an image is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct ImageWriteOptions {
    /// Also replace a file that quell did not write. The file that was read is never replaced.
    pub overwrite: bool,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct ImageWritten {
    /// Length of the file.
    pub bytes: u64,
    /// What is not as in the input and not as asked for: parts whose compression would have lost data, or that had
    /// several resolutions. One sentence each.
    pub notes: Vec<String>,
}

impl ExrImage {
    /// Writes the image: same parts, order, names, types, windows and attributes. The file appears whole or not at all.
    ///
    /// Parts without replaced channels are copied as they lie in the input, compressed: nothing of them can change.
    /// Parts with replaced channels are compressed as the input was where that loses nothing; otherwise (B44, DWA,
    /// PXR24 with floats) with ZIP. What was not read is read now, from the file that the image came from.
    ///
    /// # Errors
    /// [`Error::Foreign`] where another program's file stands at `path` and `options.overwrite` is off,
    /// [`Error::Invalid`] where `path` is the input itself or the input has changed meanwhile, [`Error::Io`].
    pub fn write(&self, path: &Path, options: &ImageWriteOptions) -> Result<ImageWritten, Error> {
        if let (Ok(to), Ok(from)) = (path.canonicalize(), self.path.canonicalize())
            && to == from
        {
            return Err(Error::invalid(path, "this is the input itself, which is never replaced"));
        }
        if !options.overwrite && path.exists() && !crate::frame_file::is_quells(path) {
            return Err(Error::Foreign { path: path.to_owned() });
        }
        let mut written = ImageWritten::default();
        let plans: Vec<PartPlan> = self.parts.iter().map(|part| PartPlan::of(part, &mut written.notes)).collect();
        let needs_source = plans
            .iter()
            .zip(&self.parts)
            .any(|(plan, part)| plan.copied || part.channels.iter().any(|channel| channel.samples.is_none()));
        let mut source = if needs_source { Some(Source::reopen(self)?) } else { None };
        write_whole(path, |writer| {
            self.write_parts(path, writer, &plans, source.as_mut())?;
            writer.flush().and_then(|()| sort_attributes(writer.get_mut())).map_err(|e| Error::io(path, "write", e))
        })?;
        written.bytes = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
        Ok(written)
    }

    fn write_parts(
        &self,
        path: &Path,
        writer: &mut BufWriter<File>,
        plans: &[PartPlan],
        mut source: Option<&mut Source<BufReader<File>>>,
    ) -> Result<(), Error> {
        let headers = plans.iter().map(|plan| plan.header.clone()).collect();
        // Errors of ours travel past exr's own.
        let mut failure = None;
        let result = exr::block::write(writer, headers, false, |meta, chunks| {
            for (index, (part, plan)) in self.parts.iter().zip(plans).enumerate() {
                let done = if plan.copied {
                    source.as_mut().map_or(Ok(()), |source| copy_part(source, index, chunks))
                } else {
                    self.encode_part(index, part, plan, source.as_deref_mut(), &meta.headers, chunks)
                };
                if let Err(Failure::Ours(error)) = done {
                    failure = Some(error);
                    return Err(exr::error::Error::Aborted);
                }
                if let Err(Failure::Exr(error)) = done {
                    return Err(error);
                }
            }
            Ok(())
        });
        match failure {
            Some(error) => Err(error),
            None => result.map_err(|e| Error::from_exr(path, "write", e)),
        }
    }

    fn encode_part(
        &self,
        index: usize,
        part: &Part,
        plan: &PartPlan,
        source: Option<&mut Source<BufReader<File>>>,
        headers: &[Header],
        chunks: &mut impl ChunksWriter,
    ) -> Result<(), Failure> {
        // Channels that were not read before are read for this part only, and given back after it.
        let mut loaded = Vec::new();
        let missing: HashSet<&str> =
            part.channels.iter().filter(|c| c.samples.is_none()).map(|c| c.name.as_str()).collect();
        if !missing.is_empty()
            && let Some(source) = source
        {
            loaded.extend(self.parts.iter().enumerate().map(|(i, p)| {
                let channels =
                    if i == index { p.channels.iter().map(Channel::without_samples).collect() } else { Vec::new() };
                Part { index: i, header: p.header.clone(), channels }
            }));
            source.fill(&mut loaded, &|_, channel| missing.contains(channel.name())).map_err(Failure::Ours)?;
        }
        let loaded = loaded.get(index).map(|part| part.channels.as_slice()).unwrap_or_default();
        let samples: Vec<_> = (part.channels.iter().enumerate())
            .filter_map(|(i, channel)| channel.samples.as_ref().or_else(|| loaded.get(i)?.samples.as_ref()))
            .collect();
        let width = part.header.layer_size.width();
        let blocks: Vec<(usize, BlockIndex)> = ordered_blocks(index, &plan.header);
        for some in blocks.chunks(BLOCKS_AT_ONCE) {
            let compressed = some.par_iter().map_init(deflate, |deflate, &(number, index)| {
                let (size, at) = (index.pixel_size, index.pixel_position);
                let mut data = Vec::with_capacity(size.area() * part.header.channels.bytes_per_pixel);
                for row in 0..size.height() {
                    for samples in &samples {
                        samples.append_row((at.y() + row) * width + at.x(), size.width(), &mut data);
                    }
                }
                Ok((number, chunk(deflate, UncompressedBlock { index, data }, headers)?))
            });
            for (number, chunk) in compressed.collect::<exr::error::Result<Vec<_>>>().map_err(Failure::Exr)? {
                chunks.write_chunk(number, chunk).map_err(Failure::Exr)?;
            }
        }
        Ok(())
    }
}

/// Files are a little smaller than with exr's own deflate.
const DEFLATE_LEVEL: u32 = 4;

fn deflate() -> Compress {
    Compress::new(flate2::Compression::new(DEFLATE_LEVEL), true)
}

/// A block as a file holds it. ZIP, what most files have, is compressed here: exr has one deflate, and no door for another.
fn chunk(deflate: &mut Compress, block: UncompressedBlock, headers: &[Header]) -> exr::error::Result<Chunk> {
    let zip = |header: &&Header| matches!(header.compression, Compression::ZIP1 | Compression::ZIP16);
    let Some(header) = headers.get(block.index.layer).filter(zip).filter(|_| cfg!(target_endian = "little")) else {
        return block.compress_to_chunk(headers);
    };
    let UncompressedBlock { index, data } = block;
    let compressed_pixels_le = zipped(deflate, &data).unwrap_or(data);
    let Vec2(x, y) = index.pixel_position;
    let Vec2(width, height) = header.max_block_pixel_size();
    let compressed_block = match header.blocks {
        BlockDescription::ScanLines => {
            // Rows count from the top of the display window.
            let first = i64::from(header.own_attributes.layer_position.y()) + y as i64;
            let y_coordinate =
                i32::try_from(first).map_err(|_| exr::error::Error::Invalid("a row out of range".into()))?;
            CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le })
        }
        BlockDescription::Tiles(_) => {
            let tile_index = Vec2(x / width.max(1), y / height.max(1));
            let coordinates = TileCoordinates { tile_index, level_index: index.level };
            CompressedBlock::Tile(CompressedTileBlock { coordinates, compressed_pixels_le })
        }
    };
    Ok(Chunk { layer_index: index.layer, compressed_block })
}

/// Bytes as OpenEXR's ZIP keeps them: every other one first, then the rest, as differences of neighbours, in a zlib stream. `None`: that would
/// be no shorter, and the format wants them as they are.
fn zipped(deflate: &mut Compress, data: &[u8]) -> Option<Vec<u8>> {
    let (pairs, last) = data.as_chunks::<2>();
    let mut apart = Vec::with_capacity(data.len());
    apart.extend(pairs.iter().map(|[first, _]| *first).chain(last.iter().copied()));
    apart.extend(pairs.iter().map(|[_, second]| *second));
    let mut differences = apart.clone();
    for (difference, pair) in differences.iter_mut().skip(1).zip(apart.windows(2)) {
        *difference = pair[1].wrapping_sub(pair[0]).wrapping_add(128);
    }
    let mut compressed = Vec::with_capacity(data.len());
    deflate.reset();
    let status = deflate.compress_vec(&differences, &mut compressed, FlushCompress::Finish).ok()?;
    (status == Status::StreamEnd && compressed.len() < data.len()).then_some(compressed)
}

enum Failure {
    Ours(Error),
    Exr(exr::error::Error),
}

fn ordered_blocks(part: usize, header: &Header) -> Vec<(usize, BlockIndex)> {
    exr::block::enumerate_ordered_header_block_indices(std::slice::from_ref(header))
        .map(|(number, block)| (number, BlockIndex { layer: part, ..block }))
        .collect()
}

fn copy_part(source: &mut Source<BufReader<File>>, part: usize, chunks: &mut impl ChunksWriter) -> Result<(), Failure> {
    let chosen: Vec<bool> = (0..source.meta.headers.len()).map(|i| i == part).collect();
    let places: Vec<BlockPlace> = source.blocks(&chosen).map_err(Failure::Ours)?;
    for place in &places {
        let chunk = source.chunk(place).map_err(Failure::Ours)?;
        chunks.write_chunk(place.number, chunk).map_err(Failure::Exr)?;
    }
    Ok(())
}

/// How a part is written.
struct PartPlan {
    header: Header,
    /// Block by block as it lies in the input.
    copied: bool,
}

impl PartPlan {
    fn of(part: &Part, notes: &mut Vec<String>) -> Self {
        let mut header = part.header.clone();
        let replaced = part.channels.iter().any(|channel| channel.replaced);
        if !replaced {
            // The table counts from the top; blocks lie as they lay.
            return Self { header, copied: true };
        }
        let name = if part.name().is_empty() { "the picture".to_owned() } else { format!("part `{}`", part.name()) };
        let floats = part.header.channels.list.iter().any(|c| c.sample_type == SampleType::F32);
        let compression = match header.compression {
            kept @ (Compression::Uncompressed
            | Compression::RLE
            | Compression::ZIP1
            | Compression::ZIP16
            | Compression::PIZ) => kept,
            Compression::PXR24 if !floats => Compression::PXR24,
            lossy => {
                let lossy = compression_name(lossy);
                notes.push(format!("{name}: written with ZIP, since {lossy} would lose data"));
                Compression::ZIP16
            }
        };
        header.compression = compression;
        if let BlockDescription::Tiles(tiles) = &mut header.blocks
            && tiles.level_mode != LevelMode::Singular
        {
            tiles.level_mode = LevelMode::Singular;
            notes.push(format!("{name}: written without its smaller resolutions"));
        }
        if header.blocks == BlockDescription::ScanLines && header.line_order == LineOrder::Unspecified {
            header.line_order = LineOrder::Increasing;
        }
        header.chunk_count = compute_chunk_count(header.compression, header.layer_size, header.blocks);
        Self { header, copied: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What does not get shorter is kept as it is. That exr reads what is compressed here, the tests of whole files show.
    #[test]
    fn blocks_are_compressed_as_exr_does() {
        let mut deflate = deflate();
        let smooth: Vec<u8> = (0..4001).flat_map(|i: u32| [(i / 7) as u8, 0x3c]).take(8001).collect();
        let mut state = 1u32;
        let noise: Vec<u8> = (0..4000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        assert_eq!(zipped(&mut deflate, &noise), None);
        assert_eq!(zipped(&mut deflate, &[]), None);
        let compressed = zipped(&mut deflate, &smooth).unwrap();
        assert!(compressed.len() < smooth.len() / 8, "{}", compressed.len());
        // Undone by the format's description.
        let mut differences = Vec::with_capacity(smooth.len() + 1);
        flate2::Decompress::new(true)
            .decompress_vec(&compressed, &mut differences, flate2::FlushDecompress::Finish)
            .unwrap();
        for i in 1..differences.len() {
            differences[i] = differences[i].wrapping_add(differences[i - 1]).wrapping_sub(128);
        }
        let half = smooth.len().div_ceil(2);
        let joined: Vec<u8> =
            (0..smooth.len()).map(|i| differences[i / 2 + if i % 2 == 1 { half } else { 0 }]).collect();
        assert_eq!(joined, smooth);
    }
}
