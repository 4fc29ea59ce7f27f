//! Channels and attributes of an EXR file. Knows the file format, and no role of any channel.

use crate::error::Error;
use crate::image::{Part, Samples, read_headers, read_image};
use exr::block::UncompressedBlock;
use exr::block::writer::ChunksWriter;
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::prelude as x;
use quell::Size;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::path::Path;

pub(crate) use exr::meta::attribute::{AttributeValue, Text};

/// One part: channels of one extent, and header attributes. Where the format and the roles meet.
#[derive(Debug)]
pub(crate) struct ExrPart {
    pub size: Size,
    pub channels: BTreeMap<String, Samples>,
    pub attributes: BTreeMap<String, AttributeValue>,
}

/// Blocks of 16 lines that are held compressed before they are written: enough for many threads, little memory.
const BLOCKS_AT_ONCE: usize = 64;

/// Header attributes only.
pub(crate) fn read_attributes(path: &Path) -> Result<BTreeMap<String, AttributeValue>, Error> {
    Ok(read_headers(path)?.into_parts().iter().flat_map(Part::attributes).collect())
}

/// Reads a file of one part.
pub(crate) fn read_part(path: &Path) -> Result<ExrPart, Error> {
    let mut parts = read_image(path)?.into_parts();
    let count = parts.len();
    let (Some(part), true) = (parts.pop(), count == 1) else {
        return Err(Error::not_supported(path, format!("{count} parts; quell's own frames have one")));
    };
    let (size, attributes) = (part.size(), part.attributes().into_iter().collect());
    let channels = part.into_channels().into_iter().filter_map(|c| c.into_samples()).collect();
    Ok(ExrPart { size, channels, attributes })
}

/// Writes one part, ZIP in blocks of 16 lines, scene-linear Rec. 709.
///
/// Blocks are compressed in the caller's thread pool (exr would build one of its own for each file) and written in
/// order: the same pixel bytes at any number of threads. (The order of header attributes varies: exr keeps them in a
/// hash map.)
pub(crate) fn write_part(path: &Path, writer: impl Write + Seek, part: ExrPart) -> Result<(), Error> {
    let ExrPart { size, channels, attributes } = part;
    let mut list = exr::prelude::SmallVec::new();
    for (name, samples) in channels {
        let text = text(path, &name)?;
        list.push(x::AnyChannel::new(
            text,
            match samples {
                Samples::Half(v) => x::FlatSamples::F16(v),
                Samples::Float(v) => x::FlatSamples::F32(v),
                Samples::Uint(v) => x::FlatSamples::U32(v),
            },
        ));
    }
    let mut layer_attributes = x::LayerAttributes {
        software_name: Text::new_or_none(format!("quell {}", env!("CARGO_PKG_VERSION"))),
        ..x::LayerAttributes::default()
    };
    for (name, value) in attributes {
        layer_attributes.other.insert(text(path, &name)?, value);
    }
    let encoding = x::Encoding {
        compression: x::Compression::ZIP16,
        blocks: x::Blocks::ScanLines,
        line_order: x::LineOrder::Increasing,
    };
    let layer = x::Layer::new((size.width, size.height), layer_attributes, encoding, x::AnyChannels::sort(list));
    let mut image = x::Image::from_layer(layer);
    image.attributes.chromaticities = Some(x::attribute::Chromaticities {
        red: x::Vec2(0.64, 0.33),
        green: x::Vec2(0.30, 0.60),
        blue: x::Vec2(0.15, 0.06),
        white: x::Vec2(0.3127, 0.3290),
    });

    let headers = image.layer_data.infer_headers(&image.attributes);
    let layers = image.layer_data.create_writer(&headers);
    exr::block::write(writer, headers, true, |meta, chunks| {
        let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        for some in blocks.chunks(BLOCKS_AT_ONCE) {
            let compressed = some.par_iter().map(|&(number, index)| {
                let data = layers.extract_uncompressed_block(&meta.headers, index);
                Ok((number, UncompressedBlock { index, data }.compress_to_chunk(&meta.headers)?))
            });
            for (number, chunk) in compressed.collect::<exr::error::Result<Vec<_>>>()? {
                chunks.write_chunk(number, chunk)?;
            }
        }
        Ok(())
    })
    .map_err(|e| Error::from_exr(path, "write", e))
}

/// A header text: UTF-8, as other programs write it (the format itself says only "bytes").
pub(crate) fn text(path: &Path, value: &str) -> Result<Text, Error> {
    if value.contains('\0') {
        return Err(Error::not_supported(path, format!("`{}` has a zero character", value.escape_default())));
    }
    Ok(Text::from_slice_unchecked(value.as_bytes()))
}

/// The text back; bytes that are no UTF-8 are replaced.
pub(crate) fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}
