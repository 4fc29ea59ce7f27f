//! An image without a file, from samples in memory.

use super::{Channel, ExrImage, Part, SampleKind, Samples};
use crate::error::Error;
use crate::exr_file::text;
use exr::meta::attribute::{ChannelDescription, SampleType, Text};
use exr::meta::header::Header;
use quell::Size;
use std::collections::BTreeMap;
use std::path::Path;

impl ExrImage {
    /// One part that fills its display window, with these channels, row by row from the top. `label` stands for the file in
    /// messages.
    ///
    /// There is no file to read again from: what [`ExrImage::forget`] forgets is gone.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there are no pixels or no channels, or a channel does not hold a sample for each pixel;
    /// [`Error::NotSupported`] for names with a zero character.
    pub fn from_channels(label: &Path, size: Size, channels: BTreeMap<String, Samples>) -> Result<Self, Error> {
        if size.pixels() == 0 || channels.is_empty() {
            let reason = format!("{}x{} pixels, {} channels", size.width, size.height, channels.len());
            return Err(Error::invalid(label, reason));
        }
        let mut described = exr::prelude::SmallVec::new();
        let mut all = Vec::with_capacity(channels.len());
        for (name, samples) in channels {
            if samples.len() != size.pixels() {
                let reason = format!("channel `{name}` holds {} samples, not {}", samples.len(), size.pixels());
                return Err(Error::invalid(label, reason));
            }
            let stored = match samples.kind() {
                SampleKind::Half => SampleType::F16,
                SampleKind::Float => SampleType::F32,
                SampleKind::Uint => SampleType::U32,
            };
            described.push(ChannelDescription::named(text(label, &name)?, stored));
            all.push(Channel { name, kind: samples.kind(), samples: Some(samples), replaced: false });
        }
        let mut header = Header::new(Text::new_or_panic(""), (size.width, size.height), described);
        header.own_attributes.layer_name = None;
        let part = Part { index: 0, header, channels: all };
        Ok(Self { path: label.to_owned(), stamp: None, parts: vec![part] })
    }
}
