//! One colour picture from an EXR file of any program.

use crate::error::Error;
use crate::exr_file::{ExrPart, Samples, read_part};
use quell::{Plane, Rgb};
use std::path::Path;

/// Reads the channels `R`, `G` and `B` of an EXR file, whoever wrote it: half, float or integer, scene-linear. Where
/// there are none of that name, those of the only layer that has them (`beauty.R` and so on). Flat, single-part files
/// of scan lines; data outside the data window does not exist.
///
/// # Errors
/// [`Error::Invalid`] without such channels or where several layers have them, [`Error::NotSupported`] for tiled, deep
/// or multi-part files, [`Error::Io`].
pub fn read_picture(path: &Path) -> Result<Plane<Rgb>, Error> {
    let ExrPart { size, mut channels, .. } = read_part(path)?;
    let prefixes: Vec<String> =
        channels.keys().filter_map(|name| name.strip_suffix(".R").map(|layer| format!("{layer}."))).collect();
    let complete = |prefix: &str| ["R", "G", "B"].iter().all(|c| channels.contains_key(&format!("{prefix}{c}")));
    let prefix = if complete("") {
        String::new()
    } else {
        let mut whole = prefixes.into_iter().filter(|p| complete(p));
        match (whole.next(), whole.next()) {
            (Some(only), None) => only,
            (Some(one), Some(other)) => {
                let reason = format!("layers `{one}` and `{other}` both hold a picture, and none is called R, G, B");
                return Err(Error::invalid(path, reason));
            }
            (None, _) => {
                let names: Vec<&str> = channels.keys().map(String::as_str).take(12).collect();
                return Err(Error::invalid(path, format!("no channels R, G, B; there are {}", names.join(", "))));
            }
        }
    };
    let mut component = |name: &str| match channels.remove(&format!("{prefix}{name}")) {
        Some(Samples::Half(v)) => v.into_iter().map(half::f16::to_f32).collect(),
        Some(Samples::Float(v)) => v,
        Some(Samples::Uint(v)) => v.into_iter().map(|v| v as f32).collect(),
        None => Vec::new(),
    };
    let [r, g, b] = ["R", "G", "B"].map(&mut component);
    let pixels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
    Plane::from_vec(size, pixels).map_err(|source| Error::Frame { path: path.to_owned(), source })
}
