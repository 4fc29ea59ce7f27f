//! References on disk: found by the hash of scene and tracer, resumed, never half written.
//!
//! The folder is `$QUELL_CACHE`, or `quell` in the platform's cache folder. A reference is one file a frame, camera and
//! half: `references/<hash>/camera1.0012.a.qref`, a short JSON header and planes of little-endian f32 with a checksum.

use crate::error::Error;
use quell::{Plane, Rgb, Size};
use quell_frames::files::write_bytes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The environment variable that names the folder.
pub const CACHE_VARIABLE: &str = "QUELL_CACHE";

const MAGIC: &[u8; 8] = b"quellref";
/// Raised when the layout changes; older files are then made anew.
const LAYOUT: u32 = 1;
/// A JSON header is never longer.
const LONGEST_HEADER: usize = 1 << 20;

/// Which reference.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ReferenceKey {
    /// Hash of scene, tracer and options, in hexadecimal.
    pub scene_hash: String,
    /// Camera, from 1.
    pub camera: usize,
    /// Frame number.
    pub frame: i64,
    /// `a`, `b`, or another word that separates estimates of the same frame. Letters, digits and `-` only count.
    pub part: String,
}

impl ReferenceKey {
    fn text(&self) -> String {
        format!("{} camera {} frame {} part {}", self.scene_hash, self.camera, self.frame, self.part)
    }
}

/// Samples gathered so far: means, to which more samples can be merged.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulation {
    /// Extent of every plane.
    pub size: Size,
    /// Samples a pixel.
    pub samples: u64,
    /// Further counts, by name.
    pub counts: BTreeMap<String, u64>,
    /// Means and variances, by name.
    pub planes: BTreeMap<String, Plane<Rgb>>,
}

/// What stands at the head of a file.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    layout: u32,
    key: String,
    width: usize,
    height: usize,
    samples: u64,
    counts: BTreeMap<String, u64>,
    planes: Vec<String>,
}

/// A folder of references.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// In this folder; it is made when something is stored.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// In `$QUELL_CACHE`, else in the platform's cache folder; `None` where neither is known.
    pub fn default_place() -> Option<Self> {
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        if let Some(folder) = variable(CACHE_VARIABLE) {
            return Some(Self::at(folder));
        }
        let platform = if cfg!(target_os = "windows") {
            variable("LOCALAPPDATA")
        } else if cfg!(target_os = "macos") {
            variable("HOME").map(|home| home.join("Library/Caches"))
        } else {
            variable("XDG_CACHE_HOME")
                .filter(|folder| folder.is_absolute())
                .or_else(|| variable("HOME").map(|home| home.join(".cache")))
        };
        platform.map(|folder| Self::at(folder.join("quell")))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where a reference lies, or would lie.
    pub fn path(&self, key: &ReferenceKey) -> PathBuf {
        let plain = |text: &str| text.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect::<String>();
        let name = format!("camera{}.{:04}.{}.qref", key.camera, key.frame, plain(&key.part));
        self.folder.join("references").join(plain(&key.scene_hash)).join(name)
    }

    /// What has been gathered of a reference; `None` where there is nothing yet, or only a file of an older layout.
    ///
    /// # Errors
    /// [`Error::Cache`] for a damaged file, I/O errors.
    pub fn load(&self, key: &ReferenceKey) -> Result<Option<Accumulation>, Error> {
        let path = self.path(key);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(quell_frames::Error::io(&path, "read", e).into()),
        };
        decoded(&bytes, key).map_err(|reason| Error::Cache { path, reason })
    }

    /// Stores what has been gathered; the file is replaced as a whole.
    ///
    /// # Errors
    /// I/O errors.
    pub fn store(&self, key: &ReferenceKey, accumulation: &Accumulation) -> Result<(), Error> {
        let header = Header {
            layout: LAYOUT,
            key: key.text(),
            width: accumulation.size.width,
            height: accumulation.size.height,
            samples: accumulation.samples,
            counts: accumulation.counts.clone(),
            planes: accumulation.planes.keys().cloned().collect(),
        };
        let header = serde_json::to_vec(&header)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend((header.len() as u64).to_le_bytes());
        bytes.extend(header);
        for plane in accumulation.planes.values() {
            Error::same_size("reference plane", plane.size(), accumulation.size)?;
            bytes.extend(plane.data().iter().flatten().flat_map(|v| v.to_le_bytes()));
        }
        let checksum = checksum(&bytes);
        bytes.extend(checksum.to_le_bytes());
        Ok(write_bytes(&self.path(key), &bytes)?)
    }
}

