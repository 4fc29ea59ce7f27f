//! The file: binary container or JSON, read under a limit.

use super::Limits;
use super::error::{Fault, Problem};
use super::schema::Root;
use std::path::Path;

/// `glTF`, little-endian.
const MAGIC: [u8; 4] = *b"glTF";
const CHUNK_JSON: [u8; 4] = *b"JSON";
const CHUNK_BIN: [u8; 4] = *b"BIN\0";
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// What a file holds: its JSON, and the range of its bytes that is the binary chunk.
pub(super) struct Container {
    pub(super) root: Root,
    pub(super) bytes: Vec<u8>,
    pub(super) binary: Option<std::ops::Range<usize>>,
}

/// Reads an ordinary file of at most `limit` bytes. Others, such as pipes and devices, may never end.
pub(super) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, Problem> {
    let failed = |e: std::io::Error| Problem::Read(e.to_string());
    let about = std::fs::metadata(path).map_err(failed)?;
    if !about.is_file() {
        return Err(Problem::Read("it is a folder or a device; give a .glb or .gltf file".to_owned()));
    }
    if about.len() > limit {
        return Err(Problem::Limit { what: "bytes of the file", value: about.len(), limit });
    }
    // A file may grow while it is read.
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    std::io::Read::read_to_end(&mut std::io::Read::take(file, limit), &mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Takes the file apart.
pub(super) fn parse(bytes: Vec<u8>, limits: &Limits) -> Result<Container, Fault> {
    if bytes.is_empty() {
        return Err(Fault::whole(Problem::NotGltf("it is empty".to_owned())));
    }
    if bytes.len() < MAGIC.len() && MAGIC.starts_with(&bytes) {
        return Err(cut("the header", HEADER as u64, bytes.len()));
    }
    if !bytes.starts_with(&MAGIC) {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
        let first = text.iter().find(|b| !b.is_ascii_whitespace());
        if first != Some(&b'{') {
            let problem = "it begins neither with `glTF` nor with JSON";
            return Err(Fault::whole(Problem::NotGltf(problem.to_owned())));
        }
        let root = json(text, limits)?;
        return Ok(Container { root, bytes, binary: None });
    }
    let [version, length] = [4, 8].map(|at| word(&bytes, at));
    let (Some(version), Some(length)) = (version, length) else {
        return Err(cut("the header", HEADER as u64, bytes.len()));
    };
    if version != 2 {
        return Err(Fault::whole(Problem::NotGltf(format!("its container has version {version}, not 2"))));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(cut("the container", length as u64, bytes.len()));
    }
    let mut root = None;
    let mut binary = None;
    let mut at = HEADER;
    while at + CHUNK_HEADER <= length {
        let size = word(&bytes, at).unwrap_or(0) as usize;
        let kind = bytes.get(at + 4..at + 8).unwrap_or_default();
        let begin = at + CHUNK_HEADER;
        let end = begin.saturating_add(size);
        let Some(chunk) = bytes.get(begin..end).filter(|_| end <= length) else {
            return Err(cut("a chunk", end as u64, length));
        };
        if root.is_none() {
            if kind != CHUNK_JSON {
                return Err(Fault::whole(Problem::NotGltf("its first chunk is not JSON".to_owned())));
            }
            root = Some(json(chunk, limits)?);
        } else if kind == CHUNK_BIN && binary.is_none() {
            binary = Some(begin..end);
        }
        // Chunks of other kinds are to be passed over. Sizes are multiples of 4, or should be.
        at = end.next_multiple_of(4);
    }
    match root {
        Some(root) => Ok(Container { root, bytes, binary }),
        None => Err(cut("the JSON chunk", (HEADER + CHUNK_HEADER) as u64, length)),
    }
}

fn cut(what: &'static str, needed: u64, found: usize) -> Fault {
    Fault::whole(Problem::Cut { what, needed, found: found as u64 })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn json(text: &[u8], limits: &Limits) -> Result<Root, Fault> {
    let (value, limit) = (text.len() as u64, limits.json_bytes);
    if value > limit {
        return Err(Fault::whole(Problem::Limit { what: "bytes of JSON", value, limit }));
    }
    // The container pads with spaces; some writers pad with zeros.
    let end = text.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1);
    let mut deserializer = serde_json::Deserializer::from_slice(&text[..end]);
    let root: Root = serde_path_to_error::deserialize(&mut deserializer).map_err(|e| {
        // `.` and `?` stand for the whole, and for what was not reached.
        let place = e.path().to_string().trim_end_matches(['.', '?']).to_owned();
        Fault { place, problem: Problem::Json(e.inner().to_string()) }
    })?;
    deserializer.end().map_err(|e| Fault::whole(Problem::Json(e.to_string())))?;
    let version = root.asset.version.as_str();
    if version.split('.').next() != Some("2") {
        let problem = if version.is_empty() {
            "its JSON has no `asset.version`".to_owned()
        } else {
            format!("it is written in version {version}, not 2.0")
        };
        return Err(Fault { place: "asset.version".to_owned(), problem: Problem::NotGltf(problem) });
    }
    Ok(root)
}
