//! Any flat EXR file as data: windows, parts, channels, attributes. Knows the file format, and no role of any channel.
//!
//! [`read_headers`] reads what a file holds, [`read_image`] its samples as well, [`read_channels`] some of them.
//! [`ExrImage::write`] writes an image back: what was not replaced comes out as it went in. [`ExrImage::from_channels`] makes one
//! without a file.

mod add;
mod check;
mod made;
mod order;
mod read;
mod write;

pub use read::{read_channels, read_headers, read_image, read_image_from};
pub use write::{ImageWriteOptions, ImageWritten};

pub use exr::meta::attribute::AttributeValue;

use exr::meta::BlockDescription;
use exr::meta::attribute::{IntegerBounds, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{Compression, LineOrder};
use half::f16;
use half::slice::HalfFloatSliceExt;
use quell::Size;
use std::path::PathBuf;

/// A rectangle of pixels, anywhere in the plane of the picture: x to the right, y down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// Left column.
    pub x: i32,
    /// Top row.
    pub y: i32,
    /// Extent.
    pub size: Size,
}

impl Window {
    /// A window from its top left pixel and its extent.
    pub const fn new(x: i32, y: i32, size: Size) -> Self {
        Self { x, y, size }
    }

    pub(crate) fn from_bounds(bounds: IntegerBounds) -> Self {
        let (x, y) = (bounds.position.x(), bounds.position.y());
        Self { x, y, size: Size::new(bounds.size.width(), bounds.size.height()) }
    }

    /// The smallest window that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let right = |w: Self| i64::from(w.x) + w.size.width as i64;
        let bottom = |w: Self| i64::from(w.y) + w.size.height as i64;
        let (x, y) = (self.x.min(other.x), self.y.min(other.y));
        let width = right(self).max(right(other)) - i64::from(x);
        let height = bottom(self).max(bottom(other)) - i64::from(y);
        Self { x, y, size: Size::new(width as usize, height as usize) }
    }
}

impl std::fmt::Display for Window {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { x, y, size } = self;
        write!(f, "{}x{} at ({x}, {y})", size.width, size.height)
    }
}

/// How a channel's numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SampleKind {
    /// 16-bit float.
    Half,
    /// 32-bit float.
    Float,
    /// 32-bit unsigned integer.
    Uint,
}

impl SampleKind {
    fn of(kind: SampleType) -> Self {
        match kind {
            SampleType::F16 => Self::Half,
            SampleType::F32 => Self::Float,
            SampleType::U32 => Self::Uint,
        }
    }

    /// `half`, `float`, `uint`: the format's own words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Half => "half",
            Self::Float => "float",
            Self::Uint => "uint",
        }
    }
}

/// The samples of one channel, row by row from the top of the data window.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 16-bit floats.
    Half(Vec<f16>),
    /// 32-bit floats.
    Float(Vec<f32>),
    /// 32-bit unsigned integers.
    Uint(Vec<u32>),
}

impl Samples {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Half(v) => v.len(),
            Self::Float(v) => v.len(),
            Self::Uint(v) => v.len(),
        }
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How they are stored.
    pub const fn kind(&self) -> SampleKind {
        match self {
            Self::Half(_) => SampleKind::Half,
            Self::Float(_) => SampleKind::Float,
            Self::Uint(_) => SampleKind::Uint,
        }
    }

    /// Sample number `i` as float; 0 beyond the end.
    pub fn get(&self, i: usize) -> f32 {
        match self {
            Self::Half(v) => v.get(i).map_or(0.0, |v| v.to_f32()),
            Self::Float(v) => v.get(i).copied().unwrap_or(0.0),
            Self::Uint(v) => v.get(i).map_or(0.0, |v| *v as f32),
        }
    }

    /// All as floats. Integers above 2^24 are rounded.
    pub fn to_f32(&self) -> Vec<f32> {
        match self {
            Self::Half(v) => {
                let mut floats = vec![0.0; v.len()];
                v.convert_to_f32_slice(&mut floats);
                floats
            }
            Self::Float(v) => v.clone(),
            Self::Uint(v) => v.iter().map(|v| *v as f32).collect(),
        }
    }

    /// Floats stored as `kind`, and how many finite ones were beyond the largest half float (65504) and are stored as
    /// that. Infinities and NaN are kept; for integers values are rounded and clamped.
    pub fn from_f32(values: Vec<f32>, kind: SampleKind) -> (Self, usize) {
        match kind {
            SampleKind::Float => (Self::Float(values), 0),
            SampleKind::Uint => (Self::Uint(values.into_iter().map(|v| v.round() as u32).collect()), 0),
            SampleKind::Half => {
                let mut halves = vec![f16::ZERO; values.len()];
                halves.convert_from_f32_slice(&values);
                let mut clamped = 0;
                for (half, value) in halves.iter_mut().zip(&values) {
                    if half.is_infinite() && value.is_finite() {
                        *half = if *value > 0.0 { f16::MAX } else { f16::MIN };
                        clamped += 1;
                    }
                }
                (Self::Half(halves), clamped)
            }
        }
    }
}

