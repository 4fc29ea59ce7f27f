//! Channels and attributes of an EXR file. Knows the file format, and no role of any channel.

use crate::error::Error;
use exr::block::UncompressedBlock;
use exr::block::writer::ChunksWriter;
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::prelude as x;
use exr::prelude::{ReadChannels, ReadLayers};
use quell::Size;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

pub(crate) use exr::meta::attribute::{AttributeValue, Text};

/// The samples of one channel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Samples {
    Half(Vec<half::f16>),
    Float(Vec<f32>),
    Uint(Vec<u32>),
}

/// One part: channels of one extent, and header attributes. Where the format and the roles meet.
#[derive(Debug)]
pub(crate) struct ExrPart {
    pub size: Size,
    pub channels: BTreeMap<String, Samples>,
    pub attributes: BTreeMap<String, AttributeValue>,
}

/// Bytes of pixels that a byte of file can stand for at most. Deflate reaches 1032 (a 258-byte match in 2 bits); run
/// lengths before it (DWA) multiply that, but only in files of kilobytes. Together with the fixed part this lets every
/// real file pass and a header of 400 bytes claim no more than a mebibyte or so.
const PIXEL_BYTES_PER_FILE_BYTE: u128 = 2200;

/// Blocks of 16 lines that are held compressed before they are written: enough for many threads, little memory.
const BLOCKS_AT_ONCE: usize = 64;

/// Header attributes only.
pub(crate) fn read_attributes(path: &Path) -> Result<BTreeMap<String, AttributeValue>, Error> {
    let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let meta = exr::meta::MetaData::read_from_buffered(BufReader::new(file), false)
        .map_err(|e| Error::from_exr(path, "read", e))?;
    Ok(meta.headers.iter().flat_map(|h| own_attributes(&h.own_attributes, &h.shared_attributes)).collect())
}

fn own_attributes<'a>(
    layer: &'a x::LayerAttributes,
    image: &'a x::ImageAttributes,
) -> impl Iterator<Item = (String, AttributeValue)> + 'a {
    layer.other.iter().chain(&image.other).map(|(name, value)| (string(name), value.clone()))
}

/// Reads a flat, single-part file of scan lines; extents are checked against the file's length before anything of
/// their size is allocated.
pub(crate) fn read_part(path: &Path) -> Result<ExrPart, Error> {
    let open = || File::open(path).map_err(|e| Error::io(path, "read", e));
    let file = open()?;
    let info = file.metadata().map_err(|e| Error::io(path, "read", e))?;
    if !info.is_file() {
        return Err(Error::invalid(path, "this is not a file"));
    }
    let meta = exr::meta::MetaData::read_from_buffered(BufReader::new(file), false)
        .map_err(|e| Error::from_exr(path, "read", e))?;
    check_header(path, &meta, info.len())?;

    let image = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(BufReader::new(open()?))
        .map_err(|e| Error::from_exr(path, "read", e))?;
    let image_attributes = image.attributes;
    let layer = image.layer_data.into_iter().next().ok_or_else(|| Error::invalid(path, "the file has no part"))?;
    let attributes = own_attributes(&layer.attributes, &image_attributes).collect();
    let size = Size::new(layer.size.width(), layer.size.height());
    let mut channels = BTreeMap::new();
    for channel in layer.channel_data.list {
        let samples = match channel.sample_data {
            x::FlatSamples::F16(v) => Samples::Half(v),
            x::FlatSamples::F32(v) => Samples::Float(v),
            x::FlatSamples::U32(v) => Samples::Uint(v),
        };
        let name = string(&channel.name);
        if channels.insert(name.clone(), samples).is_some() {
            return Err(Error::invalid(path, format!("channel `{name}` appears twice")));
        }
    }
    Ok(ExrPart { size, channels, attributes })
}

fn check_header(path: &Path, meta: &exr::meta::MetaData, file_bytes: u64) -> Result<(), Error> {
    let [header] = meta.headers.as_slice() else {
        return Err(Error::not_supported(
            path,
            format!("{} parts; files of other programs cannot be read yet", meta.headers.len()),
        ));
    };
    if header.deep {
        return Err(Error::not_supported(path, "deep data"));
    }
    if header.blocks != exr::meta::BlockDescription::ScanLines {
        return Err(Error::not_supported(path, "tiles; files of other programs cannot be read yet"));
    }
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    if width == 0 || height == 0 {
        return Err(Error::invalid(path, format!("image size {width}x{height} has no pixels")));
    }
    if header.channels.list.iter().any(|c| c.sampling != x::Vec2(1, 1)) {
        return Err(Error::not_supported(path, "subsampled channels"));
    }
    let bytes_per_pixel: u128 = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u128).sum();
    let pixel_bytes = width as u128 * height as u128 * bytes_per_pixel;
    if pixel_bytes > u128::from(file_bytes) * PIXEL_BYTES_PER_FILE_BYTE {
        return Err(Error::invalid(
            path,
            format!(
                "the header claims {width}x{height} pixels of {bytes_per_pixel} bytes, which a file of {file_bytes} \
                 bytes cannot hold"
            ),
        ));
    }
    Ok(())
}

/// Writes one part, ZIP in blocks of 16 lines, scene-linear Rec. 709.
///
/// Blocks are compressed in the caller's thread pool (exr would build one of its own for each file) and written in
/// order: the same pixel bytes at any number of threads. (The order of header attributes varies: exr keeps them in a
/// hash map.)
pub(crate) fn write_part(path: &Path, writer: &mut BufWriter<File>, part: ExrPart) -> Result<(), Error> {
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
