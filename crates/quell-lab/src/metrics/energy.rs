//! Energy: a denoiser may not darken or brighten.

use crate::error::Error;
use quell::{Plane, Rgb, Size};

/// The energy of one region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionEnergy {
    /// Its label.
    pub region: u32,
    /// Its number of pixels.
    pub pixels: usize,
    /// Sum of the picture over sum of the reference; `None` where the reference is black.
    pub ratio: Option<f64>,
}

/// Sum of the picture over sum of the reference, all components together: sum D / sum R.
///
/// # Errors
/// [`Error::Size`]; [`Error::Empty`] where the reference is black.
pub fn energy(picture: &Plane<Rgb>, reference: &Plane<Rgb>) -> Result<f64, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    let (d, r) = (sum(picture.data()), sum(reference.data()));
    if r == 0.0 {
        return Err(Error::Empty { what: "the reference is black: its energy is no measure".to_owned() });
    }
    Ok(d / r)
}

/// [`energy`] of each region, sorted by label. `regions` labels every pixel: surface ids, or [`grid_regions`].
///
/// # Errors
/// [`Error::Size`], [`Error::Empty`] without pixels.
pub fn energy_by_region(
    picture: &Plane<Rgb>,
    reference: &Plane<Rgb>,
    regions: &Plane<u32>,
) -> Result<Vec<RegionEnergy>, Error> {
    Error::same_size("picture", picture.size(), reference.size())?;
    Error::same_size("regions", regions.size(), reference.size())?;
    let mut sums = std::collections::BTreeMap::<u32, (usize, f64, f64)>::new();
    for ((d, r), &region) in picture.data().iter().zip(reference.data()).zip(regions.data()) {
        let entry = sums.entry(region).or_default();
        entry.0 += 1;
        entry.1 += sum(std::slice::from_ref(d));
        entry.2 += sum(std::slice::from_ref(r));
    }
    Ok(sums
        .into_iter()
        .map(|(region, (pixels, d, r))| RegionEnergy { region, pixels, ratio: (r != 0.0).then(|| d / r) })
        .collect())
}

/// Labels of a regular grid, row by row: `columns` x `rows` regions of nearly equal extent.
pub fn grid_regions(size: Size, columns: usize, rows: usize) -> Plane<u32> {
    let (columns, rows) = (columns.max(1), rows.max(1));
    Plane::from_fn(size, |x, y| ((y * rows / size.height) * columns + x * columns / size.width) as u32)
}

fn sum(pixels: &[Rgb]) -> f64 {
    pixels.iter().flatten().map(|&v| f64::from(v)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dark_quarter_shows_by_region_as_it_does_not_in_total() {
        let size = Size::new(20, 10);
        let reference = Plane::filled(size, [1.0, 2.0, 3.0]);
        let picture = Plane::from_fn(size, |x, y| match (x < 10, y < 5) {
            (true, true) => [0.5, 1.0, 1.5],
            (false, true) => [1.5, 3.0, 4.5],
            _ => [1.0, 2.0, 3.0],
        });
        assert!((energy(&picture, &reference).unwrap() - 1.0).abs() < 1e-9);
        let by_region = energy_by_region(&picture, &reference, &grid_regions(size, 2, 2)).unwrap();
        let ratios: Vec<f64> = by_region.iter().map(|r| r.ratio.unwrap()).collect();
        assert_eq!((ratios, by_region[0].pixels), (vec![0.5, 1.5, 1.0, 1.0], 50));
        assert!(energy(&picture, &Plane::filled(size, [0.0; 3])).is_err());
    }
}
