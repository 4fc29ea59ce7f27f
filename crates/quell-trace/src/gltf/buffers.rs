//! The bytes of buffers and images: the container's own, embedded as base64, or in files beside.

use super::container::read_file;
use super::error::{Fault, Place, Problem, item};
use super::schema::{Image, Root};
use super::{Budget, Limits};
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use rayon::prelude::*;
use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

/// Embedded data with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Where external files may lie.
pub(super) struct Folder<'a> {
    pub(super) path: &'a Path,
    pub(super) limits: &'a Limits,
    pub(super) budget: &'a Budget,
}

/// All buffers, each at least as long as it says.
pub(super) struct Buffers<'a> {
    bytes: Vec<Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    pub(super) fn load(root: &Root, binary: Option<&'a [u8]>, folder: &Folder<'_>) -> Result<Self, Fault> {
        let one = |(index, buffer): (usize, &super::schema::Buffer)| {
            let list = Place::root("buffers");
            let place = list.item(index);
            let bytes = match (&buffer.uri, binary) {
                (Some(uri), _) => Cow::Owned(folder.load(uri, &place.field("uri"))?),
                (None, Some(binary)) if index == 0 => Cow::Borrowed(binary),
                (None, _) => {
                    let problem = "has no `uri`, and the file has no binary chunk for it";
                    return Err(Fault::data(&place, problem));
                }
            };
            let (needed, found) = (buffer.byte_length, bytes.len() as u64);
            if found < needed {
                let problem = Problem::Cut { what: "byteLength", needed, found };
                return Err(Fault::new(&place, problem));
            }
            Ok(bytes)
        };
        let bytes = root.buffers.par_iter().enumerate().map(one).collect::<Result<_, _>>()?;
        Ok(Self { bytes })
    }

    /// What did not come out of the file itself: it belongs to the scene's identity.
    pub(super) fn external(&self) -> impl Iterator<Item = &[u8]> {
        self.bytes.iter().filter_map(|b| match b {
            Cow::Owned(bytes) => Some(bytes.as_slice()),
            Cow::Borrowed(_) => None,
        })
    }

    /// The bytes of a view, and its stride where it has one.
    pub(super) fn view(&self, root: &Root, index: usize, place: &Place<'_>) -> Result<(&[u8], Option<u64>), Fault> {
        let view = item(&root.buffer_views, index, "buffer view", place)?;
        let place = place.refers("bufferViews", index);
        let bytes = item(&self.bytes, view.buffer, "buffer", &place.field("buffer"))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let range = end.and_then(|end| Some(usize::try_from(view.byte_offset).ok()?..usize::try_from(end).ok()?));
        match range.and_then(|range| bytes.get(range)) {
            Some(bytes) => Ok((bytes, view.byte_stride)),
            None => Err(Fault::data(
                &place,
                format!(
                    "byteOffset {} and byteLength {} reach beyond buffer {}, which has {} bytes",
                    view.byte_offset,
                    view.byte_length,
                    view.buffer,
                    bytes.len()
                ),
            )),
        }
    }

    /// The encoded bytes of an image.
    pub(super) fn image(
        &self,
        root: &Root,
        image: &Image,
        folder: &Folder<'_>,
        place: &Place<'_>,
    ) -> Result<Cow<'_, [u8]>, Fault> {
        match (&image.uri, image.buffer_view) {
            (_, Some(view)) => Ok(Cow::Borrowed(self.view(root, view, &place.field("bufferView"))?.0)),
            (Some(uri), None) => Ok(Cow::Owned(folder.load(uri, &place.field("uri"))?)),
            (None, None) => Err(Fault::data(place, "has neither `uri` nor `bufferView`")),
        }
    }
}

impl Folder<'_> {
    /// Embedded data, or a file inside the folder.
    fn load(&self, uri: &str, place: &Place<'_>) -> Result<Vec<u8>, Fault> {
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, text)) = data.split_once(',').filter(|(head, _)| head.ends_with(";base64")) else {
                return Err(Fault::data(place, "is embedded data, but not as base64"));
            };
            self.budget.charge(text.len() as u64 / 4 * 3, place)?;
            return BASE64.decode(text).map_err(|e| Fault::data(place, format!("is no valid base64 ({e})")));
        }
        let external = |reason: String| {
            let short: String = uri.chars().take(200).collect();
            Fault::new(place, Problem::External { uri: short, reason })
        };
        let path = self.inside(uri).map_err(external)?;
        let bytes = read_file(&path, self.limits.file_bytes)
            .map_err(|problem| external(format!("{problem}; put it beside the scene, or export as one .glb file")))?;
        self.budget.charge(bytes.len() as u64, place)?;
        Ok(bytes)
    }

    /// The path of an external file, which must lie in the scene's folder.
    fn inside(&self, uri: &str) -> Result<PathBuf, String> {
        const OUTSIDE: &str = "lies outside the scene's folder and is not read; move it into the folder, or export as \
                               one .glb file";
        if uri.contains(':') {
            return Err("is an address, not a file beside the scene; download it, or export as one .glb file".into());
        }
        let decoded = percent_decoded(uri).ok_or("is no valid URI: percent signs need two hexadecimal digits")?;
        if decoded.contains(['\\', '\0']) {
            return Err("is no valid URI: it holds a backslash or a zero".into());
        }
        let relative = Path::new(&decoded);
        if relative.components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir)) {
            return Err(OUTSIDE.into());
        }
        let path = self.path.join(relative);
        // Links may lead out of the folder.
        let real = path
            .canonicalize()
            .map_err(|e| format!("cannot be read: {e}; put it beside the scene, or export as one .glb file"))?;
        let folder = self.path.canonicalize().map_err(|e| format!("cannot be read: {e}"))?;
        if real.starts_with(folder) { Ok(real) } else { Err(OUTSIDE.into()) }
    }
}

/// `%20` and its like replaced; `None` where what comes out is not text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut out = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        if byte == b'%' {
            let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
            out.push(u8::from_str_radix(digits, 16).ok()?);
            rest = rest.get(2..)?;
        } else {
            out.push(byte);
        }
    }
    String::from_utf8(out).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_signs_are_decoded() {
        assert_eq!(percent_decoded("a%20b/c%C3%A4").as_deref(), Some("a b/cä"));
        assert_eq!(percent_decoded("a%2"), None);
        assert_eq!(percent_decoded("a%zz"), None);
        assert_eq!(percent_decoded("%ff"), None);
    }
}
