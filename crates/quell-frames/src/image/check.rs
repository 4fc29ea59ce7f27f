//! What a header may claim, checked against the file's length before anything of the claimed size is allocated.

use crate::error::Error;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::{Compression, Vec2};
use std::collections::HashSet;
use std::path::Path;

/// Bytes of pixels that a byte of file can stand for at most. Deflate reaches 1032 (a 258-byte match in 2 bits); run
/// lengths before it (DWA) multiply that, but only in files of kilobytes. Together with the fixed part this lets every
/// real file pass and a header of 400 bytes claim no more than a mebibyte or so.
const PIXEL_BYTES_PER_FILE_BYTE: u128 = 2200;

/// Bytes that a chunk needs at least: its place in the table, its coordinates, its length.
const BYTES_PER_CHUNK: u128 = 16;

/// Part and channel as messages name them.
pub(super) fn part_name(headers: &[Header], index: usize) -> String {
    let name = headers.get(index).and_then(|h| h.own_attributes.layer_name.as_ref());
    match name {
        Some(name) if headers.len() > 1 => format!("part `{}`: ", super::string(name)),
        _ if headers.len() > 1 => format!("part {index}: "),
        _ => String::new(),
    }
}

/// Refuses what cannot be read, and what the file is too short for.
pub(super) fn headers(path: &Path, meta: &MetaData, file_bytes: u64) -> Result<(), Error> {
    if meta.headers.is_empty() {
        return Err(Error::invalid(path, "the file has no part"));
    }
    let mut pixel_bytes = 0;
    let mut chunks = 0;
    for (index, header) in meta.headers.iter().enumerate() {
        let part = part_name(&meta.headers, index);
        one(path, &part, header)?;
        let (width, height) = (header.layer_size.width() as u128, header.layer_size.height() as u128);
        let bytes: u128 = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u128).sum();
        pixel_bytes += width * height * bytes;
        chunks += header.chunk_count as u128;
        if pixel_bytes > u128::from(file_bytes) * PIXEL_BYTES_PER_FILE_BYTE
            || chunks * BYTES_PER_CHUNK > u128::from(file_bytes)
        {
            return Err(Error::invalid(
                path,
                format!(
                    "{part}the header claims {width}x{height} pixels of {bytes} bytes in {} blocks, which a file of \
                     {file_bytes} bytes cannot hold",
                    header.chunk_count
                ),
            ));
        }
    }
    Ok(())
}

fn one(path: &Path, part: &str, header: &Header) -> Result<(), Error> {
    if header.deep {
        let first = header.channels.list.first().map_or_else(String::new, |c| super::string(&c.name));
        let reason = format!("{part}deep data (channel `{first}` and those beside it); flatten it first");
        return Err(Error::not_supported(path, reason));
    }
    for window in [header.data_window(), header.shared_attributes.display_window] {
        window.validate(None).map_err(|e| Error::from_exr(path, "read", e))?;
        if window.size.width() == 0 || window.size.height() == 0 {
            let reason = format!("{part}a window of {}x{} has no pixels", window.size.width(), window.size.height());
            return Err(Error::invalid(path, reason));
        }
    }
    if header.channels.list.is_empty() {
        return Err(Error::invalid(path, format!("{part}there is no channel")));
    }
    let mut names = HashSet::new();
    for channel in &header.channels.list {
        let name = super::string(&channel.name);
        if channel.sampling != Vec2(1, 1) {
            let Vec2(x, y) = channel.sampling;
            let reason = format!("{part}channel `{name}` is subsampled ({x}x{y})");
            return Err(Error::not_supported(path, reason));
        }
        if !names.insert(name.clone()) {
            return Err(Error::invalid(path, format!("{part}channel `{name}` appears twice")));
        }
    }
    if let BlockDescription::Tiles(tiles) = header.blocks {
        let Vec2(width, height) = tiles.tile_size;
        let limit = 1 << 16;
        if width == 0 || height == 0 || width > limit || height > limit {
            return Err(Error::invalid(path, format!("{part}tiles of {width}x{height} pixels")));
        }
    }
    Ok(())
}

/// Refuses a block of DWA whose own header claims more than the block's pixels can need: exr 1.74.2 allocates what it
/// reads there. The header is eleven counters of eight bytes; the second to the tenth are sizes and counts.
pub(super) fn block(chunk: &Chunk, meta: &MetaData) -> exr::error::Result<()> {
    let invalid = || exr::error::Error::Invalid("a block claims more than its pixels need".into());
    let header = meta.headers.get(chunk.layer_index).ok_or_else(invalid)?;
    let (Compression::DWAA(_) | Compression::DWAB(_)) = header.compression else { return Ok(()) };
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Err(invalid()),
    };
    let place = header.get_block_data_indices(&chunk.compressed_block)?;
    let size = header.get_absolute_block_pixel_coordinates(place)?.size;
    let bytes_per_pixel = header.channels.bytes_per_pixel as u64;
    let (width, height) = (size.width() as u64, size.height() as u64);
    if bytes.len() as u64 == width * height * bytes_per_pixel {
        // Stored as it is.
        return Ok(());
    }
    // Transformed in squares of 8x8, so borders round up; rules and lengths of runs come on top.
    let most = 4096 + 2 * (width + 8) * (height + 8) * bytes_per_pixel;
    let counters = bytes.as_chunks::<8>().0.iter().take(10).skip(1);
    if counters.map(|counter| u64::from_le_bytes(*counter)).any(|counter| counter > most) {
        return Err(invalid());
    }
    Ok(())
}
