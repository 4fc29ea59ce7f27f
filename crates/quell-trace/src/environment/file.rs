//! Environment maps from Radiance (`.hdr`) and OpenEXR (`.exr`) files.

use super::{Environment, EnvironmentError};
use crate::hash::Hash;
use crate::scene::Scene;
use exr::prelude::{ReadChannels, ReadLayers};
use image::ImageDecoder;
use quell::{Plane, Rgb, Size};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Most texels of an environment map: 8192 x 4096. With its sampling distribution such a map takes 0.5 GiB.
pub const PIXEL_LIMIT: usize = 1 << 25;

/// Texels that a byte of file can stand for at most: run lengths and ZIP on constant pictures reach hundreds. A short
/// file that claims more is lying.
const PIXELS_PER_FILE_BYTE: u64 = 1 << 10;

/// What infinite radiance becomes: the largest half float, where pictures of the sun are cut off anyway.
const BRIGHTEST: f32 = 65504.0;

/// Why a file is no environment map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Its name ends neither in `.hdr` nor in `.exr`.
    #[error("{} is no environment map: the file must be a latitude-longitude picture in .hdr or .exr", .path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The file is damaged, or holds what is not read (deep data, no R, G and B).
    #[error("{} cannot be decoded: {reason}; save it again as .hdr or .exr with channels R, G and B", .path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The map is empty or too large.
    #[error(
        "{} is {width} x {height} texels; an environment map has 1 to {PIXEL_LIMIT}, and no more than its file can \
         hold: scale it down", .path.display()
    )]
    Extent {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

/// What a file held.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentFile {
    /// Radiance, linear; row 0 is the zenith.
    pub texels: Plane<Rgb>,
    /// Texels that were NaN or negative in a channel, which became 0, or infinite, which became 65504.
    pub repaired: usize,
}

/// Reads a latitude-longitude map, recognised by the end of its name.
///
/// # Errors
/// [`EnvironmentFileError`]: the file and what is wrong with it. The extent is checked before anything of its size is
/// allocated.
pub fn read(path: &Path) -> Result<EnvironmentFile, EnvironmentFileError> {
    let format = format(path)?;
    let (reader, length) = open(path)?;
    usable(format, path, reader, length)
}

/// The same of a file that lies in memory, as browsers hand over what they fetch. `path`: its name.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(path: &Path, bytes: &[u8]) -> Result<EnvironmentFile, EnvironmentFileError> {
    usable(format(path)?, path, bytes, bytes.len() as u64)
}

/// Whether the end of its name says that this is an environment map.
pub fn is_named(path: &Path) -> bool {
    format(path).is_ok()
}

/// What a file's name says.
#[derive(Clone, Copy)]
enum Format {
    Hdr,
    Exr,
}

fn format(path: &Path) -> Result<Format, EnvironmentFileError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "hdr" | "pic" => Ok(Format::Hdr),
        "exr" => Ok(Format::Exr),
        _ => Err(EnvironmentFileError::Format { path: path.to_owned() }),
    }
}

/// Decodes `length` bytes and repairs the texels.
fn usable(
    format: Format,
    path: &Path,
    reader: impl BufRead,
    length: u64,
) -> Result<EnvironmentFile, EnvironmentFileError> {
    let mut texels = match format {
        Format::Hdr => read_hdr(path, reader, length)?,
        Format::Exr => read_exr(path, reader, length)?,
    };
    let mut repaired = 0;
    for texel in texels.data_mut() {
        let usable = texel.map(|v| if v >= 0.0 { v.min(BRIGHTEST) } else { 0.0 });
        // Finite values above the largest half float are kept.
        let usable: Rgb =
            std::array::from_fn(|c| if texel[c].is_finite() && texel[c] >= 0.0 { texel[c] } else { usable[c] });
        repaired += usize::from(usable != *texel);
        *texel = usable;
    }
    Ok(EnvironmentFile { texels, repaired })
}

impl EnvironmentFile {
    /// What a user should know of it: which texels were repaired. `path`: the file's name.
    pub fn note(&self, path: &Path) -> Option<String> {
        let count = self.repaired;
        let note = || format!("{}: {count} texels were not finite or negative; they became 0 or 65504", path.display());
        (count > 0).then(note)
    }