/// One channel of a part.
#[derive(Clone, Debug)]
pub struct Channel {
    name: String,
    kind: SampleKind,
    samples: Option<Samples>,
    replaced: bool,
}

impl Channel {
    /// As it stands in the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it is stored.
    pub const fn kind(&self) -> SampleKind {
        self.kind
    }

    /// The samples, where they were read or replaced.
    pub const fn samples(&self) -> Option<&Samples> {
        self.samples.as_ref()
    }

    fn without_samples(&self) -> Self {
        Self { name: self.name.clone(), kind: self.kind, samples: None, replaced: false }
    }

    pub(crate) fn into_samples(self) -> Option<(String, Samples)> {
        Some((self.name, self.samples?))
    }

    /// True where the samples are no longer those of the file.
    pub const fn is_replaced(&self) -> bool {
        self.replaced
    }
}

/// One part of a file: channels of one extent.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its place in the file.
    index: usize,
    header: Header,
    channels: Vec<Channel>,
}

impl Part {
    /// Its place in the file, from 0.
    pub const fn index(&self) -> usize {
        self.index
    }

    /// The part's name; empty where it has none.
    pub fn name(&self) -> String {
        self.header.own_attributes.layer_name.as_ref().map_or_else(String::new, string)
    }

    /// The stereo view that the whole part belongs to, where its header says so.
    pub fn view(&self) -> Option<String> {
        self.header.own_attributes.view_name.as_ref().map(string)
    }

    /// The names of a `multiView` header: channels carry their view in their names.
    pub fn multi_view(&self) -> Vec<String> {
        self.header.own_attributes.multi_view_names.iter().flatten().map(string).collect()
    }

    /// Where there are pixels.
    pub fn data_window(&self) -> Window {
        Window::from_bounds(self.header.data_window())
    }

    /// Extent of the data window.
    pub fn size(&self) -> Size {
        self.data_window().size
    }

    /// The compression by its usual name: `NONE`, `RLE`, `ZIPS`, `ZIP`, `PIZ`, `PXR24`, `B44`, `B44A`, `DWAA`, `DWAB`,
    /// `HTJ2K`.
    pub fn compression(&self) -> &'static str {
        compression_name(self.header.compression)
    }

    /// Extent of a tile; absent: the part is stored in scan lines.
    pub fn tiles(&self) -> Option<Size> {
        match self.header.blocks {
            BlockDescription::ScanLines => None,
            BlockDescription::Tiles(tiles) => Some(Size::new(tiles.tile_size.width(), tiles.tile_size.height())),
        }
    }

    /// True where rows are stored from the bottom up. Samples are always kept from the top down.
    pub fn bottom_up(&self) -> bool {
        self.header.line_order == LineOrder::Decreasing
    }

    /// The channels in the file's order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    pub(crate) fn into_channels(self) -> Vec<Channel> {
        self.channels
    }

    /// The position of a channel.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|c| c.name == name)
    }

    /// Every header attribute beyond those that describe how pixels are stored.
    pub fn attributes(&self) -> Vec<(String, AttributeValue)> {
        let structural: [&[u8]; 12] = [
            b"channels",
            b"compression",
            b"dataWindow",
            b"displayWindow",
            b"lineOrder",
            b"tiles",
            b"type",
            b"name",
            b"view",
            b"chunkCount",
            b"version",
            b"maxSamplesPerPixel",
        ];
        let mut all: Vec<_> = (self.header.all_named_attributes())
            .filter(|(name, _)| !structural.contains(name))
            .map(|(name, value)| (String::from_utf8_lossy(name).into_owned(), value))
            .collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    }

    /// A header attribute that is text.
    pub fn text(&self, name: &str) -> Option<String> {
        self.attributes().into_iter().find(|(n, _)| n == name).and_then(|(_, value)| match value {
            AttributeValue::Text(text) => Some(string(&text)),
            _ => None,
        })
    }
}

