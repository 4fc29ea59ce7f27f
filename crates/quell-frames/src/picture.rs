//! One colour picture from an EXR file of any program.

use crate::error::Error;
use crate::image::{ExrImage, read_headers};
use quell::{Plane, Rgb};
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the channels `R`, `G` and `B` of an EXR file, whoever wrote it: half, float or integer, scene-linear. Where
/// there are none of that name, those of the layer whose name ends in `Combined` (Blender's beauty), else those of the
/// only layer that has them (`beauty.R` and so on). Flat files of any number of parts; the picture is the data window.
///
/// # Errors
/// [`Error::Invalid`] without such channels or where several layers have them, [`Error::NotSupported`] for deep data
/// and subsampled channels, [`Error::Io`].
pub fn read_picture(path: &Path) -> Result<Plane<Rgb>, Error> {
    let mut image = read_headers(path)?;
    let [part, r, g, b] = find(&image)?;
    let names: Vec<String> =
        [r, g, b].iter().filter_map(|c| Some(image.parts().get(part)?.channels().get(*c)?.name().to_owned())).collect();
    let part_name = image.parts().get(part).map(|p| p.name());
    image.load(|p, c| Some(p.name()) == part_name && names.iter().any(|name| name == c.name()))?;
    let size = image.parts().get(part).map_or(quell::Size::new(1, 1), |p| p.size());
    let [r, g, b] = [r, g, b].map(|c| image.samples(part, c).map(crate::image::Samples::to_f32).unwrap_or_default());
    let pixels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
    Plane::from_vec(size, pixels).map_err(|source| Error::Frame { path: path.to_owned(), source })
}

/// Part and channels of the picture.
fn find(image: &ExrImage) -> Result<[usize; 4], Error> {
    let mut layers: BTreeMap<String, [usize; 4]> = BTreeMap::new();
    for (p, part) in image.parts().iter().enumerate() {
        for channel in part.channels() {
            let Some(layer) = channel.name().strip_suffix('R').filter(|l| l.is_empty() || l.ends_with('.')) else {
                continue;
            };
            let [r, g, b] = ["R", "G", "B"].map(|c| part.find(&format!("{layer}{c}")));
            if let (Some(r), Some(g), Some(b)) = (r, g, b) {
                // The first part of a name: of stereo views the first.
                layers.entry(layer.trim_end_matches('.').to_owned()).or_insert([p, r, g, b]);
            }
        }
    }
    let combined = |(name, _): &(&String, &[usize; 4])| name.rsplit('.').next() == Some("Combined");
    if let Some(found) = layers.get("") {
        return Ok(*found);
    }
    let mut all = layers.iter();
    match (layers.iter().find(combined), all.next(), all.next()) {
        (Some((_, found)), ..) | (None, Some((_, found)), None) => Ok(*found),
        (None, Some((one, _)), Some((other, _))) => {
            let reason = format!("layers `{one}` and `{other}` both hold a picture, and none is called R, G, B");
            Err(Error::invalid(image.path(), reason))
        }
        (None, None, _) => {
            let names: Vec<&str> = image.parts().iter().flat_map(|p| p.channels()).map(|c| c.name()).take(12).collect();
            Err(Error::invalid(image.path(), format!("no channels R, G, B; there are {}", names.join(", "))))
        }
    }
}