    /// Puts the map around a scene, in place of what was there, and makes it part of the scene's identity.
    /// `rotation_rad` turns it about the vertical, `strength` multiplies it.
    ///
    /// # Errors
    /// [`EnvironmentError`]: a strength that is negative or not finite, or makes a texel infinite.
    pub fn surround(self, scene: &mut Scene, rotation_rad: f32, strength: f32) -> Result<(), EnvironmentError> {
        let mut identity = Hash::new();
        identity.number(scene.identity);
        identity.number(self.texels.size().width as u64);
        for value in self.texels.data().iter().flatten().chain([&rotation_rad, &strength]) {
            identity.bytes(&value.to_le_bytes());
        }
        scene.environment = Environment::map(self.texels, rotation_rad, strength)?;
        scene.identity = identity.finish();
        Ok(())
    }
}

fn open(path: &Path) -> Result<(BufReader<File>, u64), EnvironmentFileError> {
    let io = |source| EnvironmentFileError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    Ok((BufReader::new(file), length))
}

fn check_extent(path: &Path, width: usize, height: usize, length: u64) -> Result<Size, EnvironmentFileError> {
    let pixels = width.checked_mul(height).filter(|&p| p > 0 && p <= PIXEL_LIMIT);
    match pixels {
        Some(pixels) if pixels as u64 <= length.saturating_mul(PIXELS_PER_FILE_BYTE) => Ok(Size::new(width, height)),
        _ => Err(EnvironmentFileError::Extent { path: path.to_owned(), width, height }),
    }
}

fn read_hdr(path: &Path, reader: impl BufRead, length: u64) -> Result<Plane<Rgb>, EnvironmentFileError> {
    let wrong = |e: image::ImageError| EnvironmentFileError::Decode { path: path.to_owned(), reason: e.to_string() };
    let decoder = image::codecs::hdr::HdrDecoder::new(reader).map_err(wrong)?;
    let (width, height) = decoder.dimensions();
    let size = check_extent(path, width as usize, height as usize, length)?;
    let picture = image::DynamicImage::from_decoder(decoder).map_err(wrong)?.into_rgb32f();
    let mut values = picture.pixels().map(|p| p.0);
    Ok(Plane::from_fn(size, |_, _| values.next().unwrap_or_default()))
}