fn compression_name(compression: Compression) -> &'static str {
    match compression {
        Compression::Uncompressed => "NONE",
        Compression::RLE => "RLE",
        Compression::ZIP1 => "ZIPS",
        Compression::ZIP16 => "ZIP",
        Compression::PIZ => "PIZ",
        Compression::PXR24 => "PXR24",
        Compression::B44 => "B44",
        Compression::B44A => "B44A",
        Compression::DWAA(_) => "DWAA",
        Compression::DWAB(_) => "DWAB",
        Compression::HTJ2K32 | Compression::HTJ2K256 => "HTJ2K",
    }
}

/// One file.
#[derive(Clone, Debug)]
pub struct ExrImage {
    path: PathBuf,
    /// Length and time of the file that was read: what is still to be taken from it must be the same file.
    stamp: Option<read::Stamp>,
    parts: Vec<Part>,
}

impl ExrImage {
    /// The file that it was read from.
    pub fn path(&self) -> &std::path::Path {
        &self.path
    }

    /// The rectangle that is shown.
    pub fn display_window(&self) -> Window {
        // Reading refuses files without parts.
        self.parts.first().map_or(Window::new(0, 0, Size::new(1, 1)), |part| {
            Window::from_bounds(part.header.shared_attributes.display_window)
        })
    }

    /// Width of a pixel over its height.
    pub fn pixel_aspect(&self) -> f32 {
        self.parts.first().map_or(1.0, |part| part.header.shared_attributes.pixel_aspect)
    }

    /// The parts in the file's order; at least one.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    pub(crate) fn into_parts(self) -> Vec<Part> {
        self.parts
    }

    /// The smallest window that holds the display window and the data of every part.
    pub fn full_window(&self) -> Window {
        self.parts.iter().fold(self.display_window(), |window, part| window.union(part.data_window()))
    }

    /// The first part's attribute of that name, else any part's.
    pub fn text(&self, name: &str) -> Option<String> {
        self.parts.iter().find_map(|part| part.text(name))
    }

    /// The samples of a channel, where they were read.
    pub fn samples(&self, part: usize, channel: usize) -> Option<&Samples> {
        self.parts.get(part)?.channels.get(channel)?.samples()
    }

    /// Replaces the samples of a channel: as many as the data window has pixels, stored as the channel is.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] where there is no such channel, or count or kind differ.
    pub fn replace(&mut self, part: usize, channel: usize, samples: Samples) -> Result<(), crate::Error> {
        let path = &self.path;
        let found = self.parts.get_mut(part).map(|p| (p.data_window().size.pixels(), p));
        let Some((pixels, target)) = found.and_then(|(n, p)| Some((n, p.channels.get_mut(channel)?))) else {
            return Err(crate::Error::invalid(path, format!("there is no channel {channel} of part {part}")));
        };
        if samples.len() != pixels || samples.kind() != target.kind {
            let reason = format!(
                "channel `{}` holds {pixels} samples of kind {}, not {} of kind {}",
                target.name,
                target.kind.name(),
                samples.len(),
                samples.kind().name()
            );
            return Err(crate::Error::invalid(path, reason));
        }
        target.samples = Some(samples);
        target.replaced = true;
        Ok(())
    }

    /// Forgets the samples that can be read again from the file: a frame that waits to be written needs none of them.
    pub fn forget(&mut self) {
        for channel in self.parts.iter_mut().flat_map(|part| &mut part.channels).filter(|c| !c.replaced) {
            channel.samples = None;
        }
    }

    /// Sets a header text in the first part.
    ///
    /// # Errors
    /// [`crate::Error::NotSupported`] for texts with a zero character or names that the format keeps for itself.
    pub fn set_text(&mut self, name: &str, value: &str) -> Result<(), crate::Error> {
        let value = AttributeValue::Text(crate::exr_file::text(&self.path, value)?);
        self.set_attribute(name, value)
    }

    /// Sets a header attribute in the first part.
    ///
    /// # Errors
    /// [`crate::Error::NotSupported`] for names that the format keeps for itself.
    pub fn set_attribute(&mut self, name: &str, value: AttributeValue) -> Result<(), crate::Error> {
        let reserved = exr::meta::header::standard_names::ALL.contains(&name.as_bytes());
        if reserved || name.is_empty() || name.len() > 255 {
            let reason = format!("`{name}` cannot be the name of an attribute of ours");
            return Err(crate::Error::not_supported(&self.path, reason));
        }
        let name = crate::exr_file::text(&self.path, name)?;
        if let Some(part) = self.parts.first_mut() {
            part.header.own_attributes.other.insert(name, value);
        }
        Ok(())
    }
}

fn string(text: &Text) -> String {
    crate::exr_file::string(text)
}