/// FNV-1a, 64 bits, over words of 8 bytes: finds damage, not malice.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, |hash, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        (hash ^ u64::from_le_bytes(word)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

fn decoded(bytes: &[u8], key: &ReferenceKey) -> Result<Option<Accumulation>, String> {
    let cut = || "the file is cut short".to_owned();
    let (body, sum) = bytes.split_last_chunk::<8>().ok_or_else(cut)?;
    let rest = body.strip_prefix(MAGIC).ok_or("this is no reference of quell")?;
    if checksum(body) != u64::from_le_bytes(*sum) {
        return Err("the checksum does not fit: the file is damaged or cut short".to_owned());
    }
    let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(cut)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    if length > LONGEST_HEADER || length > rest.len() {
        return Err(cut());
    }
    let (header, pixels) = rest.split_at(length);
    let value: serde_json::Value = serde_json::from_slice(header).map_err(|e| format!("its header: {e}"))?;
    if value.get("layout").and_then(serde_json::Value::as_u64) != Some(u64::from(LAYOUT)) {
        return Ok(None);
    }
    let header: Header = serde_json::from_value(value).map_err(|e| format!("its header: {e}"))?;
    if header.key != key.text() {
        return Err(format!("it holds `{}`, not `{}`", header.key, key.text()));
    }
    let size = Size::new(header.width, header.height);
    let plane_bytes = header.width.checked_mul(header.height).and_then(|n| n.checked_mul(12)).unwrap_or(usize::MAX);
    if plane_bytes == 0 || plane_bytes.checked_mul(header.planes.len()) != Some(pixels.len()) {
        return Err(format!("{} bytes do not hold {} planes of {size}", pixels.len(), header.planes.len()));
    }
    let mut planes = BTreeMap::new();
    for (name, bytes) in header.planes.into_iter().zip(pixels.chunks_exact(plane_bytes)) {
        let component = |b: &[u8], c: usize| f32::from_le_bytes([b[4 * c], b[4 * c + 1], b[4 * c + 2], b[4 * c + 3]]);
        let data = bytes.chunks_exact(12).map(|b| [component(b, 0), component(b, 1), component(b, 2)]).collect();
        planes.insert(name, Plane::from_vec(size, data).map_err(|e| e.to_string())?);
    }
    Ok(Some(Accumulation { size, samples: header.samples, counts: header.counts, planes }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> (ReferenceKey, Accumulation) {
        let size = Size::new(7, 5);
        let plane = |k: f32| Plane::from_fn(size, |x, y| [x as f32 * k, y as f32, f32::NAN]);
        let key = ReferenceKey { scene_hash: "00ff".to_owned(), camera: 2, frame: 12, part: "a".to_owned() };
        let planes = [("beauty".to_owned(), plane(1.0)), ("matte".to_owned(), plane(0.25))].into();
        (key, Accumulation { size, samples: 64, counts: [("rays".to_owned(), 1 << 60)].into(), planes })
    }

    fn bits(a: &Accumulation) -> Vec<u32> {
        a.planes.values().flat_map(|p| p.data().iter().flatten().map(|v| v.to_bits())).collect()
    }

    #[test]
    fn what_is_stored_comes_back_and_damage_is_found() {
        let folder = std::env::temp_dir().join(format!("quell-cache-{}", std::process::id()));
        let cache = Cache::at(&folder);
        let (key, accumulation) = example();
        assert_eq!(cache.load(&key).unwrap(), None);
        cache.store(&key, &accumulation).unwrap();
        let back = cache.load(&key).unwrap().unwrap();
        assert_eq!((back.samples, back.size, &back.counts), (64, accumulation.size, &accumulation.counts));
        assert_eq!(bits(&back), bits(&accumulation));

        let path = cache.path(&key);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            assert!(decoded(&whole[..length], &key).is_err(), "cut at {length}");
        }
        for at in (0..whole.len()).step_by(7) {
            let mut damaged = whole.clone();
            damaged[at] ^= 16;
            assert!(decoded(&damaged, &key).is_err(), "changed at {at}");
        }
        // A file in the wrong place is not taken for another frame's.
        let other = ReferenceKey { frame: 13, ..key.clone() };
        std::fs::copy(&path, cache.path(&other)).unwrap();
        assert!(matches!(cache.load(&other), Err(Error::Cache { .. })));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