fn read_exr(path: &Path, mut reader: impl BufRead, length: u64) -> Result<Plane<Rgb>, EnvironmentFileError> {
    let wrong = |e: exr::error::Error| EnvironmentFileError::Decode { path: path.to_owned(), reason: e.to_string() };
    let mut bytes = Vec::new();
    let io = |source| EnvironmentFileError::Io { path: path.to_owned(), source };
    reader.read_to_end(&mut bytes).map_err(io)?;
    let meta = exr::meta::MetaData::read_from_buffered(bytes.as_slice(), false).map_err(wrong)?;
    for header in &meta.headers {
        check_extent(path, header.layer_size.width(), header.layer_size.height(), length)?;
    }
    let picture = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| Plane::filled(Size::new(size.width(), size.height()), [0.0; 3]),
            |plane: &mut Plane<Rgb>, at, (r, g, b): (f32, f32, f32)| plane.set(at.x(), at.y(), [r, g, b]),
        )
        .first_valid_layer()
        .all_attributes()
        // rayon's own threads would not be those that the caller gave us.
        .non_parallel()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(wrong)?;
    Ok(picture.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A folder of its own for each test.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("quell-environment-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Bright to the right of the middle, above the horizon; dim in all other places.
    fn picture(x: usize, y: usize) -> Rgb {
        if (10..14).contains(&x) && y < 4 { [4.0, 2.0, 1.0] } else { [0.25; 3] }
    }

    fn write(path: &Path, texel: impl Fn(usize, usize) -> Rgb + Sync) {
        if path.extension().unwrap() == "hdr" {
            let file = File::create(path).unwrap();
            let pixels: Vec<image::Rgb<f32>> = (0..16 * 8).map(|i| image::Rgb(texel(i % 16, i / 16))).collect();
            image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 16, 8).unwrap();
        } else {
            exr::prelude::write_rgb_file(path, 16, 8, |x, y| texel(x, y).into()).unwrap();
        }
    }

    #[test]
    fn both_formats_are_read_and_turned() {
        let folder = folder("formats");
        for name in ["map.hdr", "map.exr", "MAP.EXR"] {
            let path = folder.join(name);
            write(&path, picture);
            let file = read(&path).unwrap();
            assert_eq!((file.repaired, file.note(&path)), (0, None));
            assert_eq!(read_bytes(Path::new(name), &std::fs::read(&path).unwrap()).unwrap(), file);
            assert_eq!(file.texels, Plane::from_fn(Size::new(16, 8), picture), "{name}");
            // Column 12 is a quarter to the right of the middle (-z): +x.
            let right = Vec3::new(1.0, 0.6, 0.0).normalize();
            let environment = Environment::map(file.texels.clone(), 0.0, 2.0).unwrap();
            assert_eq!(environment.radiance(right), Vec3::new(8.0, 4.0, 2.0));
            let turned = Environment::map(file.texels, std::f32::consts::FRAC_PI_2, 2.0).unwrap();
            assert_eq!(turned.radiance(right), Vec3::splat(0.5));
            assert_eq!(turned.radiance(Vec3::new(0.0, 0.6, -1.0).normalize()), Vec3::new(8.0, 4.0, 2.0));
            let identity = |turn, strength| {
                let mut scene = Scene::new("any");
                read(&path).unwrap().surround(&mut scene, turn, strength).unwrap();
                assert_eq!(scene.environment.radiance(Vec3::NEG_Y), Vec3::splat(0.25 * strength));
                scene.identity
            };
            assert_eq!(identity(0.0, 1.0), identity(0.0, 1.0));
            assert!(identity(0.0, 1.0) != identity(0.1, 1.0) && identity(0.0, 1.0) != identity(0.0, 1.1));
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn bad_texels_are_counted_and_set_to_zero() {
        let folder = folder("texels");
        let path = folder.join("map.exr");
        write(&path, |x, y| match (x, y) {
            (0, 0) => [f32::NAN, 1.0, 1.0],
            (1, 0) => [1.0, -2.0, 1.0],
            (2, 0) => [1.0, 1.0, f32::INFINITY],
            (3, 0) => [1e6, 1.0, 1.0],
            _ => [1.0; 3],
        });
        let file = read(&path).unwrap();
        assert_eq!(file.repaired, 3);
        assert!(file.note(Path::new("map.exr")).unwrap().starts_with("map.exr: 3 texels"));
        assert_eq!(file.texels.row(0)[..4], [[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, BRIGHTEST], [1e6, 1.0, 1.0]]);
        assert!(Environment::map(file.texels, 0.0, 1.0).is_ok());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn bad_files_are_named() {
        let folder = folder("bad");
        assert!(matches!(read(&folder.join("none.hdr")), Err(EnvironmentFileError::Io { .. })));
        assert!(matches!(read(&folder.join("map.png")), Err(EnvironmentFileError::Format { .. })));
        assert!(matches!(read(&folder), Err(EnvironmentFileError::Format { .. })));
        assert!(matches!(read_bytes(Path::new("map.png"), b""), Err(EnvironmentFileError::Format { .. })));
        assert!(is_named(Path::new("Sky.HDR")) && !is_named(Path::new("sky.glb")));
        for name in ["map.hdr", "map.exr"] {
            let path = folder.join(name);
            std::fs::write(&path, b"nothing of the kind").unwrap();
            let error = read(&path).unwrap_err();
            assert!(matches!(error, EnvironmentFileError::Decode { .. }), "{error}");
            assert!(error.to_string().contains(name), "{error}");
            write(&path, picture);
            let whole = std::fs::read(&path).unwrap();
            for cut in (0..whole.len()).step_by(7) {
                std::fs::write(&path, &whole[..cut]).unwrap();
                assert!(read(&path).is_err(), "{name} cut at {cut}");
                assert!(read_bytes(Path::new(name), &whole[..cut]).is_err(), "{name} cut at {cut}");
            }
        }
        let path = folder.join("huge.hdr");
        std::fs::write(&path, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 60000\n").unwrap();
        assert!(matches!(read(&path), Err(EnvironmentFileError::Extent { width: 60000, .. })));
        std::fs::write(&path, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 4000\n").unwrap();
        assert!(matches!(read(&path), Err(EnvironmentFileError::Extent { width: 4000, .. })));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
