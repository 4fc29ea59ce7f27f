//! Parts of pictures as PNG, with their FLIP maps.

use super::contest::Contest;
use crate::args::compare::Crop;
use crate::failure::Failure;
use quell::{Plane, Size};
use quell_lab::tone::grey_png;
use std::path::Path;

/// A part outside the picture is a slip.
pub fn check(crop: &Crop, size: Size) -> Result<(), Failure> {
    let fits = |from: usize, length: usize, of: usize| from.checked_add(length).is_some_and(|end| end <= of);
    if fits(crop.x, crop.size.width, size.width) && fits(crop.y, crop.size.height, size.height) {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "--crop {},{},{},{} reaches beyond the picture of {size}",
        crop.x, crop.y, crop.size.width, crop.size.height
    )))
}

/// `METHOD.0063.x100y40.png` and, with the ending `.flip.png`, its HDR-FLIP map (black: equal; white: 1), of the last
/// scored frame; and the reference.
pub fn write(crop: &Crop, contest: &Contest, folder: &Path) -> Result<(), Failure> {
    let sequence = &contest.sequence;
    check(crop, sequence.size)?;
    let Some(&number) = sequence.scored.last() else { return Ok(()) };
    let Some(index) = sequence.index_of(number) else { return Ok(()) };
    let place = |name: &str, ending: &str| {
        let safe: String =
            name.chars().map(|c| if c.is_alphanumeric() || "+-_.=".contains(c) { c } else { '_' }).collect();
        folder.join(format!("{safe}.{number:04}.x{}y{}{ending}", crop.x, crop.y))
    };
    if let Some(reference) = sequence.reference(number) {
        let picture = sequence.tone.picture(&reference.mean).crop(crop.x, crop.y, crop.size);
        picture.write_png(&place("reference", ".png"))?;
    }
    for entry in &contest.entries {
        let Ok((finished, verdict)) = &entry.result else { continue };
        let picture = sequence.tone.picture(&finished.picture(index)?).crop(crop.x, crop.y, crop.size);
        picture.write_png(&place(&entry.name, ".png"))?;
        if let Some(map) = verdict.maps.get(&number) {
            let part = Plane::from_fn(crop.size, |x, y| map.at(x + crop.x, y + crop.y));
            quell_frames::files::write_bytes(&place(&entry.name, ".flip.png"), &grey_png(&part)?)?;
        }
    }
    Ok(())
}
