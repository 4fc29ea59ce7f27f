//! A channel that the file did not have.

use super::{Channel, ExrImage, Part, SampleKind, Samples};
use crate::error::Error;
use crate::exr_file::text;
use exr::meta::attribute::{ChannelDescription, ChannelList, SampleType};

impl ExrImage {
    /// Adds a channel of zeros with the extent and the storage of part `beside`, and returns its part and place: in a part of
    /// its own, called `part_name`, where the file has several, else in that part. Places of channels behind it change.
    /// Where the file has a channel of that name already, that one is meant.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is no part `beside`, or a name is taken by something else; as
    /// [`ExrImage::load`].
    pub fn add_channel(&mut self, beside: usize, part_name: &str, name: &str) -> Result<(usize, usize), Error> {
        let path = self.path.clone();
        let there = self.parts.iter().enumerate().find_map(|(p, part)| Some((p, part.find(name)?)));
        if let Some((part, channel)) = there {
            return Ok((part, channel));
        }
        let several = self.parts.len() > 1;
        if several && self.parts.iter().any(|part| part.name() == part_name) {
            return Err(Error::invalid(&path, format!("the part `{part_name}` has no channel `{name}`")));
        }
        // A part that gets another channel is written anew: what else it holds is read while the file's own order is known.
        if !several {
            self.load(|part, _| part.index() == beside)?;
        }
        let place = self.parts.len();
        let Some(part) = self.parts.get_mut(beside) else {
            return Err(Error::invalid(&path, format!("there is no part {beside}")));
        };
        let kind = part.channels.first().map_or(SampleKind::Half, |channel| channel.kind);
        let kind = if kind == SampleKind::Uint { SampleKind::Float } else { kind };
        let (samples, _) = Samples::from_f32(vec![0.0; part.data_window().size.pixels()], kind);
        let channel = Channel { name: name.to_owned(), kind, samples: Some(samples), replaced: true };
        let stored = if kind == SampleKind::Half { SampleType::F16 } else { SampleType::F32 };
        let described = ChannelDescription::named(text(&path, name)?, stored);
        if several {
            let mut header = part.header.clone();
            header.own_attributes.layer_name = Some(text(&path, part_name)?);
            header.channels = ChannelList::new([described].into_iter().collect());
            self.parts.push(Part { index: place, header, channels: vec![channel] });
            return Ok((place, 0));
        }
        // The format asks for channels in the order of their names.
        let at = part.channels.iter().position(|other| other.name.as_str() > name).unwrap_or(part.channels.len());
        let mut list = part.header.channels.list.clone();
        list.insert(at, described);
        part.header.channels = ChannelList::new(list);
        part.channels.insert(at, channel);
        Ok((beside, at))
    }
}
